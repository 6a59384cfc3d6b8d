# Types for callers: the source has those of C.

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]

def run_from_each(
    time: Floats,
    rate: Floats,
    force: Floats,
    means: bool,
    starts: Floats,
    begins: Floats,
    goals: Floats,
    corrections: Floats,
    found: Floats,
) -> None: ...
