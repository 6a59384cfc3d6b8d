"""The magnetometer's samples of a recording: at their own stamps, in the file's own numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import Matrix, Series, Vectors
from tumble.records import dataclass

NOTHING_MADE = "so nothing is made of it."
"""Ends the remark on a magnetometer that lacks a column."""


@dataclass(frozen=True, slots=True)
class MagneticField:
    """What a magnetometer measured, on the time axis of the recording that it belongs to.

    A magnetometer often runs more slowly than the accelerometers and gyros, so it has stamps of its own.

    Attributes
    ----------
    time : (samples,) seconds, strictly increasing, on the recording's own time axis.
    values : (samples, 3) raw, in `unit`, finite.
    unit : name that `tumble.units` knows of a magnetic field ("uT", "gauss" ...), or "counts".
    turn : (3, 3) from its axes to the accelerometers', as an autopilot's log says; None where nothing says or turns.
    """

    time: Series
    values: Vectors
    unit: str
    turn: Matrix | None = None

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
