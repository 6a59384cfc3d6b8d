"""A recording: time-ordered samples of one IMU with what is known of them.

The signals are **raw**: exactly the numbers of the file, in the file's units. A unit's factor to SI
stands beside them, or None where the file holds counts; nothing is rescaled on reading, because a
calibration maps raw numbers to true ones.

A recording as a notebook shows it: what it holds, and what was found on reading.
"""

from __future__ import annotations

from dataclasses import field, replace

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.files import notebook_html
from tumble.recording.samples import MagneticField, Remark, Source
from tumble.recording.stamps import Clock, clock_of_stamps
from tumble.records import dataclass


def recording_html(recording: Recording) -> str:
    """Return a table of what a recording holds, and its remarks as a list."""
    field = recording.magnetic_field
    sources = ", ".join(source.name for source in recording.sources) or "made in memory"
    there = {triad.name: triad for triad in recording.triads}
    kinds = {name: there.get(name) for name in ("specific force", "angular rate")}
    rows = [
        ("from", sources),
        ("samples", f"{len(recording):,} in {recording.duration:,.1f} s, {recording.rate:g} Hz"),
        *((name, f"three axes, {triad.unit}" if triad else "none") for name, triad in kinds.items()),
        (
            "magnetic field",
            "none" if field is None else f"three axes, {field.unit}, {len(field):,} at {field.rate:.4g} Hz",
        ),
        ("temperature", "°C" if recording.temperature is not None else "none"),
        ("gaps", str(len(recording.gaps))),
    ]
    return notebook_html((), rows, notes=[remark.text for remark in recording.remarks])


@dataclass(frozen=True)
class Triad:
    """One triad of a recording: letter of its channels, what it measures, raw numbers (samples, 3), their unit."""

    letter: str
    name: str
    values: Vectors
    unit: str


@dataclass(frozen=True)
class Recording:
    """Samples of one IMU in time order.

    Attributes
    ----------
    time : (samples,) seconds, strictly increasing, first sample at the file's own origin.
    specific_force : (samples, 3) raw, in `specific_force_unit`, or None without an accelerometer.
    angular_rate : (samples, 3) raw, in `angular_rate_unit`, or None without a gyro.
    specific_force_unit, angular_rate_unit : names that `tumble.units` knows, or "counts".
    rate : nominal sampling rate in Hz.
    temperature : (samples,) degrees Celsius, or None.
    sources : the files, with their SHA-256.
    remarks : what was found, assumed or mended on reading.
    gaps : indices i where samples are missing between i - 1 and i.
    temperature_unit : what the file or the user says that the temperature was in, None if nobody does.
    said_clock : the clock that the stamps are from, as far as who made the recording knows it; else None.
    magnetic_field : the magnetometer's samples at their own stamps, raw, or None without a magnetometer.
    columns : what `--columns` calls the columns that it was read from; None where there are none, or two files'.
    """

    time: Series
    specific_force: Vectors | None
    angular_rate: Vectors | None
    specific_force_unit: str
    angular_rate_unit: str
    rate: float
    temperature: Series | None = None
    sources: tuple[Source, ...] = ()
    remarks: tuple[Remark, ...] = field(default=())
    gaps: tuple[int, ...] = ()
    temperature_unit: str | None = None
    said_clock: Clock | None = None
    magnetic_field: MagneticField | None = None
    columns: str | None = None

    def __len__(self) -> int:
        return int(self.time.shape[0])

    @property
    def duration(self) -> float:
        """Seconds from the first to the last sample."""
        return float(self.time[-1] - self.time[0]) if len(self) else 0.0

    @property
    def clock(self) -> Clock:
        """The clock that the stamps are from, and how far its rate may be off: as it is known, or as they lie."""
        return self.said_clock or clock_of_stamps(self.time)

    @property
    def streams(self) -> dict[str, dict[str, str] | None]:
        """The unit of each kind of samples, None where it has none of them."""
        known = ("specific_force", "angular_rate", "magnetic_field", "temperature")
        units = {triad.name.replace(" ", "_"): triad.unit for triad in self.triads}
        units |= {} if self.magnetic_field is None else {"magnetic_field": self.magnetic_field.unit}
        units |= {} if self.temperature is None else {"temperature": "degC"}
        return {name: {"unit": units[name]} if name in units else None for name in known}

    @property
    def triads(self) -> tuple[Triad, ...]:
        """The accelerometers and the gyros, as far as they are there."""
        both = (
            ("a", "specific force", self.specific_force, self.specific_force_unit),
            ("g", "angular rate", self.angular_rate, self.angular_rate_unit),
        )
        return tuple(
            Triad(letter, name, values, unit) for letter, name, values, unit in both if values is not None
        )

    @property
    def channels(self) -> dict[str, Series]:
        """The samples of each axis that there is, raw, by name: ax to gz."""
        return {t.letter + axis: t.values[:, i] for t in self.triads for i, axis in enumerate("xyz")}

    def __repr__(self) -> str:
        names = " + ".join(source.name for source in self.sources)
        triads = [f"{triad.name} in {triad.unit}" for triad in self.triads]
        of = f" of {names}" if names else ""
        return f"<Recording{of}: {len(self)} samples at {self.rate:.6g} Hz, {', '.join(triads)}>"

    def _repr_html_(self) -> str:
        """Return what a notebook shows."""
        return recording_html(self)

    def between(self, start: int, stop: int) -> Recording:
        """Return the samples from index `start` up to `stop` as a recording (views, no copies).

        Raises
        ------
        IndexError
            If the stretch is empty or reaches outside the recording.
        """
        if not 0 <= start < stop <= len(self):
            raise IndexError(f"samples {start} to {stop} of a recording of {len(self)}")
        cut, field = slice(start, stop), self.magnetic_field
        if field is not None:
            begin = -np.inf if start == 0 else float(self.time[start])
            field = field.within(begin, np.inf if stop == len(self) else float(self.time[stop]))
        return replace(
            self,
            time=self.time[cut],
            specific_force=None if self.specific_force is None else self.specific_force[cut],
            angular_rate=None if self.angular_rate is None else self.angular_rate[cut],
            temperature=None if self.temperature is None else self.temperature[cut],
            gaps=tuple(i - start for i in self.gaps if start < i < stop),
            magnetic_field=field,
            columns=None,
        )
