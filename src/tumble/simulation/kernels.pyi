# Types for callers: the source has those of C.

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]

def add_white(rng: np.random.Generator, scale: float, total: Floats) -> None: ...
def add_markov(
    rng: np.random.Generator, memory: Floats, gain: Floats, state: Floats, total: Floats
) -> None: ...
def add_walk(rng: np.random.Generator, step: float, total: Floats) -> None: ...
def add_white_and_digitise(
    rng: np.random.Generator, scale: float, step: float, limit: float, signal: Floats
) -> None: ...
def carry_remainders(signal: Floats, step: float) -> None: ...
