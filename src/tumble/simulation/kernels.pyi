# Types for callers: the source has those of C.

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Integers: TypeAlias = npt.NDArray[np.int64]

def add_white(rng: np.random.Generator, scale: float, total: Floats) -> None: ...
def add_markov(
    rng: np.random.Generator, memory: Floats, gain: Floats, state: Floats, total: Floats
) -> None: ...
def add_walk(rng: np.random.Generator, step: float, total: Floats) -> None: ...
def carry_remainders(signal: Floats, step: float) -> None: ...
def fill_progress(
    time: Floats, edges: Floats, ramp_up: Floats, ramp_down: Floats, step: Integers, progress: Floats
) -> None: ...
def chain_turns(vector: Floats, wobble: Floats, first: Floats) -> None: ...
def fill_attitudes(
    first: Floats,
    vector: Floats,
    step: Integers,
    share: Floats,
    wobble: Floats,
    shake: Floats,
    quaternions: Floats,
) -> None: ...
def fill_seen(quaternions: Floats, vector_n: Floats, seen: Floats) -> None: ...
def fill_mean_rates(
    first: Floats,
    vector: Floats,
    step: Integers,
    share: Floats,
    wobble: Floats,
    shake: Floats,
    edges: Floats,
    earth_n: Floats,
    rates: Floats,
) -> None: ...
