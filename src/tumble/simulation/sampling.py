"""What lies between a sensor and its file: increments, instants that scatter, stamps that scatter, lost samples.

Noise, rounding of each sample and saturation belong to the sensor: see `TriadNoise`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Vectors
from tumble.records import dataclass

# Stamps of one clock do not overtake one another: a scatter is cut at this share of the interval.
LARGEST_SHIFT = 0.45


@dataclass(frozen=True)
class Imperfections:
    """What the chain from the sensor to the file does beside the sensor's own errors.

    Attributes
    ----------
    jitter : s, standard deviation of the stamps about the instants that they stand for; the samples
        themselves are taken on time.
    sampling_jitter : s, standard deviation of the instants at which a sampling interval ends; the stamps
        tell the regular instants, as those of a program that counts samples do.
    dropped : share of the samples that are lost, 0 to 0.5.
    burst : how many samples are lost at a time, on average (geometrically distributed).
    angle_increment, velocity_increment : rad and m/s, the steps of a unit that sends whole numbers of
        increments and carries the remainder over to the next sample; zero for none.

    """

    jitter: float = 0.0
    sampling_jitter: float = 0.0
    dropped: float = 0.0
    burst: float = 1.0
    angle_increment: float = 0.0
    velocity_increment: float = 0.0

    def in_raw_unit(self, force_factor: float, rate_factor: float) -> Imperfections:
        """Return the same chain for raw numbers so many times as large, such as counts instead of SI.

        Parameters
        ----------
        force_factor, rate_factor : raw units per m/s² and per rad/s.
        """
        return replace(
            self,
            velocity_increment=self.velocity_increment * force_factor,
            angle_increment=self.angle_increment * rate_factor,
        )


def count_increments(signal: Vectors, rate: float, step: float) -> Vectors:
    """Return the signal as whole increments over each sampling interval, told as a rate again.

    The remainder of every interval is carried over to the next, so that the sum over any stretch is
    never off by more than a step, and a mean over a time T never by more than ``step / T``.

    Parameters
    ----------
    signal : (samples, 3) means over the sampling intervals, raw.
    rate : Hz.
    step : raw unit times s; zero leaves the signal as it is.
    """
    if step <= 0.0:
        return signal
    from tumble.simulation.kernels import carry_remainders

    counted = np.array(signal, dtype=np.float64, order="C")
    carry_remainders(counted, rate * step)
    return counted


def scatter_instants(edges: Series, rate: float, jitter: float, rng: np.random.Generator) -> Series:
    """Return the instants at which sampling intervals really end, in strict order; the first stays.

    Parameters
    ----------
    edges : (samples + 1,) s, the regular ends of the intervals.
    rate : Hz.
    jitter : s, standard deviation, cut at 0.45 of the interval.
    rng : source of all numbers.
    """
    scattered = scatter_stamps(edges, rate, jitter, rng)
    if jitter > 0.0:
        scattered[0] = edges[0]
    return scattered


def scatter_stamps(time: Series, rate: float, jitter: float, rng: np.random.Generator) -> Series:
    """Return stamps that scatter about the true instants and stay in strict order.

    Parameters
    ----------
    time : (samples,) s, the true instants.
    rate : Hz.
    jitter : s, standard deviation, cut at 0.45 of the interval, because stamps of one clock do not
        overtake one another.
    rng : source of all numbers.
    """
    if jitter <= 0.0:
        return time
    limit = LARGEST_SHIFT / rate
    shift = jitter * rng.standard_normal(len(time))
    return time + np.minimum(np.maximum(shift, -limit), limit)


def drop_samples(
    samples: int, dropped: float, burst: float, rng: np.random.Generator
) -> npt.NDArray[np.bool_]:
    """Return (samples,) of bool: which samples arrive. The first and the last always do.

    Samples are lost as in Gilbert's channel (Bell Syst. Tech. J. 39 (1960) 1253): stretches that arrive
    and stretches that are lost take turns, both of geometrically distributed length, so that the share
    lost is `dropped` and the mean length lost is `burst`.

    Parameters
    ----------
    samples : how many.
    dropped : share that is lost, 0 to 0.5.
    burst : how many are lost at a time, on average; at least one.
    rng : source of all numbers.
    """
    keep = np.ones(samples, dtype=bool)
    if dropped <= 0.0:
        return keep
    arriving = burst * (1.0 - dropped) / dropped
    pairs = int(2.0 * samples / (burst + arriving)) + 16
    arrived, end = [np.zeros(0, dtype=bool)], 0
    while end < samples:
        lengths = np.empty(2 * pairs, dtype=np.int64)
        lengths[::2] = rng.geometric(1.0 / arriving, pairs)
        lengths[1::2] = rng.geometric(1.0 / burst, pairs)
        arrived.append(np.repeat(np.tile([True, False], pairs), lengths))
        end += int(lengths.sum())
    keep = np.concatenate(arrived)[:samples]
    keep[[0, -1]] = True
    return keep
