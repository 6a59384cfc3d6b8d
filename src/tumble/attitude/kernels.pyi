# Types for callers: the source has those of C.

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Integers: TypeAlias = npt.NDArray[np.int64]

def integrate_segments(
    time: Floats,
    raw_rate: Floats,
    raw_force: Floats,
    gyro_inverse: Floats,
    gyro_bias: Floats,
    g_sensitivity: Floats,
    force_inverse: Floats,
    force_bias: Floats,
    starts: Integers,
    stops: Integers,
    C_start_end: Floats,
    gyro_sums: Floats,
) -> None: ...
def fill_rotation_vectors(C: Floats, vectors: Floats) -> None: ...
def average_windows(
    time: Floats,
    raw_rate: Floats,
    raw_force: Floats,
    gyro_inverse: Floats,
    gyro_bias: Floats,
    force_inverse: Floats,
    force_bias: Floats,
    starts: Integers,
    stops: Integers,
    backward: bool,
    means: Floats,
) -> None: ...
def transform_sequence(
    rate: Floats,
    force: Floats,
    step: float,
    earth: Floats,
    first_weights: Floats,
    first: int,
    last_weights: Floats,
    last: int,
    averages: Floats,
    C_start_end: Floats,
) -> None: ...
