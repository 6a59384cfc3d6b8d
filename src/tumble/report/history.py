"""A unit over the years as a page: each group of parameters with its uncertainties, calibration by calibration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from tumble.arrays import Series, Table
from tumble.parameters.family import in_families, parameter_of
from tumble.parameters.measures import said_unit, with_uncertainty
from tumble.report.figures.record import AXIS_COLOURS, BLUE, Axis, Curve, Figure, Look, plain
from tumble.report.page import Figures, Page, section
from tumble.report.page import Table as PageTable
from tumble.report.parameters import headed_table

HEADS = ("parameter", "newest", "change", "a year", "unit")
_SHOWN = (
    ("last", "standard_uncertainty"),
    ("change", "change_standard_uncertainty"),
    ("rate_a_year", "rate_standard_uncertainty"),
)


def history_table(rows: Sequence[dict[str, Any]]) -> PageTable:
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
    numbers: tuple[Table, Table],
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
    numbers: tuple[Table, Table],
) -> Figure:
    curves: list[Curve] = []
    factor, unit = said_unit(units[places[0]], np.abs(numbers[0][:, places]).ravel().tolist())
    for k in places:
        values: Series = factor * numbers[0][:, k]
        expanded: Series = 2.0 * factor * numbers[1][:, k]
        axis = parameter_of(names[k]).axes
        look: Look = {"colour": AXIS_COLOURS.get(axis, BLUE), "sigma": expanded, "symbol": "circle"}
        curves.append(Curve(days, plain(values, 8), axis, **look))
    title = f"{group} / {unit}" if unit else group
    return Figure(name, f"{group} over time", curves, Axis(kind="date"), Axis(title), 240)
