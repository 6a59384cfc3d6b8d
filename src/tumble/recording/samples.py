"""Samples as streams and sources hand them over, a magnetometer's at its own stamps, and what is said of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Literal

import numpy as np

from tumble.arrays import Matrix, Series, Vectors
from tumble.records import dataclass

_OTHERS = ("specific_force", "angular_rate", "temperature", "magnetic_field")


@dataclass(frozen=True)
class Source:
    """One file that a recording was read from, and the topic where it is a bag and one topic has both triads."""

    name: str
    sha256: str
    topic: str | None = None


@dataclass(frozen=True)
class Remark:
    """Something that the reader noticed, assumed or mended, as a sentence for the user.

    `kind` is "found" (a fact of the file), "assumed" (a guess that the user may overrule),
    "doubtful" (a guess that other numbers of the file contradict), "mended" (samples left out or changed),
    "corrected" (somebody's corrections are in the numbers already) or "unchecked" (what nothing in the file can show).
    """

    kind: Literal["found", "assumed", "doubtful", "mended", "corrected", "unchecked"]
    text: str


@dataclass(frozen=True)
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
        if isinstance(keep, np.ndarray) and keep.dtype == np.bool_ and keep.all():
            return self
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
        return self.cut(good)


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


NOTHING_MADE = "so nothing is made of it."
"""Ends the remark on a magnetometer that lacks a column."""


@dataclass(frozen=True)
class MagneticField:
    """What a magnetometer measured, on the time axis of the recording that it belongs to.

    A magnetometer often runs more slowly than the accelerometers and gyros, so it has stamps of its own.

    Attributes
    ----------
    time : (samples,) seconds, strictly increasing, on the recording's own time axis.
    values : (samples, 3) raw, in `unit`, finite.
    unit : name that `tumble.units` knows of a magnetic field ("uT", "gauss" ...), or "counts".
    turn : (3, 3) from its axes to the accelerometers', as an autopilot's log says; None where nothing says or turns.
    name, note : of the stream or file that it was read from, and what is to be said of that.
    """

    time: Series
    values: Vectors
    unit: str
    turn: Matrix | None = None
    name: str = ""
    note: str = ""

    @classmethod
    def finite(
        cls, time: Series, values: Vectors, unit: str | None, name: str = "", note: str = ""
    ) -> MagneticField:
        """Return samples without those that are no numbers; without a unit nobody says it."""
        good = np.isfinite(values).all(axis=1) & np.isfinite(time)
        return cls(time[good], values[good], unit or "", None, name, note)

    def __len__(self) -> int:
        return int(self.time.shape[0])

    @property
    def rate(self) -> float:
        """Samples a second: of the middle step between two stamps; 0 with fewer than two samples."""
        return float(1.0 / np.median(np.diff(self.time))) if len(self) > 1 else 0.0

    def within(self, start: float, stop: float) -> MagneticField | None:
        """Return the samples from time `start` up to, without, time `stop` (views); None if there are none."""
        first, last = (int(i) for i in np.searchsorted(self.time, (start, stop)))
        if first >= last:
            return None
        return replace(self, time=self.time[first:last], values=self.values[first:last])


def joined_fields(fields: list[MagneticField | None]) -> MagneticField | None:
    """Return the samples of several stretches, in their order, as one; None unless all have them, in one unit."""
    there = [field for field in fields if field is not None]
    if not there or len(there) < len(fields) or len({field.unit for field in there}) > 1:
        return None
    joined = {name: np.concatenate([getattr(field, name) for field in there]) for name in ("time", "values")}
    return replace(there[0], **joined)
