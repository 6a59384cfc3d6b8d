"""The improved six-position test: the same faces, placed with care and often, for the whole matrix."""

from __future__ import annotations

from tumble.calibration.poses import match_faces
from tumble.calibration.procedure import Procedure

PROCEDURE = Procedure(
    "improved-six-position",
    "fixture",
    "the same, placed with care",
    "each axis up and down, levelled",
    "the accelerometers' whole matrix, as exactly as the faces are placed",
    "six-position.md",
    promises=("accelerometers",),
    placement="The placement limits the misalignments one to one: repeat the six positions with the "
    "unit placed anew, or use the multi-position procedure, whose non-orthogonalities need no level.",
    believes_poses=True,
    assumes=match_faces,
)
