"""The poses on the sphere of directions, with the standard ones that are missing."""

from __future__ import annotations

from typing import Any

import numpy as np

from tumble.arrays import AnyArray, Vector, Vectors
from tumble.attitude.directions import twenty_six_directions
from tumble.calibration.poses import describe_direction, distinct_poses
from tumble.report.figures.plot import BLUE, GREY, RED, base_layout, hover, plain, scatter, text_axis
from tumble.report.page import Block, Figure, Figures, Plot, Sentences, section

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
    words = [hover(f"hold {k + 1}: {pose_words(unit)}") for k, unit in enumerate(units)]
    caption = (
        "Each numbered point is the direction that pointed up in a hold"
        + (": they should cover the sphere evenly, with a point near each faint marker" if by_hand else "")
        + "; drag to turn it."
    )
    label = "Directions that pointed up in the holds, on a sphere"
    drawn = _sphere(units, colours, words), _scene()
    figure = Figure("poses", label, *drawn, _map(units, colours, words))
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


def _sphere(units: Vectors, colours: list[str], words: list[str]) -> list[Plot]:
    standard = twenty_six_directions()
    angle = np.linspace(0.0, 2.0 * np.pi, 73)
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])
    gap = np.full((1, 3), np.nan)
    grid = np.vstack([circle, gap, circle[:, [0, 2, 1]], gap, circle[:, [2, 0, 1]]])
    faces = np.vstack([np.eye(3), -np.eye(3)])
    return [
        {
            **_points(1.25 * faces),
            "mode": "text",
            "text": ["+x", "+y", "+z", "−x", "−y", "−z"],
            "textfont": {"size": 15},
            "hoverinfo": "skip",
            "showlegend": False,
        },
        {
            **_points(grid),
            "mode": "lines",
            "line": {"color": GREY, "width": 2},
            "opacity": 0.35,
            "hoverinfo": "skip",
            "showlegend": False,
        },
        {
            **_points(standard),
            "mode": "markers",
            "name": "standard attitude",
            "marker": {"size": 9, "color": GREY, "opacity": 0.4, "symbol": "circle-open"},
            "hovertext": [pose_words(d) for d in standard],
            "hoverinfo": "text",
        },
        {
            **_points(units),
            "mode": "markers+text",
            "name": "hold",
            "text": _numbers(units),
            "textposition": "top center",
            "marker": {"size": 5, "color": colours},
            "hovertext": words,
            "hoverinfo": "text",
        },
    ]


def _points(points: Vectors) -> Plot:
    return {
        "type": "scatter3d",
        "x": plain(points[:, 0], 4),
        "y": plain(points[:, 1], 4),
        "z": plain(points[:, 2], 4),
    }


def _scene() -> Plot:
    hidden: Plot = {"visible": False, "range": [-1.3, 1.3], "showspikes": False}
    scene: Plot = {f"{name}axis": dict(hidden) for name in "xyz"}
    scene["aspectmode"] = "cube"
    # Off the diagonal, so that no standard attitude hides behind another.
    scene["camera"] = {"eye": {"x": 0.98, "y": 0.64, "z": 0.52}}
    return base_layout(520, scene=scene, margin={"l": 0, "r": 0, "t": 0, "b": 0}, dragmode="orbit")


def _map(units: Vectors, colours: list[str], words: list[str]) -> tuple[list[Plot], Plot]:
    """Return an equal-area map, both half spheres side by side, for where nothing turns."""
    standard = twenty_six_directions()
    angle = np.linspace(0.0, 2.0 * np.pi, 73)
    rim = np.column_stack([np.cos(angle), np.sin(angle)])
    grey: dict[str, Any] = {"size": 11, "color": GREY, "symbol": "circle-open"}
    data: list[Plot] = [
        _drawn(side + rim, mode="lines", line={"color": GREY, "width": 1}, hoverinfo="skip", showlegend=False)
        for side in (np.array([-1.1, 0.0]), np.array([1.1, 0.0]))
    ]
    data.append(
        _drawn(
            _mapped(standard),
            mode="markers",
            name="standard attitude",
            marker=grey,
            opacity=0.6,
            hovertext=[pose_words(d) for d in standard],
            hoverinfo="text",
        )
    )
    data.append(
        _drawn(
            _mapped(units),
            mode="markers+text",
            name="hold",
            text=_numbers(units),
            textposition="top center",
            marker={"size": 6, "color": colours},
            hovertext=words,
            hoverinfo="text",
        )
    )
    hidden = {"showticklabels": False, "showgrid": False, "zeroline": False}
    layout = base_layout(
        420,
        xaxis=text_axis("left: +z half, right: −z half; +x to the right, +y up", range=[-2.2, 2.2], **hidden),
        yaxis={**hidden, "scaleanchor": "x", "range": [-1.15, 1.15]},
    )
    return data, layout


def _mapped(points: Vectors) -> AnyArray:
    """Return the equal-area (Lambert) projection of each half sphere, side by side."""
    upper = points[:, 2] >= -1e-12
    depth = np.abs(points[:, 2])
    return points[:, :2] / np.sqrt(1.0 + depth)[:, None] + np.where(upper, -1.1, 1.1)[:, None] * [1.0, 0.0]


def _drawn(points: AnyArray, mode: str, **look: Any) -> Plot:
    return scatter(plain(points[:, 0], 4), plain(points[:, 1], 4), mode, **look)
