"""A recording in two files, one a triad, as imu_tk's: three value columns each and the same stamps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.errors import RecordingError, UsageError
from tumble.recording.columns import ColumnPlan, kind_of_file, plan_from_names, plan_from_option
from tumble.recording.formats.table import RawTable
from tumble.recording.recording import Remark
from tumble.recording.unnamed_columns import find_accelerometer, triad_alone
from tumble.records import dataclass

_STAMP_TOLERANCE = 0.02  # of a step: stamps written with different rounding still agree


def _own_plan(table: RawTable) -> ColumnPlan | None:
    """Return the plan of a table with one triad, which is called the accelerometer's where no name says; else None."""
    plan = None if table.names is None else plan_from_names(table.names)
    if plan is None:
        return triad_alone(table.columns)
    return plan if (plan.specific_force is None) != (plan.angular_rate is None) else None


def _triad(plan: ColumnPlan) -> tuple[tuple[int, float], ...]:
    return plan.specific_force or plan.angular_rate or ()


def is_pair(tables: list[RawTable]) -> bool:
    """Say whether two tables have one triad each."""
    return len(tables) == 2 and all(_own_plan(t) is not None for t in tables)


@dataclass(frozen=True, slots=True)
class Pairing:
    """How two tables become one: what each has, and what the merged columns are.

    The merged table has time first (if either file has it), then the first file's three values, then
    the second's.
    """

    plans: tuple[ColumnPlan, ColumnPlan]
    plan: ColumnPlan
    remarks: tuple[Remark, ...] = ()


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
    own, other = (
        _plans_by_option(first, second, columns) if columns is not None else map(_own_plan, (first, second))
    )
    assert own is not None  # as `is_pair` says
    assert other is not None
    start = 0 if own.time is None and other.time is None else 1
    first_triad, second_triad = (
        tuple((start + 3 * n + i, sign) for i, (_, sign) in enumerate(_triad(one)))
        for n, one in enumerate((own, other))
    )
    plan = ColumnPlan(
        0 if start else None,
        first_triad,
        second_triad,
        said_by="header" if other.said_by == "header" else own.said_by,
        time_unit=own.time_unit or other.time_unit,
        specific_force_unit=own.specific_force_unit or other.specific_force_unit,
        angular_rate_unit=own.angular_rate_unit or other.angular_rate_unit,
    )
    pairing = Pairing((own, other), plan)
    if columns is not None:
        return pairing if own.specific_force is not None else replace(pairing, plan=plan.swapped())
    swapped, remark = _which(first, second, pairing)
    return replace(pairing, plan=plan.swapped() if swapped else plan, remarks=(remark,))


def _plans_by_option(first: RawTable, second: RawTable, columns: str) -> list[ColumnPlan]:
    halves = columns.split(";")
    if len(halves) != 2:
        raise UsageError(
            "--columns for a pair of files is two lists with ; between, as t,ax,ay,az;t,gx,gy,gz."
        )
    plans = [
        plan_from_option(h, len(t.columns), t.path.name) for h, t in zip(halves, (first, second), strict=True)
    ]
    lacking = [(p.specific_force is None, p.angular_rate is None) for p in plans]
    if sorted(lacking) != [(False, True), (True, False)]:
        raise UsageError("--columns for a pair of files gives ax,ay,az to one and gx,gy,gz to the other.")
    return plans


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
    own, other = pairing.plans
    if own.time is not None and other.time is not None:
        _check_stamps(first, own.time, second, other.time)
    both = ((first, own), (second, other))
    stamps = [table.columns[plan.time] for table, plan in both if plan.time is not None]
    return replace(
        first,
        names=None,
        columns=[*stamps[:1], *(table.columns[i] for table, plan in both for i, _ in _triad(plan))],
        remarks=[*first.remarks, *second.remarks],
        rate=first.rate or second.rate,
        judged=False,
        field=None,
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


def _kind(table: RawTable, plan: ColumnPlan) -> str | None:
    """Return "a" or "g" from the names of the columns or of the file."""
    if plan.said_by == "header":
        return "a" if plan.specific_force is not None else "g"
    return kind_of_file(table.path.name)


def _which(first: RawTable, second: RawTable, pairing: Pairing) -> tuple[bool, Remark]:
    """Return whether the first file is the gyro, and the sentence that says so."""
    merged = merge_pair(first, second, pairing)
    kinds = [_kind(table, plan) for table, plan in zip((first, second), pairing.plans, strict=True)]
    names = (first.path.name, second.path.name)
    named = kinds[0] != kinds[1] and set(kinds) <= {"a", "g", None}
    if named:
        swapped, reason = kinds[0] == "g" or kinds[1] == "a", "their names say so"
    else:
        rows = np.column_stack(merged.columns[-6:])
        rows = rows[np.isfinite(rows).all(axis=1)]
        order = find_accelerometer(rows[:, :3], rows[:, 3:])
        swapped, reason = order.swapped, order.reason
    force, rates = (names[1], names[0]) if swapped else names
    text = f"{force} is taken as the accelerometer and {rates} as the gyro: {reason}."
    return swapped, Remark("found" if named else "assumed", text)
