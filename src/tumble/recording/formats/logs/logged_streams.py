"""What logs of autopilots and folders have in common: named streams, the choice among them, one table."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import field as made
from dataclasses import replace
from pathlib import Path

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.errors import RecordingError, UsageError
from tumble.recording.formats.logs.own_parameters import OwnParameters
from tumble.recording.formats.streams import Units, merge_streams, table_of_samples
from tumble.recording.formats.table import FieldStream, RawTable
from tumble.recording.recording import Remark, Source
from tumble.recording.samples import Samples
from tumble.records import dataclass

_LISTED = 16
_LEAST_RATE = 20.0  # Hz; most logs of PX4 have the raw sensors once a second only


@dataclass(frozen=True, slots=True)
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
    units: Units = made(default_factory=Units)
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
    source: Source,
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
    source : the file with its SHA-256.
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
        units, said = Units(force.units.specific_force, rates.units.angular_rate), [*said, *more]
    return replace(table_of_samples(path, samples, units, source, said), field=_field_stream(field))


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
    return Stream(name, Samples(time[whole], *means), Units(), note)


def _field_stream(stream: Stream | None) -> FieldStream | None:
    """Return a magnetometer's stream as what stands beside a table, its rows without a number left out."""
    if stream is None or stream.samples.magnetic_field is None:
        return None
    values = stream.samples.magnetic_field
    there = np.isfinite(values).all(axis=1)
    return FieldStream(
        stream.name,
        stream.samples.time[there],
        values[there],
        stream.units.magnetic_field,
        stream.note,
        None if stream.own is None else stream.own.turn(),
    )


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
