# Types for callers: the source has those of C.

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]

def follow_temperature(
    time: Floats,
    recorded: Floats,
    smoothing: float,
    lag: float,
    width: float,
    dead_band: float,
    carried: Floats,
    path: Floats,
) -> None: ...
def correct_triad(
    raw: Floats,
    coupled: Floats,
    values: Floats,
    bias: Floats,
    bias_terms: Floats,
    matrix: Floats,
    matrix_terms: Floats,
    sensitivity: Floats,
    sensitivity_terms: Floats,
    asymmetry: Floats,
    quadratic: Floats,
    true: Floats,
) -> int: ...
