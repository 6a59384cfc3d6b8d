# Types for callers: the source has those of C.

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Integers: TypeAlias = npt.NDArray[np.int64]

def running_sum(signal: Floats, level: float, phase: Floats) -> None: ...
def second_difference_squares(phase: Floats, steps: Integers, sums: Floats) -> None: ...
