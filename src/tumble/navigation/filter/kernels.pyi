# Types for callers: the source has those of C.

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Integers: TypeAlias = npt.NDArray[np.int64]
Flags: TypeAlias = npt.NDArray[np.bool_]

def gather_sensors(sensor: Floats, place: Integers, nominal: Floats, parameters: Floats) -> None: ...
def apply_errors(nav: Floats, sensor: Floats, error: Floats) -> None: ...
def run(
    time: Floats,
    signals: Floats,
    means: bool,
    stride: int,
    longest: float,
    unseen: Floats,
    nav: Floats,
    sensor: Floats,
    P: Floats,
    place: Integers,
    motion: Floats,
    white: Floats,
    nominal: Floats,
    event_time: Floats,
    event_fix: Integers,
    fixes: Floats,
    fix_covariances: Floats,
    use: Flags,
    gate: float,
    patience: int,
    navs: Floats,
    sensors: Floats,
    sigmas: Floats,
    errors: Floats,
    kept: Floats,
    innovations: Floats,
    distances: Floats,
    taken: Flags,
) -> None: ...
def run_from_each(
    time: Floats,
    signals: Floats,
    means: bool,
    starts: Floats,
    begins: Floats,
    rows: Integers,
    goals: Floats,
    parameters: Floats,
    found: Floats,
) -> None: ...
