"""Reading a recording: block by block in bounded memory, or whole, which is one block.

A magnetometer in a file of its own, beside the file or the pair of files that hold the other triads.

From a table of columns to a recording: what the columns mean is decided once, then applied.

The decision (`Interpretation`) is made on the whole recording, or on its first block where a long one
is read block by block, so that every block is read alike.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain
from os import PathLike, fspath
from pathlib import Path
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from tumble.arrays import AnyArray, Series, Vectors
from tumble.border import border
from tumble.errors import RecordingError, UsageError
from tumble.recording import stamps
from tumble.recording.columns import (
    AXES,
    QUANTITY,
    SENSOR,
    Axes,
    ColumnPlan,
    DeclaredUnits,
    Pairing,
    find_pairing,
    is_pair,
    kind_of_file,
    merge_pair,
    option_of,
    parts_of_triads,
    plan_from_content,
    plan_from_names,
    plan_from_option,
    temperature_unit_in,
    triad_alone,
)
from tumble.recording.formats import read_table, read_table_blocks, source_of
from tumble.recording.formats.frames import Frame, frame_source, frame_table, input_name
from tumble.recording.formats.table import RawTable, joined_tables
from tumble.recording.recording import Recording
from tumble.recording.samples import NOTHING_MADE, MagneticField, Remark, Samples, Source
from tumble.recording.stamps import BlockState, Known, clock_without_stamps, seconds_of
from tumble.recording.temperature import POSSIBLE_CELSIUS, without_slips
from tumble.recording.units import (
    Interpretation,
    about_units,
    decide_field_unit,
    decide_force,
    decide_rate,
    field_beside,
    field_of_rows,
    hold_length,
    read_units_option,
    rest_level,
)
from tumble.records import dataclass
from tumble.sample_rates import sample_rate, stated_clock
from tumble.units import COUNTS, celsius_from, time_factor

Rows = npt.NDArray[np.intp]
_MOST_BAD_ROWS = 0.01
_MOST_PARTED_ROWS = 0.5


def _triad(table: RawTable, triad: Axes) -> Vectors | None:
    """Put three columns side by side."""
    columns = [table.columns[i] if sign > 0.0 else -table.columns[i] for i, sign in triad]
    return np.column_stack(columns) if columns else None


def _pick(
    table: RawTable, plan: ColumnPlan, asked: Asked, state: BlockState
) -> tuple[Samples, Rows, list[Remark]]:
    """Return the samples of a table by a plan, the rows that they stand in, and what is said of those left out.

    Left out are rows that hold no finite number somewhere: one in a hundred of those so far at most, or half of them
    where runs may part the recording. The time is as the file has it, in row numbers where there are no stamps.
    """
    rows = np.arange(len(table))
    force, rates, magnetic = (_triad(table, plan.triads.get(kind, ())) for kind in "agm")
    time = rows.astype(np.float64) if plan.time is None else table.columns[plan.time]
    temperature = None if plan.temperature is None else table.columns[plan.temperature]
    samples = Samples(time, force, rates, temperature, magnetic)
    alone = magnetic if force is None and rates is None else None
    parts = [part for part in (time, force, rates, alone) if part is not None]
    with np.errstate(invalid="ignore", over="ignore"):
        if all(np.isfinite(p.sum()) for p in parts):  # a sum is finite if every term is
            return samples, rows, []
    good = np.logical_and.reduce([np.isfinite(p.reshape(len(table), -1)).all(axis=1) for p in parts])
    bad = int(good.size - good.sum())
    if not bad:
        return samples, rows, []
    row = int(np.argmin(good))
    where = _bad_column(table, plan, row)
    most = _MOST_PARTED_ROWS if asked.parted else _MOST_BAD_ROWS
    if bad > max(1.0, most * (state.rows + good.size)):
        raise RecordingError(
            f"{table.path.name}: {bad} of {good.size} rows hold no finite number somewhere, the first at "
            f"{table.place(row)}, {where}; mend the file or skip that column with --columns."
        )
    where = f"first: {table.place(row)}, {where}"
    text = f"{table.path.name}: {bad} row(s) without a finite number left out ({where})."
    return samples.cut(good), rows[good], [Remark("mended", text)]


def _bad_column(table: RawTable, plan: ColumnPlan, row: int) -> str:
    inertial = [kind for kind in "ag" if kind in plan.triads] or ["m"]
    used = [] if plan.time is None else [plan.time]
    used += [i for kind in inertial for i, _ in plan.triads[kind]]
    index = next(i for i in used if not np.isfinite(table.columns[i][row]))
    return table.column_name(index)


# In the name of a column of time: seconds of GNSS, or of a computer whose clock is set by a network.
_DISCIPLINED = ("gps", "gnss", "tow", "utc", "unix", "host")


@dataclass(frozen=True)
class Asked:
    """What is said of files beside what they hold, as `read_recording` takes it."""

    columns: str | None = None
    units: DeclaredUnits = DeclaredUnits()
    rate: float | str | None = None
    topics: Sequence[str] = ()
    parted: bool = False


def choose_columns(table: RawTable, asked: Asked) -> tuple[ColumnPlan, list[Remark]]:
    """Return which column is what: by the option, else the header, else the content.

    Parameters
    ----------
    table, asked : as read; what is said of it.

    Raises
    ------
    UsageError
        If the option does not fit the table.
    RecordingError
        If neither header nor content determines the columns, or the header names a part of a triad.
    """
    rate, units = asked.rate, asked.units
    name = table.path.name
    if asked.columns is not None:
        plan = plan_from_option(asked.columns, len(table.columns), name)
        if plan.temperature is not None and table.names is not None:
            unit = temperature_unit_in(table.names[plan.temperature])
            plan = replace(plan, units={} if unit is None else {"temperature": unit})
        return plan, []
    hertz = table.rate if rate is None or stated_clock(rate) is not None else sample_rate(rate)
    if table.names is not None:
        plan = plan_from_names(table.names)
        parts = _refuse_parts(table)
        if plan is not None:
            return plan, [Remark("found", _header_words(table, plan)), *parts, *_left_over(table, plan)]
        found, remarks = plan_from_content(table.columns, name, units, hertz)
        listed = ", ".join(table.names[:8])
        return found, [Remark("found", f"{name}: the header ({listed}) names no triad."), *remarks]
    return plan_from_content(table.columns, name, units, hertz)


def _refuse_parts(table: RawTable) -> list[Remark]:
    """Refuse a header that names one or two axes of the accelerometer or the gyro; of a magnetometer, say so."""
    parts = parts_of_triads(table.names or ())
    said: list[Remark] = []
    for kind, axes in parts.items():
        what = SENSOR[kind]
        named = ", ".join(repr(name) for name in axes.values())
        lacking = " and ".join(kind + axis for axis in AXES if axis not in axes)
        text = f"{table.path.name}: the header names {named} of the {what} and no {lacking}; a triad needs all three"
        if kind == "m":
            said.append(Remark("found", f"{text}, {NOTHING_MADE}"))
            continue
        others = {"a": "t,-,-,gx,gy,gz", "g": "t,ax,ay,az,-,-"}[kind]
        raise RecordingError(
            f"{text} axes. If the missing one has another name, say what every column is with --columns "
            f"(t,ax,ay,az,gx,gy,gz); to go without the {what}, skip its columns with - (as in {others})."
        )
    return said


def _left_over(table: RawTable, plan: ColumnPlan) -> list[Remark]:
    """Name the columns that nothing was made of, where a triad is missing: it may be among them."""
    missing = [SENSOR[kind] for kind in "ag" if kind not in plan.triads]
    used = {plan.time, plan.temperature, *(i for triad in plan.triads.values() for i, _ in triad)}
    unused = [name for i, name in enumerate(table.names or ()) if i not in used]
    if not missing or not unused:
        return []
    listed = ", ".join(repr(name) for name in unused[:8])
    return [
        Remark(
            "assumed",
            f"{table.path.name}: no {' and no '.join(missing)} was recognised; nothing was made of the columns "
            f"{listed}. If it is among them, name it with --columns (t,ax,ay,az,gx,gy,gz).",
        )
    ]


def _header_words(table: RawTable, plan: ColumnPlan) -> str:
    """Say which named column is what."""
    assert table.names is not None
    names = table.names
    parts = ["no time column" if plan.time is None else f"time {names[plan.time]!r}"]
    for kind, triad in plan.triads.items():
        parts.append(f"{QUANTITY[kind]} " + ", ".join(repr(names[i]) for i, _ in triad))
    if plan.temperature is not None:
        parts.append(f"temperature {names[plan.temperature]!r}")
    return f"{table.path.name}: {'; '.join(parts)}."


def _ordered(
    table: RawTable, plan: ColumnPlan, samples: Samples, rows: Rows, asked: Asked, state: BlockState
) -> stamps.Stamps:
    """Put the rows in time: by their stamps, or by the declared rate where there are none."""
    good_to, name = stated_clock(asked.rate), table.path.name
    rate = _declared_rate(table, plan, asked.rate if good_to is None else None)
    if rows.size < 2:
        raise RecordingError(f"{name} has {rows.size} usable row(s); a recording needs at least two.")
    if plan.time is not None:
        known = _reader(table, plan) if good_to is None else good_to
        unit = asked.units.time or plan.units.get("t")
        told = stamps.Told(name, _places(table, rows), unit, rate, asked.parted, known)
        return stamps.order_stamps(samples.time, told, state)
    if rate is None:
        raise RecordingError(
            f"{name} has no column of time stamps; give the sampling rate with --rate HZ "
            "(100±50ppm where a crystal keeps it), or name the time column with --columns."
        )
    time, every, clock = rows / rate, np.ones(rows.size, bool), clock_without_stamps(rate)
    return stamps.Stamps(time, every, stamps.find_gaps(time, rate), float(rate), "s", clock)


def _places(table: RawTable, rows: Rows) -> Callable[[int], str]:
    """Return what turns the number of a sample into words, for it stands in one of these rows."""
    return lambda sample: table.place(int(rows[sample]))


def _reader(table: RawTable, plan: ColumnPlan) -> Known:
    """Who read the stamps off a clock, as the file's kind or the column's name says."""
    name = "" if table.names is None or plan.time is None else table.names[plan.time].lower()
    return "host" if any(word in name for word in _DISCIPLINED) else table.clock


def interpret(
    table: RawTable, plan: ColumnPlan, asked: Asked, remarks: Sequence[Remark], state: BlockState
) -> tuple[Interpretation, Recording]:
    """Decide units and rate from a whole table (or a first block) and return the recording it makes.

    Parameters
    ----------
    table, plan : as read, and which column is what.
    asked : what is said of it.
    remarks : what was found so far.
    state : made what the next block goes on from, see `interpret_block`.

    Raises
    ------
    RecordingError
        If the numbers cannot be a recording or contradict what header or user declares.
    UsageError
        If the declared rate is not positive.
    """
    units, remarks = asked.units, [*table.remarks, *remarks, *about_units(table, plan, asked.units)]
    if units.temperature is not None:
        plan = replace(plan, units=plan.units | {"temperature": units.temperature})
    samples, rows, left_out = _pick(table, plan, asked, state)
    ordered = _ordered(table, plan, samples, rows, asked, state)
    remarks += [*left_out, *ordered.remarks]
    samples, rows = samples.cut(ordered.keep), rows[ordered.keep]
    hold = 1 if samples.magnetic_field is None else hold_length(samples.magnetic_field)
    time_unit = {} if plan.time is None else {"t": ordered.unit}
    decided = Interpretation(plan, time_unit, ordered.rate, ordered.clock, field_hold=hold)
    recording = _recording(table, samples, rows, ordered.time, decided, remarks, ordered.gaps)
    if recording.temperature is not None and plan.units.get("temperature", "degC") != "degC":
        text = f"The temperature is said to be in {plan.units['temperature']}, and is converted to °C."
        remarks.append(Remark("found", text))
    field = recording.magnetic_field
    unit, about_field = _about_field(field, table, decided, units)
    decided, about_triads = _judged(recording, decided.told("m", unit), units, table)
    every = (*remarks, *about_field, *about_triads, *_unchecked(recording))
    return replace(decided, remarks=every), replace(
        recording,
        specific_force=decided.scaled("a", recording.specific_force),
        angular_rate=decided.scaled("g", recording.angular_rate),
        specific_force_unit=decided.units.get("a", COUNTS),
        angular_rate_unit=decided.units.get("g", COUNTS),
        magnetic_field=None if field is None else replace(field, unit=unit),
        remarks=every,
    )


def _recording(
    table: RawTable,
    samples: Samples,
    rows: Rows,
    time: AnyArray,
    decided: Interpretation,
    remarks: list[Remark],
    gaps: tuple[int, ...],
) -> Recording:
    """Return the recording that samples at these times make, as it is decided."""
    return Recording(
        time=time,
        specific_force=decided.scaled("a", samples.specific_force),
        angular_rate=decided.scaled("g", samples.angular_rate),
        specific_force_unit=decided.units.get("a", COUNTS),
        angular_rate_unit=decided.units.get("g", COUNTS),
        rate=decided.rate,
        temperature=_in_celsius(samples.temperature, decided.plan.units.get("temperature", "degC"), remarks),
        remarks=tuple(remarks),
        gaps=gaps,
        temperature_unit=decided.plan.units.get("temperature"),
        said_clock=decided.clock,
        columns=option_of(decided.plan, len(table.columns)),
        magnetic_field=_field(table, samples, rows, time, decided),
    )


def _judged(
    recording: Recording, decided: Interpretation, units: DeclaredUnits, table: RawTable
) -> tuple[Interpretation, list[Remark]]:
    """Decide the units of both triads, and what is said of that."""
    plan = decided.plan
    if table.judged and units == DeclaredUnits() and plan.said_by == "header":
        # A file of tumble's own: its units were judged when it was written.
        return replace(decided, units=plan.units | decided.units), []
    level = None if recording.specific_force is None else rest_level(recording)
    decided, about_force = decide_force(recording, level, decided, units, table)
    recording = replace(recording, specific_force=decided.scaled("a", recording.specific_force))
    decided, about_rate = decide_rate(recording, decided, units, table)
    return decided, [*about_force, *about_rate]


def _declared_rate(table: RawTable, plan: ColumnPlan, asked: float | str | None) -> float | None:
    """Hz as asked for, or as a table without stamps states."""
    rate = None if asked is None else sample_rate(asked)
    if rate is not None and not stamps.RATES[0] <= rate <= stamps.RATES[1]:
        raise UsageError(f"--rate {rate:g}: give a positive number of samples a second, as 100.")
    rate = rate if rate is not None or plan.time is not None else table.rate
    if rate is not None and not stamps.RATES[0] <= rate <= stamps.RATES[1]:
        raise RecordingError(
            f"{table.path.name} states a rate of {rate:g} Hz, which no sensor has; give --rate HZ."
        )
    return rate


def _about_field(
    field: MagneticField | None,
    table: RawTable,
    decided: Interpretation,
    units: DeclaredUnits,
) -> tuple[str, list[Remark]]:
    """Decide the unit of the magnetometer's samples, from the rows or from beside them; and what is said of them."""
    header, name, said = decided.plan.units.get("m"), table.path.name, list[Remark]()
    beside = None if "m" in decided.plan.triads else table.field
    if beside is not None:
        header = beside.unit or None
        said += [Remark("found", f"{name}: {beside.name} {beside.note}.")] if beside.note else []
    if field is None:
        if "m" in decided.plan.triads or beside is not None:
            said.append(Remark("found", f"{name}: the magnetometer's columns hold no number but zero."))
        return COUNTS, said
    if (hold := decided.field_hold) > 1:
        text = f"The magnetometer has a new sample in every {hold} rows ({field.rate:.4g} Hz); repeated ones are none."
        said.append(Remark("found", text))
    unit, more = decide_field_unit(field, units, header, name)
    return unit, [*said, *more]


def _in_celsius(temperature: Series | None, unit: str, remarks: list[Remark]) -> Series | None:
    """Return the column in °C, as it is where nobody says what it is in, without numbers that are no temperature."""
    if temperature is None:
        return None
    if unit != "degC":
        factor, offset = celsius_from(unit)
        temperature = factor * temperature + offset
    temperature, slips = without_slips(temperature)
    if slips:
        beyond = "{} number(s) of the temperature are beyond {:g} to {:g} °C, and are left out."
        remarks.append(Remark("mended", beyond.format(slips, *POSSIBLE_CELSIUS)))
    return temperature


def _unchecked(recording: Recording) -> list[Remark]:
    if recording.specific_force is None:
        text = "Without an accelerometer nothing shows the gyro's unit, signs or order of axes."
        return [] if recording.angular_rate is None else [Remark("unchecked", text)]
    text = (
        "Whether all three accelerometer axes are reversed together (the sign of gravity) cannot be seen in "
        "a recording"
    )
    if recording.angular_rate is None:
        text += "; without a gyro neither can the order and handedness of the axes"
    return [Remark("unchecked", text + ".")]


def interpret_block(
    table: RawTable, decided: Interpretation, asked: Asked, state: BlockState
) -> Recording | None:
    """Return a block that follows as a recording, read as `decided` says; None if nothing is left of it.

    Parameters
    ----------
    table : the block.
    decided, state : as decided on the first block; what is carried from block to block.
    asked : what is said of it.

    Raises
    ------
    RecordingError
        If the block's rows or stamps are unusable.
    """
    samples, rows, left_out = _pick(table, decided.plan, asked, state)
    if not rows.size:
        return None
    remarks, time = [*table.remarks, *left_out], (state.rows + rows) / decided.rate
    if "t" in decided.units:
        place, unit = _places(table, rows), decided.units["t"]
        told = stamps.Told(table.path.name, place, unit, decided.rate, asked.parted)
        time, keep, said = stamps.continue_stamps(samples.time, told, state)
        if not time.size:
            return None
        remarks += said
        samples, rows = samples.cut(keep), rows[keep]
    gaps = stamps.find_gaps(time, decided.rate)
    return _recording(table, samples, rows, time, decided, remarks, gaps)


def _field(
    table: RawTable, samples: Samples, rows: Rows, time: AnyArray, decided: Interpretation
) -> MagneticField | None:
    """Return the magnetometer's samples among a recording's rows, or from beside them."""
    own, unit = decided.plan.magnetic_field_time, decided.units.get("m", COUNTS)
    if samples.magnetic_field is not None:
        stamps_ = time if own is None else table.columns[own][rows]
        return field_of_rows(stamps_, samples.magnetic_field, decided.field_hold, unit)
    kept = None if decided.plan.time is None else samples.time * time_factor(decided.units.get("t", "s"))
    return field_beside(table, kept, time, unit)


def is_field_table(table: RawTable) -> bool:
    """Say whether a table holds a magnetometer alone, by the names of its columns or of its file."""
    return _plan(table) is not None


def _plan(table: RawTable) -> ColumnPlan | None:
    plan = None if table.names is None else plan_from_names(table.names)
    if plan is not None:
        return plan if [*plan.triads] == ["m"] else None
    plan = triad_alone(table.columns) if kind_of_file(table.path.name) == "m" else None
    return None if plan is None else plan.renamed(a="m")


def field_of_file(table: RawTable, beside: str) -> tuple[MagneticField, Remark]:
    """Return a magnetometer's file as what stands beside the table of another, and the sentence that says so.

    Parameters
    ----------
    table : of the magnetometer, see `is_field_table`.
    beside : name of the other one.

    Raises
    ------
    RecordingError
        If it has no stamps.
    """
    plan, name = _plan(table), table.path.name
    assert plan is not None
    values = np.column_stack([table.columns[i] for i, _ in plan.triads["m"]])
    if plan.time is None:
        raise RecordingError(
            f"{name} is the magnetometer's beside {beside} and has no stamps of its own; put its columns "
            f"beside those of {beside}, or give it a column of time."
        )
    stamps = seconds_of(table.columns[plan.time], plan.units.get("t"))
    stream = MagneticField.finite(stamps, values, plan.units.get("m"), name)
    return stream, Remark("found", f"{name} is read as the magnetometer.")


_MOST_FILES = 3  # accelerometer, gyro and magnetometer

Input: TypeAlias = str | PathLike[str] | Frame
Paths: TypeAlias = Input | Sequence[Input]


def recording_inputs(paths: Paths) -> list[Path | Frame]:
    """Return what was named as recordings as a list: of files, or of data frames of pandas or polars.

    Raises
    ------
    UsageError
        If nothing was named.
    """
    if not isinstance(paths, Iterable | PathLike | Frame):  # pyright: ignore[reportUnnecessaryIsInstance]  # untyped callers
        raise UsageError(
            f"A {type(paths).__name__} is no recording: give a path, or a data frame of pandas or polars (a lazy one "
            "collected)."
        )
    named = [paths] if isinstance(paths, str | PathLike | Frame) else list(paths)
    if not named:
        raise UsageError("No recording was named.")
    return [Path(fspath(one)) if isinstance(one, str | PathLike) else one for one in named]


def _names(topics: str | Sequence[str] | None) -> Sequence[str]:
    """Return topics as a list of names; one alone may be a mere string."""
    return (topics,) if isinstance(topics, str) else topics or ()


def _tables(one: Path | Frame, topics: Sequence[str], *, whole: bool) -> Iterator[RawTable]:
    """Return the tables that an input is read as: one, or those of its blocks."""
    if isinstance(one, Path):
        return iter([read_table(one, topics)]) if whole else read_table_blocks(one, topics)
    if topics:
        raise UsageError(f"A data frame has no topics ({topics[0]}); leave them out.")
    return iter([frame_table(one)])


@border
def read_recording(
    paths: Paths,
    *,
    columns: str | None = None,
    units: str | Sequence[str] | None = None,
    rate: float | str | None = None,
    topics: str | Sequence[str] | None = None,
    parted: bool = False,
) -> Recording:
    """Read a recording from one file, or from two files with one triad each; a magnetometer may have its own file.

    The signals stay raw, in the file's own units; what is not said by the options or the header is
    found from the content, and every guess is a remark of the recording. What header or options say
    is checked against gravity wherever gravity can show it.

    Parameters
    ----------
    paths : one file, or the two files of a pair; a data frame of pandas or polars stands for a file.
    columns : what the columns are, as ``t,ax,ay,az,gx,gy,gz``; ``-`` skips one, ``-ay`` reverses one;
        for a pair the two lists with ``;`` between.
    units : units as ``g,deg/s,ms`` in any order, ``counts``, or ``m/s,rad`` for increments.
    rate : sampling rate in Hz, for files without stamps.
    topics : which topics or streams of a bag or log are read: one (a string will do), or one of each triad.
    parted : whether a clock that begins anew, and long runs of rows without numbers, part the recording instead
        of being refused: for what takes pieces, such as noise.

    Raises
    ------
    RecordingError
        If a file cannot be read as a recording, or contradicts its header or the options.
    UsageError
        If an option is malformed, or the files are not one recording.
    """
    listed = recording_inputs(paths)
    _refuse_many(len(listed))
    asked = Asked(columns, read_units_option(units), rate, _names(topics), parted)
    return _whole(listed, [next(_tables(one, asked.topics, whole=True)) for one in listed], asked)


def read_recordings(
    paths: Paths,
    *,
    columns: str | None = None,
    units: str | Sequence[str] | None = None,
    rate: float | str | None = None,
    topics: str | Sequence[str] | None = None,
) -> list[Recording]:
    """Read files that are one recording each, or one pair; the parameters are `read_recording`'s.

    Raises
    ------
    RecordingError
        If a file cannot be read as a recording, or contradicts its header or the options.
    UsageError
        If an option is malformed.
    """
    asked = Asked(columns, read_units_option(units), rate, _names(topics))
    listed = recording_inputs(paths)
    tables = [next(_tables(one, asked.topics, whole=True)) for one in listed]
    others = [t for t in tables if not is_field_table(t)]
    if (is_pair(others) and len(tables) <= _MOST_FILES) or len(others) == 1 < len(tables) == _MOST_FILES - 1:
        return [_whole(listed, tables, asked)]
    return [_whole([one], [table], asked) for one, table in zip(listed, tables, strict=True)]


def _whole(listed: Sequence[Path | Frame], tables: list[RawTable], asked: Asked) -> Recording:
    """Return the recording that whole tables make: it is a single block."""
    for table in tables:
        if not len(table):
            raise RecordingError(f"{table.path.name} has no rows.")
    return next(_blocks(listed, [iter([table]) for table in tables], asked, whole=True))


def _refuse_many(count: int, most: int = _MOST_FILES) -> None:
    if count > most:
        raise UsageError(
            f"{count} files were named as one recording; it is one file, or two with one triad each. One more may hold "
            "the magnetometer (files of one step each are read one by one)."
        )


def _refuse_no_pair(tables: list[RawTable], columns: str | None) -> None:
    if columns is None and not is_pair(tables):
        names = " and ".join(t.path.name for t in tables)
        counts = " and ".join(str(len(t.columns)) for t in tables)
        raise RecordingError(
            f"{names} are no pair of triads (they have {counts} columns; each would need three beside the "
            "time); give one recording at a time."
        )


def read_blocks(
    paths: Paths,
    *,
    columns: str | None = None,
    units: str | Sequence[str] | None = None,
    rate: float | str | None = None,
    topics: str | Sequence[str] | None = None,
    parted: bool = False,
) -> Iterator[Recording]:
    """Read a recording of any length as consecutive blocks of bounded size.

    What the columns and units are is decided on the first block (some 16 MB of text or half a million
    rows); declare them where that might not suffice. Text, Parquet, NPY and bags are read piece by
    piece, the other formats whole. The remarks of the first block tell what was found and assumed, those of
    later blocks what was mended there. The sources carry their SHA-256.

    Parameters
    ----------
    paths, columns, units, rate, topics, parted : as for `read_recording`.

    Yields
    ------
    Recording, time strictly increasing within and across blocks.

    Raises
    ------
    RecordingError
        If a file cannot be read as a recording, or contradicts its header or the options; also in
        the middle of the iteration.
    UsageError
        If an option is malformed, or the files are not one recording.
    """
    listed = recording_inputs(paths)
    _refuse_many(len(listed))
    asked = Asked(columns, read_units_option(units), rate, _names(topics), parted)
    yield from _blocks(listed, [_tables(one, asked.topics, whole=False) for one in listed], asked)


def _blocks(
    listed: Sequence[Path | Frame], readers: list[Iterator[RawTable]], asked: Asked, *, whole: bool = False
) -> Iterator[Recording]:
    """Yield what tables make: one of each reader, the whole; or their blocks."""
    decided: Interpretation | None = None
    sources, said = tuple[Source, ...](), set[Remark]()
    state = BlockState()
    held: Recording | None = None
    begin = -np.inf
    readers, fields = _without_field(readers)
    for table, plan, remarks in _planned(readers, asked, in_blocks=not whole):
        if fields:
            field, remark = field_of_file(fields[0], table.path.name)
            table = replace(table, field=field, remarks=[*table.remarks, *([] if decided else [remark])])
        if decided is None:
            sources = _hashed(listed, table)
            decided, block = interpret(table, plan, asked, remarks, state)
        else:
            block = interpret_block(table, decided, asked, state)
        state.rows += len(table)
        if block is not None:
            new = tuple(remark for remark in block.remarks if remark not in said)
            said.update(new)
            block = replace(block, sources=sources, remarks=new)
            if table.field is None:
                yield block
            elif held is not None:
                yield _share(held, begin, float(block.time[0]))
                begin = float(block.time[0])
            held = None if table.field is None else block
    if held is not None:
        yield _share(held, begin, np.inf)
    if decided is None:
        raise RecordingError(f"{input_name(listed[0])} has no rows.")


def _hashed(listed: Sequence[Path | Frame], table: RawTable) -> tuple[Source, ...]:
    """Return names and SHA-256 of inputs; of the one that has topics, also that which was read."""
    sources = [source_of(p) if isinstance(p, Path) else frame_source(p) for p in listed]
    own = sources[0].name if len(sources) == 1 else table.path.name
    return tuple(replace(one, topic=table.topic) if one.name == own else one for one in sources)


def _share(block: Recording, begin: float, end: float) -> Recording:
    """Leave a block those samples of a magnetometer beside it that are its own: up to the next block's first."""
    field = block.magnetic_field
    return block if field is None else replace(block, magnetic_field=field.within(begin, end))


def _without_field(readers: list[Iterator[RawTable]]) -> tuple[list[Iterator[RawTable]], list[RawTable]]:
    """Take the tables of a magnetometer alone out of several, and read it whole: it is slower than the others."""
    if len(readers) == 1:
        return readers, []
    firsts = [next(reader, None) for reader in readers]
    fields = [i for i, table in enumerate(firsts) if table is not None and is_field_table(table)]
    begun = [
        chain([] if first is None else [first], rest) for first, rest in zip(firsts, readers, strict=True)
    ]
    if len(fields) == 1:
        field = begun.pop(fields[0])
        return list(begun), [joined_tables(list(field))]
    _refuse_many(len(begun), _MOST_FILES - 1)
    return list(begun), []


def _planned(
    readers: list[Iterator[RawTable]], asked: Asked, *, in_blocks: bool
) -> Iterator[tuple[RawTable, ColumnPlan, Sequence[Remark]]]:
    """Yield tables with their columns chosen; the choice of the first one holds for all, and is said of it."""
    if len(readers) == 1:
        chosen: tuple[ColumnPlan, list[Remark]] | None = None
        for table in readers[0]:
            chosen = chosen or choose_columns(table, asked)
            yield table, *chosen
        return
    pairing: Pairing | None = None
    for first, second in _in_step(readers) if in_blocks else zip(*readers, strict=True):
        if pairing is None:
            _refuse_no_pair([first, second], asked.columns)
            pairing = find_pairing(first, second, asked.columns)
        yield merge_pair(first, second, pairing), pairing.plan, pairing.remarks


def _in_step(readers: list[Iterator[RawTable]]) -> Iterator[tuple[RawTable, RawTable]]:
    """Yield the tables of two files cut to the same rows."""
    held: list[RawTable | None] = [None, None]
    names, rows = ["", ""], 0
    while True:
        held = [next(reader, None) if one is None else one for one, reader in zip(held, readers, strict=True)]
        first, second = held
        if first is None and second is None:
            return
        if first is None or second is None:
            short = 0 if first is None else 1
            raise RecordingError(
                f"{names[short]} ends after {rows} rows and {names[1 - short]} goes on: the two "
                "triads need the same stamps. Cut one of them."
            )
        count = min(len(first), len(second))
        yield first.cut(0, count), second.cut(0, count)
        names, rows = [first.path.name, second.path.name], rows + count
        held = [t.cut(count, len(t)) if len(t) > count else None for t in (first, second)]
