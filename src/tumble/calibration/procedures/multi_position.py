"""Many poses that nobody has to know (Shin and El-Sheimy; Hayal 2010): gravity has the same norm in all of them."""

from __future__ import annotations

from tumble.calibration.procedure import Procedure

PROCEDURE = Procedure(
    "multi-position",
    "accelerometer-x",
    "nothing, and a gyro without turns",
    "nine or more poses (six with an earlier calibration); turns do not matter",
    "accelerometers in full; of the gyros what the Earth's rotation and the turns determine",
    "multi-position.md",
    promises=("accelerometers",),
)
