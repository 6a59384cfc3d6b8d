"""Parameters with their intervals and how they are correlated; the poses on the sphere of directions."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import groupby
from typing import Any

import numpy as np

from tumble.arrays import AnyArray, Table, Vectors
from tumble.attitude import twenty_six_directions
from tumble.calibration import distinct_poses
from tumble.parameters import ACCELEROMETER, GYRO, OPTIONAL, fixed
from tumble.report.figures.record import (
    BLUE,
    GREY,
    RED,
    Axis,
    Curve,
    Figure,
    Look,
    Map,
    Mark,
    Points,
    Spans,
    in_brackets,
    plain,
)
from tumble.report.page import Block, Figures, Sentences, section
from tumble.report.parameters import ParameterRow
from tumble.report.subject import pose_words

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
        [row.parameter.axes.replace(" to force ", "←") for row in rows],
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
        title=f"{title} / {in_brackets(rows[0].drawn.unit)}",
    )


def _title(row: ParameterRow) -> str:
    family = row.parameter.family
    if row.kind == "scale factor":
        return f"{family.triad} scale"
    if row.group in (ACCELEROMETER, GYRO):
        return family.name.replace("accelerometer non", "acc. non")
    # Of gyros alone, and so without their name.
    return family.words if row.group != OPTIONAL else family.short.replace("g-sens.", "g-sensitivity")


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


# More hold numbers than this at one point are counted instead of listed.
_MOST_NUMBERS = 4


def poses(up_b: Vectors, left_out: set[int], *, by_hand: bool = True) -> list[Block]:
    """Return the figure of the directions that pointed up in the holds.

    Parameters
    ----------
    up_b : (holds, 3) corrected specific force of each hold, in b.
    left_out : indices of holds without part in the estimate.
    by_hand : the test wants poses all over the sphere: name those that are missing.
    """
    units = up_b / np.linalg.norm(up_b, axis=1, keepdims=True)
    missing, distinct = missing_directions(units), len(distinct_poses(units))
    notes = [
        (
            f"{len(units)} holds in {distinct} pose{'s that differ by more than 10°' if distinct > 1 else ''}; "
            f"{26 - len(missing)} of the 26 standard attitudes (faces, edges and corners up) are covered."
        )
    ]
    if len(missing) and by_hand:
        notes.append("Missing: " + "; ".join(pose_words(direction) for direction in missing) + ".")
    colours = [RED if k in left_out else BLUE for k in range(len(units))]
    words = [f"hold {k + 1}: {pose_words(unit)}" for k, unit in enumerate(units)]
    caption = (
        "Each numbered point is the direction that pointed up in a hold"
        + (": they should cover the sphere evenly, with a point near each faint marker" if by_hand else "")
        + "; drag to turn it."
    )
    label = "Directions that pointed up in the holds, on a sphere"
    flat = Figure(
        "poses",
        label,
        _rims() + _marks(_mapped, units, colours, words),
        Axis(
            "left: +z half, right: −z half; +x to the right, +y up", span=(-2.2, 2.2), bare=True, zero=False
        ),
        Axis(span=(-1.15, 1.15), bare=True, zero=False),
        420,
        square=True,
    )
    solid = _globe() + _marks(lambda points: points, units, colours, words)
    figure = Figure("poses", label, solid, Axis(), Axis(), 520, flat=flat)
    return section("Poses", Figures([figure], caption), Sentences(notes, "notes"))


def _numbers(units: Vectors) -> list[str]:
    """Return a label for each hold: all holds of one pose stand at the first of them."""
    labels = [""] * len(units)
    first = distinct_poses(units)
    nearest = np.argmax(units @ units[first].T, axis=1)
    for pose, hold in enumerate(first):
        numbers = [str(k + 1) for k in np.flatnonzero(nearest == pose)]
        rest = len(numbers) - _MOST_NUMBERS
        labels[hold] = ", ".join(numbers[:_MOST_NUMBERS]) + (f" +{rest}" if rest > 0 else "")
    return labels


def missing_directions(units: Vectors) -> Vectors:
    """Return those of the 26 standard directions that no hold is nearest to."""
    standard = twenty_six_directions()
    taken = np.argmax(units @ standard.T, axis=1)
    return standard[np.setdiff1d(np.arange(26), taken)]


def _marks(
    project: Callable[[Vectors], AnyArray], units: Vectors, colours: list[str], words: list[str]
) -> list[Mark]:
    """Return the standard attitudes and the holds, on the sphere or on the map."""
    standard, size = twenty_six_directions(), 1 if project is _mapped else 0
    grey: Look = {"symbol": "circle-open", "size": 9 + 2 * size, "colour": GREY, "opacity": 0.4 + 0.2 * size}
    hold: Look = {"size": 5 + size, "colour": colours, "above": True}
    known = [pose_words(d) for d in standard]
    return [
        Points(**_places(project(standard)), **grey, name="standard attitude", words=known),
        Points(**_places(project(units)), **hold, name="hold", labels=_numbers(units), words=words),
    ]


def _places(points: AnyArray) -> dict[str, Any]:
    return {name: plain(column, 4) for name, column in zip("xyz", points.T, strict=False)}


def _globe() -> list[Mark]:
    """Return three circles about the sphere, and the names of its axes."""
    circle = np.column_stack([_rim(), np.zeros(73)])
    gap = np.full((1, 3), np.nan)
    grid = np.vstack([circle, gap, circle[:, [0, 2, 1]], gap, circle[:, [2, 0, 1]]])
    faces = 1.25 * np.vstack([np.eye(3), -np.eye(3)])
    named = ["+x", "+y", "+z", "−x", "−y", "−z"]
    return [
        Points(**_places(faces), symbol="", labels=named, size=15, colour="", hover="", legend=False),
        Curve(**_places(grid), colour=GREY, opacity=0.35, hover="", legend=False),
    ]


def _rims() -> list[Mark]:
    """Return the edges of both half spheres of the equal-area map."""
    return [
        Curve(**_places(_rim() + np.array([side, 0.0])), colour=GREY, width=1, hover="", legend=False)
        for side in (-1.1, 1.1)
    ]


def _rim() -> AnyArray:
    angle = np.linspace(0.0, 2.0 * np.pi, 73)
    return np.column_stack([np.cos(angle), np.sin(angle)])


def _mapped(points: Vectors) -> AnyArray:
    """Return the equal-area (Lambert) projection of each half sphere, side by side."""
    upper = points[:, 2] >= -1e-12
    depth = np.abs(points[:, 2])
    return points[:, :2] / np.sqrt(1.0 + depth)[:, None] + np.where(upper, -1.1, 1.1)[:, None] * [1.0, 0.0]
