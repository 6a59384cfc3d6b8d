"""The strapdown rotation test on a two-axis fixture (Savage 2018): rotations from rest to rest.

Optional terms are sought: sequences of rotations both ways are made to show asymmetry.
"""

from __future__ import annotations

from tumble.calibration.procedure import Procedure

PROCEDURE = Procedure(
    "strapdown-rotation",
    "mean-gyro",
    "a fixture with two axes, good to 0.1°",
    "17 sequences of rotations, at rest before and after each; roughly where north is",
    "both triads in full with the asymmetry of their scale factors, and what is between them",
    "strapdown-rotation.md",
    promises=("accelerometers", "gyros"),
    example="strapdown-rotation",
    believes_poses=True,
    seeks=frozenset({"accelerometer_asymmetry", "gyro_asymmetry"}),
)
