"""What a recording chain does to samples: increments in counts, scattered stamps, lost samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tumble.arrays import Series, Vectors


@dataclass(frozen=True, slots=True)
class Imperfections:
    """What the chain from the sensor to the file does beside the sensor's own errors.

    Attributes
    ----------
    jitter : s, standard deviation of the stamps about the true instants; stamps stay in order.
    dropped : share of the samples that are lost, from 0 to 1.
    burst : how many samples are lost at a time, on average.
    angle_increment, velocity_increment : rad and m/s (or raw units times s), the steps of a unit that
        sends whole numbers of increments and carries the remainder over to the next sample; zero for none.
    """

    jitter: float = 0.0
    dropped: float = 0.0
    burst: float = 1.0
    angle_increment: float = 0.0
    velocity_increment: float = 0.0


def count_increments(signal: Vectors, rate: float, step: float) -> Vectors:
    """Return the signal as whole increments over each sampling interval, told as a rate again.

    The remainder of every interval is carried over, so that the sum is never off by more than a step.

    Parameters
    ----------
    signal : (samples, 3) means over the sampling intervals, raw.
    rate : Hz.
    step : raw unit times s; zero leaves the signal as it is.
    """
    if step <= 0.0:
        return signal
    whole = np.floor(np.cumsum(signal, axis=0) / (rate * step) + 0.5)
    before = np.vstack([np.zeros((1, 3)), whole[:-1]])
    return (whole - before) * (step * rate)


def scatter_stamps(time: Series, rate: float, jitter: float, rng: np.random.Generator) -> Series:
    """Return stamps that scatter about the true instants and stay in strict order.

    Parameters
    ----------
    time : (samples,) s, the true instants.
    rate : Hz.
    jitter : s, standard deviation; beyond a quarter of the interval it is cut, because stamps of one
        clock do not overtake one another.
    rng : source of all numbers.
    """
    if jitter <= 0.0:
        return time
    limit = 0.45 / rate
    return time + np.clip(jitter * rng.standard_normal(time.shape[0]), -limit, limit)


def drop_samples(samples: int, dropped: float, burst: float, rng: np.random.Generator) -> np.ndarray:
    """Return (samples,) of bool: which samples arrive. The first and the last always do.

    Parameters
    ----------
    samples : how many.
    dropped : share that is lost.
    burst : how many are lost at a time, on average (geometrically distributed).
    rng : source of all numbers.
    """
    keep = np.ones(samples, dtype=bool)
    if dropped <= 0.0:
        return keep
    count = int(rng.poisson(dropped * samples / burst))
    starts = rng.integers(0, samples, count)
    for start, length in zip(starts, rng.geometric(1.0 / burst, count), strict=True):
        keep[start : start + length] = False
    keep[[0, -1]] = True
    return keep
