"""What the gyros see of a pose that sways within a hold: where its middle stands between its head and its tail.

The mean rate over a hold tells the bias and what the pose turns from head to tail, which nothing takes apart. The
swing does not depend on a bias that stays: the mean of the integral over the middle's samples, less the share of the
whole hold's turn that a steady rate would have brought there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tumble.arrays import AnyArray, Series, Vector, Vectors
from tumble.calibration.equations.turn import HoldsAndTurns
from tumble.estimation.wander import wander_basis

# Cosines over a hold by which the bias's own wander counts: the swing sees the first few.
_MODES = 8
_AT_A_TIME = 65_536  # samples


@dataclass(frozen=True, slots=True)
class Swings:
    """The gyros' own account of each hold's middle.

    Attributes
    ----------
    value : (holds, 3) raw s.
    covariance : (holds, 3, 3) (raw s)².
    share : (holds,) of the hold's turn that a steady rate has brought by its middle.
    """

    value: Vectors
    covariance: AnyArray
    share: Series


def hold_swings(base: HoldsAndTurns, density: Vector) -> Swings:
    """Return the swing of every hold.

    Parameters
    ----------
    base : holds, samples and noise.
    density : (3,) raw², by which the gyros' biases wander per unit of ``ln f``.
    """
    holds = base.holds
    value, share = np.zeros((holds, 3)), np.zeros(holds)
    white, wander = np.zeros(holds), np.zeros(holds)
    step = (base.time[-1] - base.time[0]) / max(base.time.shape[0] - 1, 1)
    for k in range(holds):
        first, last = int(base.head[k, 0]), int(base.tail[k, 1])
        weights = _later_share(last - first, int(base.head[k, 1]) - first, int(base.tail[k, 0]) - first)
        share[k] = weights.mean()
        kernel = (weights - share[k]) * step
        value[k] = kernel @ base.raw_rate[first:last]
        white[k] = kernel @ kernel / step
        places: Series = (np.arange(kernel.size, dtype=np.float64) + 0.5) / kernel.size
        # A hold of hours has millions of samples: not all cosines of all of them at a time.
        pieces = [slice(at, at + _AT_A_TIME) for at in range(0, kernel.size, _AT_A_TIME)]
        seen = sum(kernel[piece] @ wander_basis(places[piece], _MODES)[0] for piece in pieces)
        wander[k] = np.sum(wander_basis(places[:1], _MODES)[1] * seen**2)
    variance = white[:, None] * base.rate_random_walk + wander[:, None] * density
    return Swings(value, variance[:, :, None] * np.eye(3), share)


def _later_share(samples: int, head: int, tail: int) -> Series:
    """Return (samples,) the share of the middle's samples that come after each one."""
    if tail <= head:
        head = samples // 2
        tail = head + 1
    at = np.arange(samples)
    return np.clip((tail - 0.5 - at) / (tail - head), 0.0, 1.0)
