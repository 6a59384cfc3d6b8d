# Types for callers: the source has those of C.

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Integers: TypeAlias = npt.NDArray[np.int64]

def play_sequences(
    rng: np.random.Generator,
    C_bn: Floats,
    axes: Floats,
    angles: Floats,
    samples: Integers,
    window: int,
    earth: Floats,
    gravity: float,
    step: float,
    triads: Floats,
    sigma: Floats,
    pulse: Floats,
    rate: Floats,
    force: Floats,
) -> None: ...
def compensate(raw: Floats, bias: Floats, asymmetry: Floats, inverse: Floats, true: Floats) -> None: ...
