"""Reading a recording: whole, or block by block in bounded memory.

A magnetometer in a file of its own, beside the file or the pair of files that hold the other triads.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
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
from tumble.recording.formats.frames import Frame, frame_table, input_name
from tumble.recording.formats.table import FieldStream, RawTable
from tumble.recording.interpretation import (
    BlockState,
    Interpretation,
    choose_columns,
    interpret,
    interpret_block,
)
from tumble.recording.recording import Recording
from tumble.recording.samples import Remark, Source
from tumble.recording.stamps import seconds_of
from tumble.recording.units import DeclaredUnits, read_units_option


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


def field_of_file(table: RawTable, beside: str) -> tuple[FieldStream, Remark]:
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
    stream = FieldStream.finite(name, stamps, values, plan.magnetic_field_unit)
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


def _table(one: Path | Frame, topics: Sequence[str]) -> RawTable:
    if isinstance(one, Path):
        return read_table(one, topics)
    if topics:
        raise UsageError(f"A data frame has no topics ({topics[0]}); leave them out.")
    return frame_table(one)


def _tables(one: Path | Frame, topics: Sequence[str]) -> Iterator[RawTable]:
    return read_table_blocks(one, topics) if isinstance(one, Path) else iter([_table(one, topics)])


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
    declared = read_units_option(units)
    return _recording_of(
        [_table(one, _names(topics)) for one in listed], columns, declared, rate, parted=parted
    )


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
    declared = read_units_option(units)
    tables = [_table(one, _names(topics)) for one in recording_inputs(paths)]
    others = [t for t in tables if not is_field_table(t)]
    if (is_pair(others) and len(tables) <= _MOST_FILES) or len(others) == 1 < len(tables) == _MOST_FILES - 1:
        return [_recording_of(tables, columns, declared, rate)]
    return [_recording_of([t], columns, declared, rate) for t in tables]


def _recording_of(
    tables: list[RawTable],
    columns: str | None,
    declared: DeclaredUnits,
    rate: float | str | None,
    *,
    parted: bool = False,
) -> Recording:
    """Choose the columns of one table, or of a pair, and interpret them; a magnetometer's own table stands beside."""
    sources = tuple(t.source for t in tables)
    for table in tables:
        if not len(table):
            raise RecordingError(f"{table.path.name} has no rows.")
    tables, field = _without_field(tables)
    if len(tables) == 1:
        plan, remarks = choose_columns(tables[0], columns, declared, rate)
        table = _beside(tables[0], field)
        return interpret(table, plan, declared, rate, sources, remarks, parted=parted)[1]
    _refuse_no_pair(tables, columns)
    pairing = find_pairing(tables[0], tables[1], columns)
    merged = _beside(merge_pair(tables[0], tables[1], pairing), field)
    return interpret(merged, pairing.plan, declared, rate, sources, list(pairing.remarks), parted=parted)[1]


def _without_field(tables: list[RawTable]) -> tuple[list[RawTable], RawTable | None]:
    """Take the table of a magnetometer alone out of several."""
    fields = [t for t in tables if len(tables) > 1 and is_field_table(t)]
    if len(fields) == 1 and len(tables) <= _MOST_FILES:
        return [t for t in tables if t is not fields[0]], fields[0]
    _refuse_many(len(tables), _MOST_FILES - 1)
    return tables, None


def _beside(table: RawTable, field: RawTable | None) -> RawTable:
    """Put the magnetometer's table beside another."""
    if field is None:
        return table
    stream, remark = field_of_file(field, table.path.name)
    return replace(table, field=stream, remarks=[*table.remarks, remark])


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
    rows); declare them where that might not suffice. Text, Parquet and NPY are read piece by piece,
    the other formats whole. The remarks of the first block tell what was found and assumed, those of
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
    listed, field = _field_of_files(listed, _names(topics))
    declared = read_units_option(units)
    decided: Interpretation | None = None
    state, ends = BlockState(), [-np.inf]
    sources = tuple[Source, ...]()
    for table, plan, remarks in _planned_blocks(listed, columns, _names(topics), declared, rate):
        table = table if field is None else replace(table, field=field)
        if decided is None:
            sources = tuple(source_of(p) if isinstance(p, Path) else frame_table(p).source for p in listed)
            if len(sources) == 1:
                sources = (replace(sources[0], topic=table.source.topic),)
            decided, _ = interpret(table, plan, declared, rate, sources, remarks, parted=parted)
            block = interpret_block(table, decided, state, sources, parted=parted)
            block = None if block is None else replace(block, remarks=decided.remarks)
        else:
            block = interpret_block(table, decided, state, sources, parted=parted)
        if block is not None:
            yield block if field is None else _share(block, ends)
    if decided is None:
        raise RecordingError(f"{input_name(listed[0])} has no rows.")


def _share(block: Recording, ends: list[float]) -> Recording:
    """Leave a block the samples of a magnetometer's file that fall in it; `ends` notes where the one before ended."""
    begin, end = ends[-1], float(block.time[-1]) + 0.5 / block.rate
    ends.append(end)
    field = block.magnetic_field
    return block if field is None else replace(block, magnetic_field=field.within(begin, end))


def _field_of_files(
    listed: list[Path | Frame], topics: Sequence[str]
) -> tuple[list[Path | Frame], FieldStream | None]:
    """Take the file of a magnetometer alone out of several, and read it whole: it is slower than the others."""
    for one in listed if len(listed) > 1 else []:
        first = next(_tables(one, topics), None)
        if first is not None and is_field_table(first):
            rest = [other for other in listed if other is not one]
            return rest, field_of_file(_table(one, topics), input_name(rest[0]))[0]
    return listed, None


def _planned_blocks(
    paths: list[Path | Frame],
    columns: str | None,
    topics: Sequence[str],
    units: DeclaredUnits,
    rate: float | str | None,
) -> Iterator[tuple[RawTable, ColumnPlan, list[Remark]]]:
    """Yield tables with their columns chosen; the choice of the first one holds for all."""
    plan: ColumnPlan | None = None
    if len(paths) == 1:
        for table in _tables(paths[0], topics):
            remarks = list[Remark]()
            if plan is None:
                plan, remarks = choose_columns(table, columns, units, rate)
            yield table, plan, remarks
        return
    pairing: Pairing | None = None
    for first, second in _in_step(paths, topics):
        remarks = []
        if pairing is None:
            _refuse_no_pair([first, second], columns)
            pairing = find_pairing(first, second, columns)
            remarks = list(pairing.remarks)
        yield merge_pair(first, second, pairing), pairing.plan, remarks


def _in_step(paths: list[Path | Frame], topics: Sequence[str]) -> Iterator[tuple[RawTable, RawTable]]:
    """Yield the tables of two files cut to the same rows."""
    readers = [_tables(p, topics) for p in paths]
    held: list[RawTable | None] = [None, None]
    rows = [0, 0]
    while True:
        for i in (0, 1):
            if held[i] is None:
                held[i] = next(readers[i], None)
        first, second = held
        if first is None and second is None:
            return
        if first is None or second is None:
            short = 0 if first is None else 1
            raise RecordingError(
                f"{input_name(paths[short])} ends after {rows[short]} rows and {input_name(paths[1 - short])} goes on: "
                "the two "
                "triads need the same stamps. Cut one of them."
            )
        count = min(len(first), len(second))
        yield first.cut(0, count), second.cut(0, count)
        rows = [r + count for r in rows]
        held = [t.cut(count, len(t)) if len(t) > count else None for t in (first, second)]
