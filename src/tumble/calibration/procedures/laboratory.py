"""The traditional laboratory method: known attitudes, known axes (24 positions and a three-axis rotation)."""

from __future__ import annotations

from tumble.calibration.procedure import Procedure

PROCEDURE = Procedure(
    "laboratory",
    "fixture",
    "a table levelled and aligned to north",
    "each axis up and down with four headings, three axes turned about both ways",
    "both triads against the table's axes, as exactly as the table is aligned",
    "laboratory.md",
    promises=("accelerometers", "gyros"),
    placement="The table's alignment limits the misalignments one to one, and nothing in the residuals shows it. "
    "The turntable procedure calibrates both triads on the same table without any alignment.",
    example="laboratory",
    believes_poses=True,
    free_turns=False,
)
