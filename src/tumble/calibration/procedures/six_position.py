"""The six-position test (Aggarwal et al. 2008; Hayal 2010, 2.3 to 2.12): each axis up and down, as level as is said."""

from __future__ import annotations

from tumble.calibration.poses import match_faces
from tumble.calibration.procedure import Procedure

PROCEDURE = Procedure(
    "six-position",
    "fixture",
    "a levelled plate and a cube's faces",
    "each axis up and down, levelled",
    "accelerometer biases and scale factors, and misalignments as exactly as the faces are placed",
    "six-position.md",
    promises=("accelerometers",),
    placement="The placement limits the scale factors and biases: level the plate, use the unit's own flat "
    "faces, and say in the protocol how well (`uncertainty_deg`). The hand-held and multi-position procedures need "
    "no level.",
    believes_poses=True,
    assumes=match_faces,
)
