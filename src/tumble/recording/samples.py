"""Samples as streams and sources hand them over, piece by piece."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.records import dataclass

_OTHERS = ("specific_force", "angular_rate", "temperature", "magnetic_field")


@dataclass(frozen=True, slots=True)
class Samples:
    """Some samples of one stream in time order, raw.

    Attributes
    ----------
    time : (samples,) s.
    specific_force, angular_rate : (samples, 3) in the units of the stream, or None where it has none.
    temperature : (samples,) °C, or None.
    magnetic_field : (samples, 3), rows without a number where the magnetometer has no sample, or None.
    """

    time: Series
    specific_force: Vectors | None = None
    angular_rate: Vectors | None = None
    temperature: Series | None = None
    magnetic_field: Vectors | None = None

    def __len__(self) -> int:
        return int(self.time.shape[0])

    def cut(self, keep: slice | np.ndarray) -> Samples:
        """Return the samples that an index, a slice or a boolean array picks.

        Parameters
        ----------
        keep : as numpy takes it.
        """
        others = (getattr(self, name) for name in _OTHERS)
        return Samples(self.time[keep], *(None if part is None else part[keep] for part in others))

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
            yield self.cut(np.arange(start, stop))

    def finite(self) -> Samples:
        """Return the samples that are numbers throughout; a temperature may be missing."""
        good = np.isfinite(self.time)
        for triad in (self.specific_force, self.angular_rate):
            if triad is not None:
                good &= np.isfinite(triad).all(axis=1)
        return self if good.all() else self.cut(good)


def joined(parts: Sequence[Samples]) -> Samples:
    """Return consecutive samples as one.

    Parameters
    ----------
    parts : one at least, all with the same triads.
    """
    if len(parts) == 1:
        return parts[0]

    def all_of(name: str) -> np.ndarray | None:
        pieces: list[np.ndarray] = [getattr(p, name) for p in parts]
        return None if getattr(parts[0], name) is None else np.concatenate(pieces)

    return Samples(np.concatenate([p.time for p in parts]), *map(all_of, _OTHERS))
