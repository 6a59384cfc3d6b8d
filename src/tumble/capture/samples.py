"""Samples as a source hands them over, and what is known of them before the first one comes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from tumble.arrays import Series, Vectors


@dataclass(frozen=True, slots=True)
class Channels:
    """What a source sends.

    Attributes
    ----------
    specific_force_unit, angular_rate_unit : names that `tumble.units` knows, or "counts"; None where a triad is
        missing.
    rate : nominal, Hz.
    temperature : whether there is one, in °C.
    remarks : what was found or assumed, as sentences.
    magnetic_field_unit : of the magnetometer, empty where nobody says it; None without one.
    """

    specific_force_unit: str | None
    angular_rate_unit: str | None
    rate: float
    temperature: bool = False
    remarks: tuple[str, ...] = ()
    magnetic_field_unit: str | None = None


@dataclass(frozen=True, slots=True)
class Samples:
    """Some samples in time order, raw.

    Attributes
    ----------
    time : (samples,) s.
    specific_force, angular_rate : (samples, 3) in the units of the channels, or None.
    temperature : (samples,) °C, or None.
    magnetic_field : (samples, 3), no numbers where the magnetometer has no sample, or None.
    """

    time: Series
    specific_force: Vectors | None
    angular_rate: Vectors | None
    temperature: Series | None = None
    magnetic_field: Vectors | None = None

    def __len__(self) -> int:
        return int(self.time.shape[0])

    def rows(self, keep: np.ndarray) -> Samples:
        """Return the samples that an index or a boolean array picks.

        Parameters
        ----------
        keep : as numpy takes it.
        """
        return Samples(
            self.time[keep],
            None if self.specific_force is None else self.specific_force[keep],
            None if self.angular_rate is None else self.angular_rate[keep],
            None if self.temperature is None else self.temperature[keep],
            None if self.magnetic_field is None else self.magnetic_field[keep],
        )

    def at(self, time: Series) -> Samples:
        """Return the same samples with other stamps.

        Parameters
        ----------
        time : (samples,) s.
        """
        return replace(self, time=time)

    def parts(self, seconds: float) -> Iterator[Samples]:
        """Yield the samples in pieces.

        Parameters
        ----------
        seconds : of a piece.
        """
        number = np.floor((self.time - self.time[0]) / seconds)
        for start, stop in pairwise([0, *(np.flatnonzero(np.diff(number)) + 1), len(self)]):
            yield self.rows(np.arange(start, stop))

    def finite(self) -> Samples:
        """Return the samples that are numbers throughout; a temperature may be missing."""
        good = np.isfinite(self.time)
        for triad in (self.specific_force, self.angular_rate):
            if triad is not None:
                good &= np.isfinite(triad).all(axis=1)
        return self if good.all() else self.rows(good)


def joined(parts: Sequence[Samples]) -> Samples:
    """Return consecutive samples as one.

    Parameters
    ----------
    parts : one at least, all with the same triads.
    """
    if len(parts) == 1:
        return parts[0]
    first = parts[0]
    forces = [p.specific_force for p in parts if p.specific_force is not None]
    rates = [p.angular_rate for p in parts if p.angular_rate is not None]
    temperatures = [p.temperature for p in parts if p.temperature is not None]
    fields = [p.magnetic_field for p in parts if p.magnetic_field is not None]
    return Samples(
        np.concatenate([p.time for p in parts]),
        None if first.specific_force is None else np.concatenate(forces),
        None if first.angular_rate is None else np.concatenate(rates),
        None if first.temperature is None else np.concatenate(temperatures),
        None if first.magnetic_field is None else np.concatenate(fields),
    )
