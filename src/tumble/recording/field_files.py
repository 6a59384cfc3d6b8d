"""A magnetometer in a file of its own, beside the file or the pair of files that hold the other triads."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series
from tumble.errors import RecordingError
from tumble.recording.columns import ColumnPlan, kind_of_file, plan_from_names
from tumble.recording.formats.table import FieldStream, RawTable
from tumble.recording.recording import Remark
from tumble.recording.stamps import guess_time_unit
from tumble.recording.unnamed_columns import is_time_like
from tumble.units import time_factor


def is_field_table(table: RawTable) -> bool:
    """Say whether a table holds a magnetometer alone, by the names of its columns or of its file."""
    return _plan(table) is not None


def _plan(table: RawTable) -> ColumnPlan | None:
    plan = None if table.names is None else plan_from_names(table.names)
    if plan is not None:
        alone = plan.specific_force is None and plan.angular_rate is None
        return plan if alone and plan.magnetic_field is not None else None
    count = len(table.columns)
    if kind_of_file(table.path.name) != "m" or count not in (3, 4):
        return None
    time = next((i for i in (0, 3) if count == 4 and is_time_like(table.columns[i])), None)
    values = tuple((i, 1.0) for i in range(count) if i != time)
    return ColumnPlan(time, magnetic_field=values) if len(values) == 3 else None


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
    raw = table.columns[plan.time]
    unit = plan.time_unit or guess_time_unit(float(np.nanmedian(np.diff(raw))))
    stamps: Series = raw * time_factor(unit)
    good = np.isfinite(values).all(axis=1) & np.isfinite(stamps)
    stream = FieldStream(name, stamps[good], values[good], plan.magnetic_field_unit)
    return stream, Remark("found", f"{name} is read as the magnetometer.")
