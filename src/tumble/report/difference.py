"""What changed between two calibrations, or what one recovers of the truth, as a table in the units of people."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from tumble.parameters.measures import decimals_of, fixed, with_uncertainty
from tumble.report.page import Table
from tumble.report.parameters import ParameterRow, headed_table, rows_of

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
    shown = {row.name: row for row in _rows(calibration, changes)}
    lines = [(change.name, _cells(shown[change.name], change)) for change in changes]
    return headed_table(("parameter", *heads, "in σ", "unit"), lines)


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
    return rows_of(blocks, calibration)


def _cells(row: ParameterRow, change: ParameterChange) -> list[str]:
    spread = change.standard_uncertainty or abs(change.second - change.first)
    # What has not changed and has no uncertainty has no digits either, and stays as it is in the file.
    first = row.said if spread else row.shown
    factor = first.sigma / spread if spread else 1.0
    moved = factor * (change.second - change.first)
    certain = not change.standard_uncertainty
    return [
        fixed(first.value, decimals_of(first.sigma)) if spread else f"{first.value:.6g}",
        f"{moved:.3g}" if certain else with_uncertainty(moved, factor * change.standard_uncertainty),
        "–" if math.isnan(change.sigmas) else f"{change.sigmas:+.1f}",
        first.unit,
    ]
