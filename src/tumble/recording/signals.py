"""The columns of a table in their roles: triads side by side, rows without finite numbers left out."""

from __future__ import annotations

from dataclasses import field, replace

import numpy as np
import numpy.typing as npt

from tumble.arrays import AnyArray, Series, Vectors
from tumble.errors import RecordingError
from tumble.recording.columns import ColumnPlan
from tumble.recording.formats.table import RawTable
from tumble.recording.recording import Remark
from tumble.records import dataclass

_MOST_BAD_ROWS = 0.01
_MOST_PARTED_ROWS = 0.5


def _shared(columns: list[Series]) -> Vectors | None:
    """Return the (rows, 3) array that three columns are the columns of, in this order, or None."""
    base = columns[0].base
    rows = columns[0].shape[0]
    if not isinstance(base, np.ndarray) or base.ndim != 2 or base.shape[1] != 3 or base.shape[0] < rows:
        return None
    begins, width = base.ctypes.data, base.itemsize
    offsets = [c.ctypes.data - begins for c in columns]
    first = offsets[0] // (3 * width)
    wanted = [3 * width * first + j * width for j in range(3)]
    same = base.dtype == np.float64 and base.flags.c_contiguous and all(c.base is base for c in columns)
    return base[first : first + rows] if same and offsets == wanted else None


def _triad(table: RawTable, triad: tuple[tuple[int, float], ...] | None) -> Vectors | None:
    """Put three columns side by side, without a copy where the format has done so."""
    if triad is None:
        return None
    shared = _shared([table.columns[i] for i, _ in triad])
    if shared is not None and all(sign > 0.0 for _, sign in triad):
        return shared
    values = np.empty((len(table), 3))
    for axis, (index, sign) in enumerate(triad):
        values[:, axis] = table.columns[index]
        if sign < 0:
            values[:, axis] *= -1.0
    return values


@dataclass(slots=True)
class Signals:
    """The columns of one table in their roles, after rows without finite numbers were left out.

    `rows` are the row numbers in the table of what is left, None for all. `magnetic` may hold rows without a number:
    a magnetometer often has fewer samples than the table has rows. `magnetic_stamps` are its own, s, where the table
    has them.
    """

    stamps: Series | None
    force: Vectors | None
    rates: Vectors | None
    temperature: Series | None
    rows: npt.NDArray[np.intp] | None
    remarks: list[Remark] = field(default_factory=list[Remark])
    magnetic: Vectors | None = None
    magnetic_stamps: Series | None = None

    def cut(self, keep: npt.NDArray[np.bool_]) -> Signals:
        """Return what a boolean array keeps of the columns."""

        def kept(part: AnyArray | None) -> AnyArray | None:
            return None if part is None else part[keep]

        if keep.all():
            return self
        return replace(
            self,
            stamps=kept(self.stamps),
            force=kept(self.force),
            rates=kept(self.rates),
            temperature=kept(self.temperature),
            magnetic=kept(self.magnetic),
            magnetic_stamps=kept(self.magnetic_stamps),
        )


def pick_signals(table: RawTable, plan: ColumnPlan, *, parted: bool = False) -> Signals:
    """Pick the columns of a table by a plan; rows that hold no finite number are left out.

    Parameters
    ----------
    table, plan : as read, and which column is what.
    parted : whether runs of such rows may part the recording: then half of all may be left out.

    Raises
    ------
    RecordingError
        If more than one row in a hundred would have to be left out.
    """
    time = None if plan.time is None else table.columns[plan.time]
    force, rates = _triad(table, plan.specific_force), _triad(table, plan.angular_rate)
    temperature = None if plan.temperature is None else table.columns[plan.temperature]
    magnetic = _triad(table, plan.magnetic_field)
    own = None if plan.magnetic_field_time is None else table.columns[plan.magnetic_field_time]
    alone = magnetic if force is None and rates is None else None
    parts = [p for p in (time, force, rates, alone) if p is not None]
    with np.errstate(invalid="ignore", over="ignore"):
        finite = all(np.isfinite(p.sum()) for p in parts)  # a sum is finite if every term is
    signals = Signals(time, force, rates, temperature, None, magnetic=magnetic, magnetic_stamps=own)
    if finite:
        return signals
    good = np.ones(len(table), bool)
    for part in parts:
        good &= np.isfinite(part) if part.ndim == 1 else np.isfinite(part).all(axis=1)
    bad = int(good.size - good.sum())
    if not bad:
        return signals
    row = int(np.argmin(good))
    where = _bad_column(table, plan, row)
    if bad > max(1.0, (_MOST_PARTED_ROWS if parted else _MOST_BAD_ROWS) * good.size):
        raise RecordingError(
            f"{table.path.name}: {bad} of {good.size} rows hold no finite number somewhere, the first at "
            f"{table.place(row)}, {where}; mend the file or skip that column with --columns."
        )
    where = f"first: {table.place(row)}, {where}"
    text = f"{table.path.name}: {bad} row(s) without a finite number left out ({where})."
    return replace(signals.cut(good), rows=np.flatnonzero(good), remarks=[Remark("mended", text)])


def _bad_column(table: RawTable, plan: ColumnPlan, row: int) -> str:
    used = [plan.time] if plan.time is not None else []
    triads = [t for t in (plan.specific_force, plan.angular_rate) if t is not None] or [
        plan.magnetic_field or ()
    ]
    used += [i for t in triads for i, _ in t]
    index = next(i for i in used if not np.isfinite(table.columns[i][row]))
    return table.column_name(index)
