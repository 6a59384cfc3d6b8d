"""What changed between two calibrations, or what one recovers of the truth, as a table in the units of people."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from msgspec.structs import replace

from tumble.parameters import GROUPS
from tumble.report.page import Table
from tumble.report.parameters import Measure, ParameterRow, parameter_rows
from tumble.report.rounding import with_uncertainty

if TYPE_CHECKING:
    from tumble.document.difference import ParameterChange
    from tumble.document.result import Calibration


def change_table(
    calibration: Calibration, changes: Sequence[ParameterChange], heads: tuple[str, str]
) -> Table:
    """Return each change with its standard uncertainty, in the unit of data sheets and in sigmas.

    Parameters
    ----------
    calibration : whose raw units the changes are in.
    changes : by name, in raw units.
    heads : of the columns of the first value and of the change.
    """
    rows: list[list[str]] = []
    looks: dict[int, str] = {}
    shown = {row.name: row for row in _rows(calibration, changes)}
    for group in GROUPS:
        own = [change for change in changes if shown[change.name].group == group]
        if own:
            looks[len(rows)] = "group"
            rows.append([group])
        rows += [_line(shown[change.name], change) for change in own]
    return Table(("parameter", *heads, "in σ", "unit"), rows, looks, right=(1, 2, 3))


def _rows(calibration: Calibration, changes: Sequence[ParameterChange]) -> list[ParameterRow]:
    """The first values as rows for people; their sigma is the change's, so that both are rounded alike."""
    from tumble.document.result import ParameterBlock

    blocks = [
        ParameterBlock(
            name=change.name,
            value=change.first,
            standard_uncertainty=change.standard_uncertainty or abs(change.second - change.first),
            unit=change.unit,
        )
        for change in changes
    ]
    return parameter_rows(replace(calibration, parameters=blocks))


def _measure(row: ParameterRow, change: ParameterChange) -> tuple[Measure, float]:
    """The first value in the unit of data sheets, and how many of that unit a raw unit is."""
    measure = row.shown
    if row.kind in ("bias", "g-sensitivity") and row.other is not None and not math.isnan(row.other.value):
        measure = row.other
    spread = change.standard_uncertainty or abs(change.second - change.first)
    return (measure, measure.sigma / spread) if spread else (row.shown, 1.0)


def _moved(change: ParameterChange, factor: float) -> str:
    moved = factor * (change.second - change.first)
    if not change.standard_uncertainty:
        return f"{moved:.3g}"
    return with_uncertainty(moved, factor * change.standard_uncertainty)


def _line(row: ParameterRow, change: ParameterChange) -> list[str]:
    measure, factor = _measure(row, change)
    moved = _moved(change, factor)
    sigmas = "–" if math.isnan(change.sigmas) else f"{change.sigmas:+.1f}"
    first = with_uncertainty(measure.value, measure.sigma).partition(" ")[0].lstrip("(")
    return [row.label, f"{measure.value:.6g}" if "×" in first else first, moved, sigmas, measure.unit]
