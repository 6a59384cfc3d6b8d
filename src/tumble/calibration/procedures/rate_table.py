"""The rotation-rate test (Hayal 2010, 2.4.1.2): a table turns the unit at known rates, both ways, about known axes."""

from __future__ import annotations

from tumble.calibration.procedure import Procedure

PROCEDURE = Procedure(
    "rate-table",
    "fixture",
    "a rate table",
    "each axis up on the table, spun both ways at several rates",
    "gyro biases, scale factors, misalignments against the fixture, linearity and asymmetry; of the accelerometers "
    "what the faces show",
    "rate-table.md",
    promises=("gyros",),
    example="rate-table",
    placement="The placement on the table limits the misalignments one to one. The modified multi-position "
    "procedure finds them from the same table without believing the placement, and calibrates the accelerometers too.",
    believes_poses=True,
)
