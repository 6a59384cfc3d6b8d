# Types for callers: the source has those of C.

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]

def integrate(
    time: Floats,
    rate: Floats,
    force: Floats,
    means: bool,
    every: int,
    start: Floats,
    position: Floats,
    velocity: Floats,
    quaternion: Floats,
) -> None: ...
