"""The magnetometer's samples of a recording: at their own stamps, in the file's own numbers."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Vectors
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
    """

    time: Series
    values: Vectors
    unit: str

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
        return MagneticField(self.time[first:last], self.values[first:last], self.unit)

    def beside(self, time: Series, keep: npt.NDArray[np.bool_]) -> MagneticField | None:
        """Return the samples whose nearest row of a recording is kept; None if there are none.

        Parameters
        ----------
        time : (rows,) seconds, of the recording.
        keep : (rows,) which of its rows are kept.
        """
        after = np.clip(np.searchsorted(time, self.time), 1, max(len(time) - 1, 1))
        nearer_before = self.time - time[after - 1] <= time[np.minimum(after, len(time) - 1)] - self.time
        kept = np.asarray(keep, dtype=bool)[
            np.where(nearer_before, after - 1, np.minimum(after, len(time) - 1))
        ]
        if not kept.any():
            return None
        return MagneticField(self.time[kept], self.values[kept], self.unit)

    def moved(self, seconds: float) -> MagneticField:
        """Return the samples with their stamps moved by some seconds."""
        return MagneticField(self.time + seconds, self.values, self.unit)


def joined_fields(fields: list[MagneticField | None]) -> MagneticField | None:
    """Return the samples of several stretches, in their order, as one; None unless all have them, in one unit."""
    there = [field for field in fields if field is not None]
    if not there or len(there) < len(fields) or len({field.unit for field in there}) > 1:
        return None
    return MagneticField(
        np.concatenate([field.time for field in there]),
        np.concatenate([field.values for field in there]),
        there[0].unit,
    )
