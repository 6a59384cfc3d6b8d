"""The magnetometer of a table: which rows hold a new sample, at which time, and in which unit.

A magnetometer is slower than the triads beside it. Loggers then leave its cells empty in most rows, or repeat the last
sample; a repeated sample is none, and to average it as one would make it seem better known than it is.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Vectors
from tumble.recording.declared import DeclaredUnits
from tumble.recording.formats.table import RawTable
from tumble.recording.magnetic_field import MagneticField
from tumble.recording.recording import Remark
from tumble.recording.vector_signs import field_unit_of, is_earth_field, vector_signs
from tumble.units import COUNTS, magnetic_field_factor

_HELD = 1.5  # rows a sample on average: a quantised magnetometer at rest repeats fewer
_NORMALISED = 0.35  # of one, that a field in units of the local field is off by


def hold_length(values: Vectors) -> int:
    """Return over how many rows a logger holds each sample: 1 where every row is a new one.

    Parameters
    ----------
    values : (rows, 3) raw, rows without a number allowed.
    """
    there = values[np.isfinite(values).all(axis=1)][:200_000]
    if len(there) < 10:
        return 1
    new = np.flatnonzero(np.any(np.diff(there, axis=0) != 0.0, axis=1))
    runs = np.diff(new)
    if runs.size < 5 or float(np.mean(runs)) < _HELD:
        return 1
    return max(1, round(float(np.median(runs))))


def _new_rows(values: Vectors, hold: int) -> npt.NDArray[np.intp]:
    """Return the rows that hold a sample of their own: finite, and no repetition of a held one."""
    rows = np.flatnonzero(np.isfinite(values).all(axis=1))
    if hold == 1 or rows.size == 0:
        return rows
    there = values[rows]
    changed = np.concatenate([[True], np.any(np.diff(there, axis=0) != 0.0, axis=1)])
    number = np.arange(rows.size)
    first = np.flatnonzero(changed)
    run = np.cumsum(changed) - 1
    since, left = number - first[run], np.append(first[1:], rows.size)[run] - number
    # Two samples that are alike fill a run of about twice the length; one row more is the clocks' beat.
    return rows[changed | ((since % hold == 0) & (2 * left > hold))]


def field_of_rows(time: Series, values: Vectors, hold: int, unit: str) -> MagneticField | None:
    """Return the magnetometer's samples among a recording's rows, None if there are none.

    Parameters
    ----------
    time : (rows,) seconds.
    values : (rows, 3) raw, rows without a number allowed.
    hold : rows that each sample is repeated over.
    unit : of the numbers.
    """
    rows = _new_rows(values, hold)
    if rows.size == 0 or not np.any(values[rows]):
        return None
    if rows.size == len(values):
        return MagneticField(time, values, unit)
    return MagneticField(time[rows], values[rows], unit)


def field_beside(table: RawTable, raw: Series | None, time: Series, unit: str) -> MagneticField | None:
    """Return the samples that stand beside a table with stamps of their own, on the recording's time axis.

    Parameters
    ----------
    table : with `field`, or without.
    raw, time : stamps of the table's rows that are kept, in s, and what became of them on the recording's axis.
    unit : of the numbers.
    """
    stream = table.field
    if stream is None or not len(stream.time) or not np.any(stream.values):
        return None
    stamps = stream.time
    if raw is not None and raw.size:
        moved = time - raw
        stamps = stamps + np.interp(stamps, raw, moved) if np.any(moved) else stamps
    keep = np.concatenate([[True], np.diff(np.maximum.accumulate(stamps)) > 0.0])
    return MagneticField(stamps[keep], stream.values[keep], unit, stream.turn)


def decide_field_unit(
    field: MagneticField, units: DeclaredUnits, header: str | None, name: str
) -> tuple[str, list[Remark]]:
    """Return the magnetometer's unit: declared, from the header, or guessed from its norm; and what is said of it.

    Parameters
    ----------
    field : raw.
    units, header : as the user declares, and as the file's header says; None where nobody does.
    name : of the file.
    """
    norm = vector_signs(field.values, field.rate or 100.0).norm
    unit = units.magnetic_field or header
    if unit is not None:
        factor = magnetic_field_factor(unit)
        if factor is None or is_earth_field(norm * factor):
            return unit, []
        return unit, [Remark("found", f"{name}: {not_the_earths(norm, unit)}")]
    said = f"its norm is {norm:.4g}"
    whole = bool(np.all(field.values[:50_000] == np.round(field.values[:50_000])))
    guess = field_unit_of(norm)
    if guess is not None and not whole:
        text = f"Magnetic field is taken as {guess}: {said}, the Earth's in that unit; say another one with --units."
        return guess, [Remark("assumed", text)]
    reason = f"{said}, in whole numbers" if whole else f"{said}, the Earth's field in no known unit"
    if not whole and abs(norm - 1.0) < _NORMALISED:
        reason = f"{said}, as of numbers in units of the local field"
    return COUNTS, [
        Remark(
            "assumed",
            f"Magnetic field is taken as {COUNTS}: {reason}; say its unit with --units (uT, gauss ...).",
        )
    ]


def not_the_earths(norm: float, unit: str) -> str:
    """Return the sentence on a norm that the Earth's field cannot have in its unit, and the unit in which it could."""
    factor = magnetic_field_factor(unit) or 1.0
    other = field_unit_of(norm)
    advice = (
        f"in {other} it would be the Earth's: check the unit (--units)"
        if other is not None and other != unit
        else "calibrate it away from iron and magnets, or check the unit (--units)"
    )
    return (
        f"the magnetometer's norm of {norm:.4g} {unit} is {norm * factor * 1e6:.4g} µT, and the Earth's field is 22 to "
        f"67 µT: hard iron, a magnet or a wrong unit; {advice}."
    )
