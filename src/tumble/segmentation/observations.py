"""What a hold tells: the mean of each triad with the covariance of that mean."""

from __future__ import annotations

from typing import Any

import numpy as np

from tumble.arrays import Matrices, Series, Vectors
from tumble.errors import SegmentationError
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.segmentation.averages import mean_covariance
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
    modelled : noise models say how well the means are known (`tumble.segmentation.modelled_means`).
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
