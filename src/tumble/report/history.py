"""A unit over the years as a page: each group of parameters with its uncertainties, calibration by calibration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tumble.arrays import Series, Table
from tumble.parameters import in_families, parameter_of
from tumble.report.figures.record import AXIS_COLOURS, BLUE, Axis, Curve, Figure, Look, plain
from tumble.report.page import Figures, Page, section
from tumble.report.page import Table as PageTable

HEADS = ("parameter", "newest", "u", "change", "u", "a year", "u", "unit")


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
    table = PageTable(HEADS, [_row(row) for row in rows], right=range(1, 7))
    return Page(
        f"{unit}: {len(days)} calibrations",
        [*section("Drift", table), *section("Over time", Figures(figures, words))],
        wide=True,
    )


def _row(row: dict[str, Any]) -> list[str]:
    numbers = [row["last"], row["standard_uncertainty"], row["change"], row["change_standard_uncertainty"]]
    numbers += [row["rate_a_year"], row["rate_standard_uncertainty"]]
    return [row["name"], *("–" if x is None else f"{x:.4g}" for x in numbers), row["unit"]]


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
    for k in places:
        values: Series = numbers[0][:, k]
        expanded: Series = 2.0 * numbers[1][:, k]
        axis = parameter_of(names[k]).axes
        look: Look = {"colour": AXIS_COLOURS.get(axis, BLUE), "sigma": expanded, "symbol": "circle"}
        curves.append(Curve(days, plain(values, 8), axis, **look))
    unit = units[places[0]]
    title = group if unit == "1" else f"{group}, {unit}"
    return Figure(name, f"{group} over time", curves, Axis(kind="date"), Axis(title), 240)
