"""Recursions over samples, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit, types

_SIGNAL = types.float64[:, ::1]


@njit([types.void(_SIGNAL, types.float64, _SIGNAL)], cache=True, nogil=True)
def add_markov(drive: np.ndarray, memory: float, total: np.ndarray) -> None:
    """Add the process x[i] = memory * x[i - 1] + drive[i], of each column, to `total`."""
    for axis in range(drive.shape[1]):
        x = 0.0
        for i in range(drive.shape[0]):
            x = memory * x + drive[i, axis]
            total[i, axis] += x


__all__ = ["add_markov"]
