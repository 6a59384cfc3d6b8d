"""A recording in two files, one a triad, as imu_tk's: three value columns each and the same stamps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.errors import RecordingError, UsageError
from tumble.recording.columns import ColumnPlan, kind_of_file, plan_from_names, plan_from_option
from tumble.recording.formats.table import RawTable
from tumble.recording.recording import Remark
from tumble.recording.unnamed_columns import find_accelerometer, is_time_like
from tumble.records import dataclass

_STAMP_TOLERANCE = 0.02  # of a step: stamps written with different rounding still agree


def _value_columns(table: RawTable) -> tuple[int | None, tuple[int, ...]] | None:
    """Return time and value columns of a one-triad table, or None if it is not one."""
    plan = None if table.names is None else plan_from_names(table.names)
    if plan is not None:
        triads = [t for t in (plan.specific_force, plan.angular_rate) if t is not None]
        return (plan.time, tuple(i for i, _ in triads[0])) if len(triads) == 1 else None
    count = len(table.columns)
    if count == 4:
        times = [i for i in (0, 3) if is_time_like(table.columns[i])]
        return (times[0], tuple(i for i in range(4) if i != times[0])) if times else None
    return (None, (0, 1, 2)) if count == 3 else None


def _one_triad(table: RawTable) -> tuple[int | None, tuple[int, ...]]:
    """Return time and value columns of a table that `is_pair` has found to have one triad."""
    found = _value_columns(table)
    assert found is not None
    return found


def is_pair(tables: list[RawTable]) -> bool:
    """Say whether two tables have one triad each."""
    return len(tables) == 2 and all(_value_columns(t) is not None for t in tables)


@dataclass(frozen=True, slots=True)
class Pairing:
    """How two tables become one: their time and value columns, and what the merged columns are.

    The merged table has time first (if either file has it), then the first file's three values, then
    the second's.
    """

    time: int | None
    values: tuple[int, ...]
    other_time: int | None
    other_values: tuple[int, ...]
    plan: ColumnPlan
    remarks: tuple[Remark, ...]


def find_pairing(first: RawTable, second: RawTable, columns: str | None = None) -> Pairing:
    """Find out which columns and which file is what.

    The names of columns or files decide which is the accelerometer, otherwise the content.

    Parameters
    ----------
    first, second : tables of one triad each.
    columns : the option ``--columns``, the two files' lists separated by ``;``, or None.

    Raises
    ------
    RecordingError
        If the files differ in length or in their stamps.
    UsageError
        If `columns` does not give one triad to each file.
    """
    if columns is not None:
        return _pairing_by_option(first, second, columns)
    (time, values), (other_time, other_values) = (_one_triad(t) for t in (first, second))
    start = 0 if time is None and other_time is None else 1
    triads = [tuple((i, 1.0) for i in range(s, s + 3)) for s in (start, start + 3)]
    plan = ColumnPlan(0 if start else None, triads[0], triads[1], said_by="content")
    pairing = Pairing(time, values, other_time, other_values, plan, ())
    swapped, remark = _which(first, second, merge_pair(first, second, pairing), plan)
    plan = _with_header_units(plan.swapped() if swapped else plan, first, second)
    return replace(pairing, plan=plan, remarks=(remark,))


def _pairing_by_option(first: RawTable, second: RawTable, columns: str) -> Pairing:
    halves = columns.split(";")
    if len(halves) != 2:
        raise UsageError(
            "--columns for a pair of files is two lists with ; between, as t,ax,ay,az;t,gx,gy,gz."
        )
    plans = [
        plan_from_option(h, len(t.columns), t.path.name) for h, t in zip(halves, (first, second), strict=True)
    ]
    if any((p.specific_force is None) == (p.angular_rate is None) for p in plans) or (
        (plans[0].specific_force is None) == (plans[1].specific_force is None)
    ):
        raise UsageError("--columns for a pair of files gives ax,ay,az to one and gx,gy,gz to the other.")
    own, other = (p.specific_force or p.angular_rate or () for p in plans)
    start = 0 if plans[0].time is None and plans[1].time is None else 1
    placed = [
        tuple((start + 3 * n + i, sign) for i, (_, sign) in enumerate(triad))
        for n, triad in enumerate((own, other))
    ]
    plan = ColumnPlan(0 if start else None, placed[0], placed[1], said_by="option")
    plan = plan if plans[0].specific_force is not None else plan.swapped()
    picks = [tuple(i for i, _ in triad) for triad in (own, other)]
    return Pairing(plans[0].time, picks[0], plans[1].time, picks[1], plan, ())


def merge_pair(first: RawTable, second: RawTable, pairing: Pairing) -> RawTable:
    """Put two tables side by side as `pairing` says.

    Raises
    ------
    RecordingError
        If the files differ in length or in their stamps.
    """
    if len(first) != len(second):
        raise RecordingError(
            f"{first.path.name} has {len(first)} rows and {second.path.name} has {len(second)}: the two "
            "triads need "
            "the same stamps. Cut or interpolate one of them onto the stamps of the other; of a phone's log name "
            "the folder, whose sensors are put on one clock."
        )
    stamps = None if pairing.time is None else first.columns[pairing.time]
    if pairing.time is not None and pairing.other_time is not None:
        _check_stamps(first, pairing.time, second, pairing.other_time)
    elif pairing.other_time is not None:
        stamps = second.columns[pairing.other_time]
    columns = [first.columns[i] for i in pairing.values] + [second.columns[i] for i in pairing.other_values]
    return RawTable(
        path=first.path,
        names=None,
        columns=columns if stamps is None else [stamps, *columns],
        source=first.source,
        remarks=[*first.remarks, *second.remarks],
        place=first.place,
        rate=first.rate or second.rate,
    )


def _check_stamps(first: RawTable, time: int, second: RawTable, other_time: int) -> None:
    a, b = first.columns[time], second.columns[other_time]
    step = abs(float(np.nanmedian(np.diff(a)))) if a.size > 1 else 0.0
    apart = np.flatnonzero(np.abs(a - b) > _STAMP_TOLERANCE * step)
    if apart.size:
        row = int(apart[0])
        raise RecordingError(
            f"{first.path.name} and {second.path.name} have different stamps from {first.place(row)} "
            f"on ({a[row]:.9g} and {b[row]:.9g}). Interpolate one onto the stamps of the other, or "
            "give one file with both. Of a phone's log give the folder, whose sensors are put on one "
            "clock."
        )


def _file_kind(table: RawTable) -> str | None:
    """Return "a" or "g" from the names of the columns or of the file."""
    plan = None if table.names is None else plan_from_names(table.names)
    if plan is not None:
        return "a" if plan.specific_force is not None else "g"
    return kind_of_file(table.path.name)


def _which(first: RawTable, second: RawTable, merged: RawTable, plan: ColumnPlan) -> tuple[bool, Remark]:
    """Return whether the first file is the gyro, and the sentence that says so."""
    kinds = (_file_kind(first), _file_kind(second))
    names = (first.path.name, second.path.name)
    if kinds in (("a", None), (None, "g"), ("a", "g"), ("g", None), (None, "a"), ("g", "a")):
        swapped = kinds[0] == "g" or kinds[1] == "a"
        reason, kind = "their names say so", "found"
    else:
        triads = [
            np.column_stack([merged.columns[i] for i, _ in t or ()])
            for t in (plan.specific_force, plan.angular_rate)
        ]
        finite = np.all(np.isfinite(np.hstack(triads)), axis=1)
        order = find_accelerometer(triads[0][finite], triads[1][finite])
        swapped, reason, kind = order.swapped, order.reason, "assumed"
    force, rates = (names[1], names[0]) if swapped else names
    text = f"{force} is taken as the accelerometer and {rates} as the gyro: {reason}."
    return swapped, Remark("found" if kind == "found" else "assumed", text)


def _with_header_units(plan: ColumnPlan, first: RawTable, second: RawTable) -> ColumnPlan:
    """Carry the units that the headers of the two files declare."""
    for table in (first, second):
        own = None if table.names is None else plan_from_names(table.names)
        if own is not None:
            plan = replace(
                plan,
                said_by="header",
                time_unit=plan.time_unit or own.time_unit,
                specific_force_unit=plan.specific_force_unit or own.specific_force_unit,
                angular_rate_unit=plan.angular_rate_unit or own.angular_rate_unit,
            )
    return plan
