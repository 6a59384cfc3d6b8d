# Types for callers: the source has those of C.

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Integers: TypeAlias = npt.NDArray[np.int64]

SQUARE: int
NORM: int
FIXED: int
POPE: int

def adjust_norm_sets(
    observed: Floats,
    variance: Floats,
    reference: Floats,
    start: Floats,
    size: int,
    estimator: int,
    limit: int,
    tolerance: float,
    parameters: Floats,
    cofactors: Floats,
    sigma0: Floats,
    iterations: Integers,
) -> None: ...
def add_mean_noise(rng: np.random.Generator, sigma: float, samples: int, means: Floats) -> None: ...
