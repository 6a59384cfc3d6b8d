"""Streams of one sensor each, with stamps of their own, put onto one time base.

Bags, flight logs and phones hold the accelerometer and the gyro as messages of their own kinds and rates.
The gyro's stamps are the time base, because angles are integrated from them; the specific force between
two of its samples is interpolated linearly. Nothing is interpolated over a gap, nor beyond either end.
Logs of autopilots and folders name their streams, and the choice among them makes one table.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, field as made, replace
from pathlib import Path
from typing import TypeAlias

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.errors import RecordingError, UsageError
from tumble.recording.formats.logs.own_parameters import OwnParameters
from tumble.recording.formats.table import RawTable
from tumble.recording.samples import MagneticField, Remark, Samples, joined
from tumble.records import dataclass

_GAP = 2.5  # median steps between two samples, above which nothing is interpolated between them


Units: TypeAlias = Mapping[str, str | None]
"""Names of the units that a stream's numbers are in by the triad's letter, None or nothing where nobody says so."""
SI: Units = {"a": "m/s^2", "g": "rad/s"}


def table_of_samples(path: Path, samples: Samples, units: Units, remarks: Iterable[Remark] = ()) -> RawTable:
    """Return samples as a table whose columns say what they are and in which unit.

    Parameters
    ----------
    path : the file, for messages.
    samples : with the time in seconds.
    units : of the triads.
    remarks : what was found so far.
    """
    names, columns = ["t [s]"], [samples.time]
    triads = (samples.specific_force, samples.angular_rate, samples.magnetic_field)
    for letter, triad in zip("agm", triads, strict=True):
        if triad is not None:
            unit = units.get(letter)
            names += [f"{letter}{axis}" + (f" [{unit}]" if unit else "") for axis in "xyz"]
            columns += [triad[:, axis] for axis in range(3)]
    if samples.temperature is not None:
        names.append("temperature")
        columns.append(samples.temperature)
    # Whoever writes streams, a computer, an autopilot or a phone, runs by a crystal.
    return RawTable(path, tuple(names), columns, list(remarks), clock="device")


@dataclass
class Merging:
    """Two streams on their way to one: the accelerometer's samples are interpolated at the gyro's stamps.

    Attributes
    ----------
    name : of the file, for messages.
    force_name, rate_name : of the two streams, for messages.
    left_out : gyro samples so far without an accelerometer's sample on both sides.
    """

    name: str
    force_name: str
    rate_name: str
    left_out: int = 0
    _force: list[Samples] = field(default_factory=list[Samples])
    _rates: list[Samples] = field(default_factory=list[Samples])
    _step: float | None = None
    _interpolated: int = 0

    def add(self, force: Samples | None, rates: Samples | None) -> None:
        """Take in what comes next of either stream."""
        if force is not None and len(force):
            self._force.append(force)
        if rates is not None and len(rates):
            self._rates.append(rates)

    def waiting(self) -> int:
        """Return the number of gyro samples that are not handed over yet."""
        return sum(len(r) for r in self._rates)

    def take(self, *, last: bool = False) -> Samples | None:
        """Return the gyro's samples up to the accelerometer's last one, with the specific force there.

        Parameters
        ----------
        last : whether nothing more comes, so that what has no partner is left out.

        Raises
        ------
        RecordingError
            If the accelerometer's stamps step back.
        """
        if not self._force or not self._rates:
            self.left_out += self.waiting() if last else 0
            return None
        force, rates = _without_repeats(joined(self._force)), joined(self._rates)
        refuse_backwards(self.name, self.force_name, force.time)
        stop = len(rates) if last else int(np.searchsorted(rates.time, float(force.time[-1]), side="right"))
        ready, rest = rates.cut(slice(0, stop)), rates.cut(slice(stop, None))
        merged = self._interpolate(force, ready)
        self._rates = [rest] if len(rest) else []
        # The accelerometer's sample before the next stamp is still needed.
        first = int(np.searchsorted(force.time, float(ready.time[-1]), side="right")) - 1 if len(ready) else 0
        self._force = [force.cut(slice(max(first, 0), None))]
        return merged if len(merged) else None

    def _interpolate(self, force: Samples, rates: Samples) -> Samples:
        """Return the specific force at the gyro's stamps; stamps without neighbours are left out."""
        assert force.specific_force is not None
        if self._step is None and len(force) > 1:
            self._step = float(np.median(np.diff(force.time)))
        before = np.searchsorted(force.time, rates.time, side="right") - 1
        left = np.maximum(before, 0)
        right = np.minimum(left + 1, len(force) - 1)
        width = force.time[right] - force.time[left]
        behind = rates.time - force.time[left]
        between = (width > 0.0) & (width <= _GAP * (self._step or 0.0))
        keep = (before >= 0) & (between | (behind == 0.0))
        self.left_out += int(keep.size - keep.sum())
        left, right, kept = left[keep], right[keep], rates.cut(keep)
        share: Series = np.zeros(left.size)
        np.divide(behind[keep], width[keep], out=share, where=behind[keep] > 0.0)
        self._interpolated += int(np.count_nonzero(share))
        low, high = force.specific_force[left], force.specific_force[right]
        return Samples(kept.time, low + share[:, None] * (high - low), kept.angular_rate, kept.temperature)

    def remarks(self) -> list[Remark]:
        """Say what was done, once everything is merged."""
        both = f"{self.name}: {self.force_name} and {self.rate_name}"
        alike = Remark("found", f"{both} have the same stamps and stand side by side.")
        between = "have stamps of their own: the specific force is interpolated at the gyro's stamps"
        said = [Remark("mended", f"{both} {between}.") if self._interpolated else alike]
        if self.left_out:
            said.append(
                Remark(
                    "mended",
                    f"{self.name}: {self.left_out} gyro sample(s) before, after or in a gap of the accelerometer's "
                    "are left out.",
                )
            )
        return said


def refuse_backwards(file: str, stream: str, time: Series) -> None:
    """Refuse stamps that step back.

    Raises
    ------
    RecordingError
        If they do.
    """
    back = np.flatnonzero(np.diff(time) < 0.0)
    if back.size:
        row = int(back[0])
        raise RecordingError(
            f"{file}: the stamps of {stream} step back from {time[row]:.6f} s to {time[row + 1]:.6f} s; cut the "
            "recording there, for the order of its samples is unknown."
        )


def _without_repeats(samples: Samples) -> Samples:
    """Leave out samples whose stamp is that of the one before."""
    return samples.cut(np.concatenate([[True], np.diff(samples.time) != 0.0]))


def merge_streams(
    name: str, force: tuple[str, Samples], rates: tuple[str, Samples]
) -> tuple[Samples, list[Remark]]:
    """Return two whole streams as one, and what was done.

    Parameters
    ----------
    name : of the file, for messages.
    force, rates : name and samples of the accelerometer and the gyro.

    Raises
    ------
    RecordingError
        If the stamps of the accelerometer step back, or the two streams do not overlap in time.
    """
    merging = Merging(name, force[0], rates[0])
    merging.add(force[1], rates[1])
    merged = merging.take(last=True)
    if merged is None:
        raise RecordingError(_no_overlap(name, force, rates))
    return merged, merging.remarks()


def _no_overlap(name: str, force: tuple[str, Samples], rates: tuple[str, Samples]) -> str:
    """Say that two streams have no time in common."""
    spans = [
        f"{n} from {s.time[0]:.3f} to {s.time[-1]:.3f} s" if len(s) else f"{n} empty"
        for n, s in (force, rates)
    ]
    return f"{name}: the two streams have no time in common ({spans[0]}, {spans[1]}); they are of no one recording."


_LISTED = 16
_LEAST_RATE = 20.0  # Hz; most logs of PX4 have the raw sensors once a second only


@dataclass(frozen=True)
class Stream:
    """A named stream of a log.

    Attributes
    ----------
    name : as the user names it with ``--topic``; an instance follows after a colon.
    samples : in time order.
    units : of its triads.
    note : a sentence about its numbers, or nothing.
    own : what the autopilot's own parameters did to them, or None.
    """

    name: str
    samples: Samples
    units: Units = made(default_factory=lambda: SI)
    note: str = ""
    own: OwnParameters | None = None

    @property
    def rate(self) -> float:
        """Samples a second on average, 0 for fewer than two."""
        time = self.samples.time
        span = float(time[-1] - time[0]) if len(time) > 1 else 0.0
        return (len(time) - 1) / span if span > 0.0 else 0.0


def _list_streams(streams: Sequence[Stream]) -> str:
    """Return the streams in words."""
    more = f" and {len(streams) - _LISTED} more" if len(streams) > _LISTED else ""
    words = (f"{s.name} ({len(s.samples)} samples, {s.rate:.4g} Hz)" for s in streams[:_LISTED])
    return ", ".join(words) + more


def table_of_streams(
    path: Path,
    streams: Sequence[Stream],
    wanted: Sequence[str],
    automatic: Sequence[str],
    remarks: Sequence[Remark] = (),
) -> RawTable:
    """Return the table of the wanted streams, or of those that are chosen by themselves.

    Parameters
    ----------
    path : the file, for messages.
    streams : all that hold a triad.
    wanted : names of one stream, or of one for each triad; none for `automatic`. A magnetometer's stream is read
        beside, the first one where none is named.
    automatic : names of the streams that are read where none was wanted.
    remarks : what was found so far.

    Raises
    ------
    RecordingError
        If two streams hold no accelerometer and gyro, or have no time in common.
    UsageError
        If a wanted stream is not there, or more than two are wanted.
    """
    said = [*remarks, Remark("found", f"{path.name} holds {_list_streams(streams)}.")]
    named = [_named(path, streams, name) for name in (wanted or automatic)]
    chosen = [s for s in named if not is_field(s)]
    field = next((s for s in (*named, *streams) if is_field(s)), None)
    if len(chosen) > 2 or len(named) > len(chosen) + 1:
        raise UsageError(f"--topic names {len(named)} streams; give one, or one of each triad.")
    if not chosen and field is not None:
        chosen, field = [field], None
    chosen = [_as_sensed(path, s, said) for s in chosen]
    try:
        field = None if field is None else _as_sensed(path, field, said)
    except RecordingError as error:
        if field in named:
            raise
        said.append(Remark("mended", f"{path.name}: the magnetometer is left out. {error}"))
        field = None
    verb = "is" if len(chosen) == 1 else "are"
    said.append(Remark("found", f"{path.name}: {' and '.join(s.name for s in chosen)} {verb} read."))
    said += [Remark("found", f"{path.name}: {s.name} {s.note}.") for s in chosen if s.note]
    if field is not None:
        said.append(Remark("found", f"{path.name}: {field.name} is read as the magnetometer."))
    samples, units = chosen[0].samples, chosen[0].units
    if len(chosen) == 2:
        force, rates = _triads(path, chosen)
        samples, more = merge_streams(path.name, (force.name, force.samples), (rates.name, rates.samples))
        units, said = {"a": force.units.get("a"), "g": rates.units.get("g")}, [*said, *more]
    return replace(table_of_samples(path, samples, units, said), field=_field_stream(field))


def automatic(streams: Sequence[Stream], pairs: Sequence[tuple[str, str]]) -> list[str]:
    """Return the names of those that are read without an option, of what was logged at a useful rate.

    Parameters
    ----------
    streams : all of the log.
    pairs : messages of raw accelerometers and gyros, the best first; without any, the first stream with both is read.
    """
    inertial = [s for s in streams if not is_field(s)] or list(streams)
    useful = [s for s in inertial if s.rate >= _LEAST_RATE] or inertial
    for pair in pairs:
        found = [next((s.name for s in useful if s.name.startswith(p + ":")), None) for p in pair]
        if None not in found:
            return [str(n) for n in found]
    whole = [s for s in useful if s.samples.specific_force is not None and s.samples.angular_rate is not None]
    return [(whole or useful)[0].name]


def _as_sensed(path: Path, stream: Stream, said: list[Remark]) -> Stream:
    """Return a stream as its sensors gave it, the autopilot's own parameters undone."""
    if stream.own is None:
        return stream
    samples, told = stream.own.undone(stream.samples, f"{path.name}: {stream.name}")
    said += told
    return replace(stream, samples=samples)


def is_field(stream: Stream) -> bool:
    """Say whether a stream is a magnetometer's alone."""
    return stream.samples.magnetic_field is not None


def of_increments(name: str, time: Series, force: Vectors, rate: Vectors, spans: list[Series]) -> Stream:
    """Return increments as the mean rates over the intervals that each was summed over, exactly.

    Parameters
    ----------
    name : of the stream.
    time : (samples,) s.
    force, rate : (samples, 3) m/s and rad.
    spans : of both, (samples,) s; rows without one are left out.
    """
    whole = (spans[0] > 0.0) & (spans[1] > 0.0)
    means = [v[whole] / span[whole, None] for v, span in zip((force, rate), spans, strict=True)]
    note = "holds increments, which are divided by the interval that stands beside each"
    return Stream(name, Samples(time[whole], *means), SI, note)


def _field_stream(stream: Stream | None) -> MagneticField | None:
    """Return a magnetometer's stream as what stands beside a table, its rows without a number left out."""
    if stream is None or stream.samples.magnetic_field is None:
        return None
    samples, unit = stream.samples, stream.units.get("m")
    field = MagneticField.finite(samples.time, stream.samples.magnetic_field, unit, stream.name, stream.note)
    return field if stream.own is None else replace(field, turn=stream.own.turn())


def _named(path: Path, streams: Sequence[Stream], name: str) -> Stream:
    known = {s.name: s for s in streams}
    plain = re.sub(r"\[(\d+)\]$", r":\1", name)
    for spelling in (plain, f"{plain}:0", f"{plain}:1"):
        if spelling in known:
            return known[spelling]
    there = f"it holds {_list_streams(streams)}" if streams else "it holds none that is read"
    raise UsageError(f"--topic {name}: {path.name} has no such message or stream with a triad; {there}.")


def _triads(path: Path, chosen: list[Stream]) -> tuple[Stream, Stream]:
    """Return which of two streams is the accelerometer's and which the gyro's."""
    first, second = chosen
    for force, rates in ((first, second), (second, first)):
        lone = force.samples.angular_rate is None or rates.samples.specific_force is None
        if force.samples.specific_force is not None and rates.samples.angular_rate is not None and lone:
            return force, rates
    raise RecordingError(
        f"{path.name}: {first.name} and {second.name} are not an accelerometer and a gyro apart; name one of them, "
        "or one of each."
    )
