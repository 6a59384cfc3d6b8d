"""Means of holds whose covariance comes from a model of the noise instead of their own scatter.

The scatter within holds shows white noise, and hardly what wanders from hold to hold: flicker in part, a
rate random walk or a slow Gauss-Markov process not at all. A model from hours at rest knows them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tumble.noise import NoiseModel
from tumble.recording import Recording
from tumble.segmentation.averages import EXCESS_FALSE_ALARM
from tumble.segmentation.observations import HoldMeans
from tumble.segmentation.timeline import Timeline

# Degrees of freedom of a hold's own scatter: what batch means of an undisturbed hold have.
_OWN_FREEDOM = 7.0
# Standard deviations of holds that are on the whole so many times the model's are of another unit.
_ANOTHER_UNIT = 1.5


def model_means(
    recording: Recording,
    timeline: Timeline,
    means: HoldMeans,
    force: Sequence[NoiseModel] | None,
    rate: Sequence[NoiseModel] | None,
) -> tuple[HoldMeans, list[str]]:
    """Return the means with the covariances that models give them, and what was found on the way, in words.

    A hold that scatters more than its model can make by chance was disturbed: it keeps the variance of its
    own scatter, if that is larger.

    Parameters
    ----------
    recording, timeline, means : the holds, raw.
    force, rate : three models each, of the raw axes in raw units; None leaves a triad as it is.
    """
    first = float(recording.time[timeline.holds[0].start])
    last = float(recording.time[timeline.holds[-1].stop - 1])
    span = max(last - first, float(np.sum(means.duration)))
    starts = means.time - 0.5 * means.duration - first
    said: list[str] = []
    changed = means
    for models, covariance, rounding, name in (
        (force, means.specific_force_covariance, means.specific_force_rounding, "accelerometer"),
        (rate, means.angular_rate_covariance, means.angular_rate_rounding, "gyro"),
    ):
        if models is None or covariance is None:
            continue
        whole = np.stack([model.mean_covariance(means.duration, span, starts) for model in models])
        # What rounding leaves in a mean is no noise that a model has.
        left = np.zeros((len(means), 3)) if rounding is None else rounding
        own = (np.diagonal(covariance, axis1=1, axis2=2) - left).T
        variance, disturbed, ratio = _with_own(np.diagonal(whole, axis1=1, axis2=2), own)
        full = (variance.T + left)[:, :, None] * np.eye(3)
        said += _in_words(name, disturbed, ratio)
        field = "specific_force_covariance" if name == "accelerometer" else "angular_rate_covariance"
        changed = replace(changed, modelled=True, **{field: full})
    return changed, said


def _with_own(variance: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """The models' variances with disturbed holds' own, which holds those are, and the usual excess."""
    from scipy.special import gammaincinv

    limit = float(gammaincinv(0.5 * _OWN_FREEDOM, 1.0 - EXCESS_FALSE_ALARM)) / (0.5 * _OWN_FREEDOM)
    excess = np.where(own > limit * variance, own - variance, 0.0)
    ratio = float(np.median(np.sqrt(own / variance)))
    return variance + excess, np.any(excess > 0.0, axis=0), ratio


def _in_words(name: str, disturbed: np.ndarray, ratio: float) -> list[str]:
    if ratio > _ANOTHER_UNIT:
        found = f"The {name}s' means scatter by {ratio:.1f} times what the noise model says: is it of this unit, and "
        return [found + "was the unit as quiet then? Where the scatter is larger it counts."]
    if not np.any(disturbed):
        return []
    which = ", ".join(str(k + 1) for k in np.flatnonzero(disturbed)[:8])
    more = " and more" if np.count_nonzero(disturbed) > 8 else ""
    found = f"Hold {which}{more}: the {name} scatters more than the noise model can make by chance; "
    return [found + "its own scatter counts."]
