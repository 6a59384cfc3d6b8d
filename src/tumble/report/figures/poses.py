"""The poses on the sphere of directions, with the standard ones that are missing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tumble.arrays import AnyArray, Vector, Vectors
from tumble.attitude.directions import twenty_six_directions
from tumble.calibration.poses import describe_direction, distinct_poses
from tumble.report.figures.record import BLUE, GREY, RED, Axis, Curve, Figure, Look, Mark, Points, plain
from tumble.report.page import Block, Figures, Sentences, section

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
    missing = missing_directions(units)
    notes = [
        (
            f"{len(units)} holds in {len(distinct_poses(units))} poses that differ by more than 10°; "
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


def pose_words(up: Vector) -> str:
    """Return what points up in words, with minus signs at which no line breaks."""
    return describe_direction(up).replace("-", "−")


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
