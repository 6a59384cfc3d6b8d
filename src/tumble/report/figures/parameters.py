"""Parameters with their intervals, group by group, and how they are correlated."""

from __future__ import annotations

import math
from itertools import groupby

import numpy as np

from tumble.arrays import Table
from tumble.parameters.family import ACCELEROMETER, GYRO, OPTIONAL
from tumble.parameters.measures import fixed
from tumble.report.figures.record import GREY, Axis, Figure, Map, Points, Spans, plain
from tumble.report.page import Block, Figures, Sentences, section
from tumble.report.parameters import ParameterRow

# Parameters that move together by more than this are worth a sentence.
_STRONG = 0.8
_INTERVALS = (
    "An interval that spans zero (dashed) is a value that the recording cannot distinguish from "
    "zero. Wide ones need more or other poses and turns."
)
_PALE = (
    "Off the diagonal the map should be pale: a deep blue or red cell is a pair that these poses and "
    "turns do not separate well."
)


def intervals(rows: list[ParameterRow], factor: float) -> list[Block]:
    """Return a figure for each family of parameters: values with 95 % intervals, in practical units.

    Parameters
    ----------
    rows : parameters for readers.
    factor : coverage factor of those that have none of their own.
    """
    families = [list(members) for _, members in groupby(rows, key=lambda row: row.parameter.family)]
    figures = [_intervals(f"interval-{n}", members, factor) for n, members in enumerate(families)]
    return section("Parameters with 95 % intervals", Figures(figures, _INTERVALS))


def _intervals(name: str, rows: list[ParameterRow], factor: float) -> Figure:
    title = _title(rows[0])
    points = Points(
        plain([row.drawn.value for row in rows], 7),
        [_axis_label(row) for row in rows],
        sigma=plain([row.factor(factor) * row.drawn.sigma for row in rows]),
        hover="%{y}: %{text}<extra></extra>",
        words=[row.drawn.text for row in rows],
    )
    return Figure(
        name,
        f"{title} with 95 % intervals",
        [points, Spans([0], [0], colour=GREY)],
        Axis(zero=False),
        Axis(kind="names", downwards=True),
        96 + 26 * len(rows),
        title=f"{title} / {_in_brackets(rows[0].drawn.unit)}",
    )


def _title(row: ParameterRow) -> str:
    family = row.parameter.family
    if row.kind == "scale factor":
        return f"{family.triad} scale"
    if row.group in (ACCELEROMETER, GYRO):
        return family.name.replace("accelerometer non", "acc. non")
    return row.parameter.short if row.group == OPTIONAL and row.kind != "g-sensitivity" else row.kind


def _axis_label(row: ParameterRow) -> str:
    axes = row.parameter.axes
    return axes.replace(" to force ", "←") if "force" in axes or axes in (*"xyz", "yz", "zx", "zy") else ""


def _in_brackets(unit: str) -> str:
    return f"({unit})" if "/" in unit or " " in unit else unit


def correlations(rows: list[ParameterRow], matrix: Table) -> list[Block]:
    """Return the heat map of correlations between the parameters.

    Parameters
    ----------
    rows : parameters for readers.
    matrix : (parameters, parameters) in the rows' order.
    """
    names = [row.parameter.short for row in rows]
    size = len(names)
    rounded = np.round(matrix, 2) + 0.0
    shown = Map(
        names,
        names,
        hover="%{x} and %{y}: %{z:.2f}<extra></extra>",
        values=[[float(v) if math.isfinite(v) else None for v in row] for row in rounded],
    )
    figure = Figure(
        "correlations",
        "Correlations between the parameters",
        [shown],
        Axis(kind="names", every=1),
        Axis(kind="names", every=1, downwards=True),
        170 + 17 * size,
        least_width=240 + 17 * size,
        most_width=360 + 36 * size,
    )
    return section("Correlations", Figures([figure], _PALE), Sentences([_strongest(rows, matrix)], "notes"))


def _strongest(rows: list[ParameterRow], correlations: Table) -> str:
    upper = np.triu(np.nan_to_num(correlations), 1)
    order = np.argsort(-np.abs(upper), axis=None)[:3]
    pairs = [(int(k // len(rows)), int(k % len(rows))) for k in order]
    strong = [(i, j) for i, j in pairs if abs(upper[i, j]) >= _STRONG]
    if not strong:
        i, j = pairs[0]
        return (
            f"No pair is correlated by more than {_STRONG:g}; the strongest is {rows[i].name} with "
            f"{rows[j].name} ({fixed(float(upper[i, j]), 2)})."
        )
    words = [f"{rows[i].name} with {rows[j].name} ({fixed(float(upper[i, j]), 2)})" for i, j in strong]
    return "Strongly correlated: " + "; ".join(words) + "."
