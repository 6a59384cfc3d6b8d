"""Does the gyro's bias jump during the recording? A knock, a supply or a defect can do it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tumble.arrays import Series, Vectors

# Chance of calling a step on any axis where there is none.
FALSE_ALARM = 0.01
# Holds needed on either side of a step to tell it from one odd hold.
SMALLEST_SIDE = 4


@dataclass(frozen=True, slots=True)
class BiasStep:
    """A jump of one axis' output at rest between hold `before` and hold `before + 1`, rad/s."""

    axis: int
    before: int
    size: float
    sigma: float


def find_bias_step(residual: Vectors, variance: Vectors) -> BiasStep | None:
    """Return the most significant step in the hold means' residuals, or None.

    Parameters
    ----------
    residual : (holds, 3) observed minus predicted mean rate at rest, rad/s.
    variance : (holds, 3) of each, (rad/s)²; only their ratios matter, the level is estimated.

    Notes
    -----
    For every split the weighted means of both sides are compared; the noise level is the median of
    the residuals about them, so that some odd holds do not hide a step. The most significant of all
    splits of three axes is held against Student's limit for that many trials (Bonferroni).
    """
    from scipy.special import stdtrit

    holds = residual.shape[0]
    splits = range(SMALLEST_SIDE, holds - SMALLEST_SIDE + 1)
    trials = 3 * len(splits)
    if trials < 3:
        return None
    freedom: float = max(0.37 * (holds - 2), 3.0)
    level: float = 1.0 - FALSE_ALARM / (2.0 * trials)
    limit = float(stdtrit(freedom, level))
    best: tuple[float, BiasStep] | None = None
    for axis in range(3):
        weight = 1.0 / variance[:, axis]
        for split in splits:
            step = _step(residual[:, axis], weight, split)
            significance = abs(step[0]) / step[1]
            if significance > limit and (best is None or significance > best[0]):
                best = (significance, BiasStep(axis, split - 1, step[0], step[1]))
    return None if best is None else best[1]


def _step(values: Series, weight: Series, split: int) -> tuple[float, float]:
    """Return the step at `split` and its sigma, the noise level robustly from both sides."""
    sides = (slice(0, split), slice(split, None))
    means = [float(np.sum(weight[s] * values[s]) / np.sum(weight[s])) for s in sides]
    residual = np.concatenate([values[s] - m for s, m in zip(sides, means, strict=True)])
    level = 1.4826 * float(np.median(np.abs(residual) * np.sqrt(weight)))
    spread = np.sqrt(sum(1.0 / float(np.sum(weight[s])) for s in sides))
    return means[1] - means[0], max(level, 1e-12) * float(spread)
