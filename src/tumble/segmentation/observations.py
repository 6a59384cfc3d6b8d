"""What a hold tells: the mean of each triad with the covariance of that mean."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tumble.arrays import Matrices, Series, Vectors
from tumble.errors import SegmentationError
from tumble.noise import NoiseModel
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.segmentation.averages import EXCESS_FALSE_ALARM, mean_covariance
from tumble.segmentation.rest_wander import RestParts, observe_parts
from tumble.segmentation.timeline import Hold, Timeline


@dataclass(frozen=True)
class HoldMeans:
    """One row per hold; raw units.

    Attributes
    ----------
    specific_force, angular_rate : (holds, 3) means, or None without the triad.
    specific_force_covariance, angular_rate_covariance : (holds, 3, 3) of those means.
    duration : (holds,) s at rest, without what is excluded.
    time : (holds,) s, the middle of each hold.
    count : (holds,) samples averaged.
    temperature : (holds,) degrees Celsius, or None.
    specific_force_rounding, angular_rate_rounding : (holds, 3) raw², what of the covariances rounding leaves.
    parts : means of the parts of the holds, which show how biases wander; None where that is not asked for.
    modelled : noise models say how well the means are known (`tumble.segmentation.observations`).
    """

    specific_force: Vectors | None
    specific_force_covariance: Matrices | None
    angular_rate: Vectors | None
    angular_rate_covariance: Matrices | None
    duration: Series
    time: Series
    count: Series
    temperature: Series | None
    specific_force_rounding: Vectors | None = None
    angular_rate_rounding: Vectors | None = None
    parts: RestParts | None = None
    modelled: bool = False

    def __repr__(self) -> str:
        return f"<HoldMeans of {self.duration.size} holds>"

    def __len__(self) -> int:
        return int(self.duration.shape[0])


def observe_holds(recording: Recording, timeline: Timeline) -> HoldMeans:
    """Average each hold and say how well the averages are known.

    Parameters
    ----------
    recording, timeline : raw samples and the holds found in them.

    Raises
    ------
    SegmentationError
        If the timeline has no holds.
    """
    holds = timeline.holds
    if not holds:
        raise SegmentationError("The timeline has no holds: there is nothing to average.")
    counts = np.array([sum(b - a for a, b in hold.stretches()) for hold in holds], dtype=float)
    force = _mean(recording.specific_force, holds)
    rate = _mean(recording.angular_rate, holds)
    return HoldMeans(
        *force[:2],
        *rate[:2],
        duration=counts / recording.rate,
        time=np.array([0.5 * (recording.time[h.start] + recording.time[h.stop - 1]) for h in holds]),
        count=counts,
        temperature=_temperatures(recording.temperature, holds),
        specific_force_rounding=force[2],
        angular_rate_rounding=rate[2],
        parts=observe_parts(recording, timeline),
    )


def _mean(signal: Vectors | None, holds: tuple[Hold, ...]) -> tuple[Any, Any, Any]:
    """Mean, covariance and what rounding leaves; None three times without a triad."""
    if signal is None:
        return None, None, None
    return mean_covariance(signal, [hold.stretches() for hold in holds])


def _temperatures(temperature: Series | None, holds: tuple[Hold, ...]) -> np.ndarray | None:
    if temperature is None:
        return None
    return np.array([np.mean(np.concatenate([temperature[a:b] for a, b in h.stretches()])) for h in holds])


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
