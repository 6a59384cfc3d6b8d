# Types for callers: the source has those of C.

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]

def play_dwells(
    rng: np.random.Generator, true: Floats, sigma: Floats, samples: int, means: Floats
) -> None: ...
def play_rotations(
    rng: np.random.Generator,
    wave: Floats,
    step: Floats,
    sigma: Floats,
    samples: int,
    interval: float,
    integrals: Floats,
    scatter: Floats,
) -> None: ...
