# Types for callers: the source has those of C.

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]

def block_moments(signal: Floats, size: int, mean: Floats, roughness: npt.NDArray[np.float32]) -> None: ...
def triangle_smooth(mean: Floats, half_width: int, smooth: Floats) -> None: ...
def change_sizes(smooth: Floats, lag: int, sizes: Floats) -> None: ...
