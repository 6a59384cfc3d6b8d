"""A small drawing of a unit in a pose: a box on a table, with its axes and which of its faces are up."""

from __future__ import annotations

import itertools
import math
from xml.etree.ElementTree import Element

import numpy as np

from tumble.arrays import Matrix, Vector
from tumble.report.figures.svg import add, as_text, drawing, path
from tumble.report.page import Plot

# Halves of the box' edges: all different, so that a pose is not taken for another.
HALVES = np.array([1.0, 0.72, 0.42])
_SIZE = 170
_COLOURS = ("#c02b3c", "#18794e", "#2563b8")
# Seen from a little above.
_ELEVATION = math.radians(24.0)


def draw_unit(up_b: Vector) -> str:
    """Return an SVG of the unit with `up_b` up, turned so that its labelled axes are seen best.

    Parameters
    ----------
    up_b : (3,) unit vector up.
    """
    C_vb = _best_view(up_b)
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * HALVES @ C_vb.T
    view = f"{-_SIZE // 2} {-_SIZE // 2} {_SIZE} {_SIZE}"
    svg = drawing(view, "the unit in this pose", font_family="sans-serif")
    # The table that it stands on.
    y = -40.0 * float(corners[:, 1].min()) + 1.0
    add(svg, "path", d=f"M-80 {y:.1f}H80", stroke="#8b919c", stroke_width=2, stroke_dasharray="6 3")
    faces = [(axis, sign) for axis in range(3) for sign in (-1.0, 1.0) if sign * C_vb[2, axis] > 1e-6]
    for axis in range(3):
        if (axis, 1.0) not in faces:
            _axis_behind(svg, C_vb, axis)
    for axis, sign in sorted(faces, key=lambda face: face[1] * float(C_vb[2, face[0]])):
        _face(svg, C_vb, axis, sign)
    arrow = "M-72 -38V-70M-77 -63L-72 -71L-67 -63"
    add(svg, "path", d=arrow, fill="none", stroke="#1d2129", stroke_width=2)
    add(svg, "text", "up", x=-72, y=-24, font_size=11, text_anchor="middle")
    return as_text(svg)


def _best_view(up_b: Vector) -> Matrix:
    """The rotation from b to right, up and towards the eye that shows most of the positive faces."""
    helper = np.eye(3)[int(np.argmin(np.abs(up_b)))]
    first = np.cross(up_b, helper)
    first /= np.linalg.norm(first)
    second = np.cross(up_b, first)
    best, chosen = -math.inf, np.eye(3)
    for turn in np.radians(np.arange(0.0, 360.0, 5.0)).tolist():
        towards = math.cos(turn) * first + math.sin(turn) * second
        eye = math.cos(_ELEVATION) * towards + math.sin(_ELEVATION) * up_b
        above = math.cos(_ELEVATION) * up_b - math.sin(_ELEVATION) * towards
        view = np.array([np.cross(above, eye), above, eye])
        # Three faces well seen, those of +x, +y, +z rather than the others.
        score = float(np.min(np.abs(eye))) * 2.0 + 0.5 * float(np.sum(np.maximum(eye, 0.0)))
        if score > best + 1e-9:
            best, chosen = score, view
    return np.asarray(chosen, dtype=np.float64)


def _spot(point: Vector) -> str:
    return f"{40.0 * float(point[0]):.1f} {-40.0 * float(point[1]):.1f}"


def _face(svg: Element, C_vb: Matrix, axis: int, sign: float) -> None:
    """One visible face with its name."""
    others = [other for other in range(3) if other != axis]
    corners = np.zeros((4, 3))
    corners[:, axis] = sign * HALVES[axis]
    for corner, (a, b) in zip(corners, ((-1, -1), (1, -1), (1, 1), (-1, 1)), strict=True):
        corner[others] = np.array([a, b]) * HALVES[others]
    # Brighter the more it looks up.
    grey = int(178 + 70 * (0.5 + 0.5 * sign * float(C_vb[1, axis])))
    shade = f"rgb({grey},{grey},{min(grey + 6, 255)})"
    path(
        svg, [_spot(corner) for corner in corners @ C_vb.T], fill=shade, stroke="#1d2129", stroke_width="1.2"
    )
    if abs(float(C_vb[2, axis])) <= 0.15:
        return
    x, y = (sign * HALVES[axis] * float(v) for v in C_vb[:2, axis])
    name = f"{'+' if sign > 0 else '−'}{'xyz'[axis]}"
    look: Plot = {"font_size": 15, "font_weight": 600, "text_anchor": "middle", "fill": _COLOURS[axis]}
    add(svg, "text", name, x=40.0 * x, y=-40.0 * y + 5.0, **look)


def _axis_behind(svg: Element, C_vb: Matrix, axis: int) -> None:
    """The positive axis out of a face that looks away, dashed."""
    colour, out = _COLOURS[axis], C_vb[:, axis]
    tail, tip = HALVES[axis] * out, (HALVES[axis] + 0.55) * out
    label = tip + 0.35 * (tip - tail)
    line: Plot = {"stroke": colour, "stroke_width": 2, "fill": "none", "stroke_dasharray": "4 3"}
    add(svg, "path", d=f"M{_spot(tail)}L{_spot(tip)}", **line)
    add(svg, "circle", cx=40.0 * float(tip[0]), cy=-40.0 * float(tip[1]), r=2.6, fill=colour)
    look: Plot = {"font_size": 12, "text_anchor": "middle", "fill": colour}
    name, x, y = f"+{'xyz'[axis]}", 40.0 * float(label[0]), -40.0 * float(label[1]) + 4.0
    add(svg, "text", name, x=x, y=y, **look)
