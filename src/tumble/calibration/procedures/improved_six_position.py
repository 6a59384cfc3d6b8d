"""The improved six-position test: the whole matrix from the readings across each axis, too (see `six_position`)."""

from __future__ import annotations

from tumble.calibration.procedure import Procedure
from tumble.calibration.procedures.six_position import run_faces

PROCEDURE = Procedure(
    "improved-six-position",
    lambda session: run_faces(session, improved=True),
    "fixture",
    "the same, placed with care",
    "each axis up and down, levelled",
    "the accelerometers' whole matrix, as exactly as the faces are placed",
    "six-position.md",
    remedy="place the unit more exactly, or repeat the poses and hold them longer",
    norms_from="the noise and tilts of the placement",
    placement="The placement limits the misalignments one to one: repeat the six positions with the "
    "unit placed anew, or use the multi-position procedure, whose non-orthogonalities need no level.",
    counts_between_holds=True,
    believes=True,
)
