# Types for callers: the source has those of C.

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Integers: TypeAlias = npt.NDArray[np.int64]
Flags: TypeAlias = npt.NDArray[np.bool_]

TIME_OFFSET: int
LEVER_ARM: int
G_SENSITIVITY: int
GYROSCOPE: int
ACCELEROMETER: int

def gather_sensors(
    sensor: Floats,
    kind: Integers,
    row: Integers,
    column: Integers,
    correction: Floats,
    lever: Floats,
    nominal: Floats,
) -> float: ...
def apply_errors(nav: Floats, sensor: Floats, error: Floats) -> None: ...
def run(
    time: Floats,
    rate: Floats,
    force: Floats,
    means: bool,
    stride: int,
    longest: float,
    unseen: Floats,
    nav: Floats,
    sensor: Floats,
    P: Floats,
    kind: Integers,
    row: Integers,
    column: Integers,
    decay: Floats,
    drive: Floats,
    white: Floats,
    nominal_lever: Floats,
    event_time: Floats,
    event_fix: Integers,
    fix_position: Floats,
    fix_position_covariance: Floats,
    fix_velocity: Floats,
    fix_velocity_covariance: Floats,
    use: Flags,
    gate: float,
    patience: int,
    navs: Floats,
    sensors: Floats,
    sigmas: Floats,
    errors: Floats,
    covariances: Floats,
    predicted: Floats,
    transitions: Floats,
    innovations: Floats,
    innovation_sigmas: Floats,
    distances: Floats,
    taken: Flags,
) -> None: ...
