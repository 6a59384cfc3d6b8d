"""A unit over the years as a page, and what changed between two calibrations as a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.document import Calibration, ParameterBlock, ParameterChange
from tumble.parameters import decimals_of, fixed, in_families, parameter_of, said_unit, with_uncertainty
from tumble.report.figures.record import OF_FAMILY, Axis, Curve, Figure, Look, in_brackets, plain
from tumble.report.page import Figures, Page, Table, section
from tumble.report.parameters import ParameterRow, headed_table, rows_of

HEADS = ("parameter", "newest", "change", "a year", "unit")
_SHOWN = (
    ("last", "standard_uncertainty"),
    ("change", "change_standard_uncertainty"),
    ("rate_a_year", "rate_standard_uncertainty"),
)


def history_table(rows: Sequence[dict[str, Any]]) -> Table:
    """Return newest value, change and rate of each parameter with their uncertainties, a family in one unit.

    Parameters
    ----------
    rows : what is said of each parameter, as the calibrations have it.
    """
    lines: list[tuple[str, list[str]]] = []
    for places in in_families([row["name"] for row in rows]).values():
        own = [rows[k] for k in places]
        factor, unit = said_unit(own[0]["unit"], (abs(row["last"]) for row in own))
        lines += [(row["name"], [*(_cell(row, *keys, factor) for keys in _SHOWN), unit]) for row in own]
    return headed_table(HEADS, lines)


def _cell(row: dict[str, Any], value: str, sigma: str, factor: float) -> str:
    return "–" if row[value] is None else with_uncertainty(factor * row[value], factor * (row[sigma] or 0.0))


def history_page(
    unit: str,
    days: Sequence[str],
    names: Sequence[str],
    units: Sequence[str],
    numbers: tuple[AnyArray, AnyArray],
    rows: Sequence[dict[str, Any]],
) -> Page:
    """Return the page.

    Parameters
    ----------
    unit : its name.
    days : of the calibrations.
    names, units : of the parameters.
    numbers : values and standard uncertainties, (calibrations, parameters) each.
    rows : what is said of each parameter.
    """
    figures = [
        _figure(f"group-{number}", group, places, list(days), names, units, numbers)
        for number, (group, places) in enumerate(in_families(names).items())
    ]
    words = "Each parameter at each calibration, with its expanded uncertainty (k = 2)."
    table = history_table(rows)
    return Page(
        f"{unit}: {len(days)} calibrations",
        [*section("Drift", table), *section("Over time", Figures(figures, words))],
        wide=True,
    )


def _figure(
    name: str,
    group: str,
    places: list[int],
    days: list[str],
    names: Sequence[str],
    units: Sequence[str],
    numbers: tuple[AnyArray, AnyArray],
) -> Figure:
    curves: list[Curve] = []
    factor, unit = said_unit(units[places[0]], np.abs(numbers[0][:, places]).ravel().tolist())
    for at, k in enumerate(places):
        values: Series = factor * numbers[0][:, k]
        expanded: Series = 2.0 * factor * numbers[1][:, k]
        axis = parameter_of(names[k]).axes.replace(" to force ", "←")
        look: Look = {"colour": OF_FAMILY[at % len(OF_FAMILY)], "sigma": expanded, "symbol": "circle"}
        curves.append(Curve(days, plain(values, 8), axis, **look))
    title = f"{group} / {in_brackets(unit)}" if unit else group
    return Figure(name, f"{group} over time", curves, Axis(kind="date"), Axis(title), 380)


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
