"""Modified multi-position calibration on a single-axis table (Syed et al. 2007; Hayal 2010, 2.4.2.2).

The unit leans on the table in poses that nobody has to know, and the table turns about the vertical at known rates.
"""

from __future__ import annotations

from tumble.calibration.procedure import Procedure

PROCEDURE = Procedure(
    "modified-multi-position",
    "accelerometer-x",
    "a single-axis table and hands",
    "nine or more poses on the table, each spun both ways",
    "both triads in full, and the rotation between them",
    "modified-multi-position.md",
    promises=("accelerometers", "gyros"),
    example="modified-multi-position",
    believes_poses=True,
    free_turns=False,
)
