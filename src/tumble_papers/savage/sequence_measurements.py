"""The measurements of a rotation sequence: accelerations in the frame of its start (Savage 2018, (1), (2))."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Matrix, Series, Vector, Vectors
from tumble.records import dataclass

AVERAGING = ("plain", "average-of-averages")


@dataclass(frozen=True, slots=True)
class SequenceMeasurement:
    """What a sequence measured.

    Attributes
    ----------
    horizontal : (3,) m/s², end minus start, in the frame of the start, without its part along down.
    down_start, down_end : m/s², what the accelerometers showed of gravity too little.
    C_start_end : (3, 3) attitude at the end as computed.
    gyro_bias : (3,) rad/s, what the gyros showed before the rotations beyond the Earth rate.
    """

    horizontal: Vector
    down_start: float
    down_end: float
    C_start_end: Matrix
    gyro_bias: Vector

    @property
    def vector(self) -> Series:
        """(5,) in the order of `rotation_sequences.COMPONENTS`."""
        return np.array([*self.horizontal, self.down_start, self.down_end])


def window_weights(count: int, averaging: str) -> Series:
    """Return the weights of an average over `count` samples.

    Parameters
    ----------
    count : samples.
    averaging : one of `AVERAGING`. An average of averages is the mean over a window of the means over as long a
        window up to each of its samples: half the samples each, a triangle, which a pulse at the edges moves less.

    Raises
    ------
    ValueError
        If there is no such average.
    """
    if averaging not in AVERAGING:
        raise ValueError(f"{averaging!r} is none of {', '.join(AVERAGING)}")
    if averaging == "plain":
        return np.full(count, 1.0 / count)
    half = max((count + 1) // 2, 1)
    weights = np.convolve(np.full(half, 1.0 / half), np.full(count - half + 1, 1.0 / (count - half + 1)))
    return np.ascontiguousarray(weights)


def measure_sequence(
    rate: Vectors,
    force: Vectors,
    step: float,
    earth_rate_start: Vector,
    start: tuple[int, int],
    end: tuple[int, int],
    gravity: float,
    down_start: Vector,
    *,
    start_bias: bool = True,
    norm: bool = True,
    averaging: str = "plain",
) -> SequenceMeasurement:
    """Compute the attitude from the start of a sequence, and what gravity looks like in it before and after.

    Parameters
    ----------
    rate : (samples, 3) rad/s, compensated, the mean over each interval: a sample of the gyros' increments.
    force : (samples, 3) m/s², compensated.
    step : s between samples.
    earth_rate_start : (3,) rad/s, the Earth rate in the body frame of the start.
    start, end : half-open ranges of samples at rest.
    gravity : m/s².
    down_start : (3,) nominal unit vector down in the body frame of the start.
    start_bias : take the gyros' mean over `start`, less the Earth rate, as their bias (section 9.4).
    norm : take down as gravity less the length of the acceleration, instead of its projection on the nominal
        down, which a fixture that is off by an angle makes too short by half its square.
    averaging : see `window_weights`.

    Raises
    ------
    ValueError
        If a range is empty or leaves the samples, or the two overlap.
    """
    from tumble.attitude.kernels import transform_sequence

    for first, last in (start, end):
        if not 0 <= first < last <= len(rate):
            raise ValueError(f"samples {first} to {last} are no range of {len(rate)} samples")
    if end[0] < start[1]:
        raise ValueError("the measurement at the end begins before that at the start is over")
    bias = np.asarray(np.mean(rate[start[0] : start[1]], axis=0) - earth_rate_start, dtype=np.float64)
    averages, C = np.zeros((2, 3)), np.zeros((3, 3))
    transform_sequence(
        np.ascontiguousarray(rate - bias if start_bias else rate),
        np.ascontiguousarray(force),
        step,
        np.ascontiguousarray(earth_rate_start),
        window_weights(start[1] - start[0], averaging),
        start[0],
        window_weights(end[1] - end[0], averaging),
        end[0],
        averages,
        C,
    )
    change = averages[1] - averages[0]
    lengths = np.linalg.norm(averages, axis=1)
    downs = gravity - lengths if norm else averages @ down_start + gravity
    return SequenceMeasurement(
        np.asarray(change - down_start * float(down_start @ change), dtype=np.float64),
        float(downs[0]),
        float(downs[1]),
        C,
        bias,
    )
