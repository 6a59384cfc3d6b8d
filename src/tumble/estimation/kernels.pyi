# Types for callers: the source has those of C.

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]

def eliminate(diagonal: Floats, lower: Floats, border: Floats, gradient: Floats) -> int: ...
def substitute(
    diagonal: Floats, lower: Floats, border: Floats, gradient: Floats, corner_step: Floats, steps: Floats
) -> None: ...
def invert_selected(
    diagonal: Floats,
    lower: Floats,
    border: Floats,
    corner_covariance: Floats,
    own: Floats,
    following: Floats,
    with_border: Floats,
) -> None: ...
