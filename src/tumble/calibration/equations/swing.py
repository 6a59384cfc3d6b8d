"""What the gyros see of a pose that sways within a hold: where its middle stands between its head and its tail.

The mean rate over a hold tells the bias and what the pose turns from head to tail, which nothing takes apart. The
swing does not depend on a bias that stays: the mean of the integral over the middle's samples, less the share of the
whole hold's turn that a steady rate would have brought there.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Series, Vector, Vectors
from tumble.calibration.equations.turn import HoldsAndTurns
from tumble.estimation.wander import wander_basis
from tumble.records import dataclass

# Cosines over a hold by which the bias's own wander counts: the swing sees the first few.
_MODES = 8


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
    amplitudes = wander_basis(np.zeros(1), _MODES)[1]
    alike: dict[tuple[int, ...], tuple[Series, float, float, float]] = {}
    for k in range(holds):
        first, last = int(base.head[k, 0]), int(base.tail[k, 1])
        own = last - first, *_middle(base, k)
        if own not in alike:
            weights = _later_share(*own)
            mean = float(weights.mean())
            kernel = (weights - mean) * step
            slow = float(np.sum(amplitudes * (step * _cosine_sums(*own)) ** 2))
            alike[own] = kernel, mean, float(kernel @ kernel) / step, slow
        kernel, share[k], white[k], wander[k] = alike[own]
        value[k] = kernel @ base.raw_rate[first:last]
    variance = white[:, None] * base.rate_random_walk + wander[:, None] * density
    return Swings(value, variance[:, :, None] * np.eye(3), share)


def _middle(base: HoldsAndTurns, k: int) -> tuple[int, int]:
    """Return from which sample of a hold to which its middle lies; one sample where head and tail leave none."""
    first, last = int(base.head[k, 0]), int(base.tail[k, 1])
    start, stop = int(base.head[k, 1]) - first, int(base.tail[k, 0]) - first
    return (start, stop) if stop > start else ((last - first) // 2, (last - first) // 2 + 1)


def _later_share(samples: int, start: int, stop: int) -> Series:
    """Return (samples,) the share of the middle's samples that come after each one."""
    return np.clip((stop - 0.5 - np.arange(samples)) / (stop - start), 0.0, 1.0)


def _cosine_sums(samples: int, start: int, stop: int) -> Series:
    """Return (modes,) the sums of `_later_share`, less its mean, times ``cos(n pi (i + 1/2) / samples)``.

    The share falls evenly over the middle, so that the sums are geometric; a constant has none.
    """
    turn = 0.5 * np.pi * np.arange(1, _MODES + 1) / samples
    apart = 2.0 * np.sin(turn * (stop + start)) * np.sin(turn * (stop - start))
    return np.cos(turn) * apart / (4.0 * np.sin(turn) ** 2 * (stop - start))
