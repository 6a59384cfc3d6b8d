"""Reading a recording: block by block in bounded memory, or whole, which is one block.

A magnetometer in a file of its own, beside the file or the pair of files that hold the other triads.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain
from os import PathLike, fspath
from pathlib import Path
from typing import TypeAlias

import numpy as np

from tumble.border import border
from tumble.errors import RecordingError, UsageError
from tumble.recording.columns import (
    ColumnPlan,
    Pairing,
    find_pairing,
    is_pair,
    kind_of_file,
    merge_pair,
    plan_from_names,
    triad_alone,
)
from tumble.recording.formats import read_table, read_table_blocks, source_of
from tumble.recording.formats.frames import Frame, frame_source, frame_table, input_name
from tumble.recording.formats.table import RawTable, joined_tables
from tumble.recording.interpretation import (
    Interpretation,
    choose_columns,
    interpret,
    interpret_block,
)
from tumble.recording.recording import Recording
from tumble.recording.samples import MagneticField, Remark, Source
from tumble.recording.stamps import BlockState, seconds_of
from tumble.recording.units import DeclaredUnits, read_units_option
from tumble.records import dataclass


def is_field_table(table: RawTable) -> bool:
    """Say whether a table holds a magnetometer alone, by the names of its columns or of its file."""
    return _plan(table) is not None


def _plan(table: RawTable) -> ColumnPlan | None:
    plan = None if table.names is None else plan_from_names(table.names)
    if plan is not None:
        alone = plan.specific_force is None and plan.angular_rate is None
        return plan if alone and plan.magnetic_field is not None else None
    plan = triad_alone(table.columns) if kind_of_file(table.path.name) == "m" else None
    return None if plan is None else replace(plan, specific_force=None, magnetic_field=plan.specific_force)


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
    values = np.column_stack([table.columns[i] for i, _ in plan.magnetic_field or ()])
    if plan.time is None:
        raise RecordingError(
            f"{name} is the magnetometer's beside {beside} and has no stamps of its own; put its columns "
            f"beside those of {beside}, or give it a column of time."
        )
    stamps = seconds_of(table.columns[plan.time], plan.time_unit)
    stream = MagneticField.finite(stamps, values, plan.magnetic_field_unit, name)
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


@dataclass(frozen=True, slots=True)
class _Asked:
    """What is said of files, beside what they hold."""

    columns: str | None
    units: DeclaredUnits
    rate: float | str | None
    topics: Sequence[str]
    parted: bool = False


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
    asked = _Asked(columns, read_units_option(units), rate, _names(topics), parted)
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
    asked = _Asked(columns, read_units_option(units), rate, _names(topics))
    listed = recording_inputs(paths)
    tables = [next(_tables(one, asked.topics, whole=True)) for one in listed]
    others = [t for t in tables if not is_field_table(t)]
    if (is_pair(others) and len(tables) <= _MOST_FILES) or len(others) == 1 < len(tables) == _MOST_FILES - 1:
        return [_whole(listed, tables, asked)]
    return [_whole([one], [table], asked) for one, table in zip(listed, tables, strict=True)]


def _whole(listed: Sequence[Path | Frame], tables: list[RawTable], asked: _Asked) -> Recording:
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
    asked = _Asked(columns, read_units_option(units), rate, _names(topics), parted)
    yield from _blocks(listed, [_tables(one, asked.topics, whole=False) for one in listed], asked)


def _blocks(
    listed: Sequence[Path | Frame], readers: list[Iterator[RawTable]], asked: _Asked, *, whole: bool = False
) -> Iterator[Recording]:
    """Yield what tables make: one of each reader, the whole; or their blocks."""
    decided: Interpretation | None = None
    sources = tuple[Source, ...]()
    state, ends, said_first = BlockState(), [-np.inf], tuple[Remark, ...]()
    readers, fields = _without_field(readers)
    for table, plan, remarks in _planned(readers, asked, in_blocks=not whole):
        if fields:
            field, remark = field_of_file(fields[0], table.path.name)
            table = replace(table, field=field, remarks=[*table.remarks, *([] if decided else [remark])])
        if decided is None:
            sources = _hashed(listed, table)
            said = (asked.units, asked.rate, sources, list(remarks))
            decided, recording = interpret(table, plan, *said, parted=asked.parted)
            if whole:
                yield recording
                return
            said_first = decided.remarks
        block = interpret_block(table, decided, state, sources, parted=asked.parted)
        if block is not None:
            block = replace(block, remarks=said_first or block.remarks)
            yield _share(block, ends) if fields else block
        said_first = ()
    if decided is None:
        raise RecordingError(f"{input_name(listed[0])} has no rows.")


def _hashed(listed: Sequence[Path | Frame], table: RawTable) -> tuple[Source, ...]:
    """Return names and SHA-256 of inputs; of one, also the topic that it was read of."""
    sources = [source_of(p) if isinstance(p, Path) else frame_source(p) for p in listed]
    if len(sources) == 1:
        sources = [replace(sources[0], topic=table.topic)]
    return tuple(sources)


def _share(block: Recording, ends: list[float]) -> Recording:
    """Leave a block the samples of a magnetometer's file that fall in it; `ends` notes where the one before ended."""
    begin, end = ends[-1], float(block.time[-1]) + 0.5 / block.rate
    ends.append(end)
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
    readers: list[Iterator[RawTable]], asked: _Asked, *, in_blocks: bool
) -> Iterator[tuple[RawTable, ColumnPlan, Sequence[Remark]]]:
    """Yield tables with their columns chosen; the choice of the first one holds for all, and is said of it."""
    if len(readers) == 1:
        chosen: tuple[ColumnPlan, list[Remark]] | None = None
        for table in readers[0]:
            chosen = chosen or choose_columns(table, asked.columns, asked.units, asked.rate)
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
