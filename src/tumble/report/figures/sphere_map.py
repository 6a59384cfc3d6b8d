"""Maps of the sphere as plain SVG: how uncertain a calibrated specific force is in every direction, and the poses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.etree.ElementTree import Element

import numpy as np

from tumble.arrays import Series, Square, Vector, Vectors
from tumble.report.figures.svg import add, as_text, drawing

# Light to dark in even steps of lightness: a grey copy reads the same.
SHADES = ("#f4f8fb", "#d8e6f1", "#b9d2e6", "#93b9d8", "#6a9cc6", "#437db0", "#275e93", "#123f6e")
_RINGS, _TURNS = 20, 90
_RADIUS = 112.0
_WIDTH, _HEIGHT = 520, 262
# From this side all faces are off the rim, and all edges: nothing is drawn twice.
_FRONT = np.array([0.80, 0.50, 0.33])
# Text that is read on dark and on light.
_ON_SHADES = {"text_anchor": "middle", "stroke": "#fff", "stroke_width": 2.5, "paint_order": "stroke"}
_AXES = ("+x", "−x", "+y", "−y", "+z", "−z")


def force_sigmas(covariance: Square, directions: Vectors) -> Series:
    """Return the root mean square error of the corrected specific force in poses, over gravity.

    Parameters
    ----------
    covariance : (9, 9) over `tumble.design.candidates.PARAMETERS`.
    directions : (n, 3) unit vectors up.
    """
    x, y, z = directions.T
    nought, one = np.zeros_like(x), np.ones_like(x)
    # The frame accelerometer-x: x sees itself alone, y is off by yz, z by zy and zx.
    rows = np.array(
        [
            [x, nought, nought, nought, nought, nought, one, nought, nought],
            [nought, y, nought, x, nought, nought, nought, one, nought],
            [nought, nought, z, nought, -x, y, nought, nought, one],
        ]
    )
    squares = np.einsum("apn,pq,aqn->n", rows, covariance, rows)
    return np.sqrt(np.maximum(np.asarray(squares, dtype=np.float64), 0.0))


def draw_sphere_map(
    covariance: Square, directions: Vectors, labels: Sequence[str], *, top: float, label: str
) -> str:
    """Return an SVG of both half spheres: shades of uncertainty up to `top`, and the poses by number.

    Parameters
    ----------
    covariance : (9, 9) of what a test leaves unknown.
    directions : (n, 3) unit vectors up of its poses.
    labels : a number for each.
    top : of the darkest shade, over gravity.
    label : what the drawing shows, for a screen reader.
    """
    svg = drawing(f"0 0 {_WIDTH} {_HEIGHT}", label, font_family="sans-serif")
    for towards, middle in ((_FRONT, 130.0), (-_FRONT, 390.0)):
        half = _Half(towards, middle, 131.0)
        half.add_cells(svg, covariance, top)
        half.add_axes(svg)
        half.add_points(svg, directions, labels)
    return as_text(svg)


class _Half:
    """Half of the sphere seen from outside, in Lambert's equal-area projection."""

    def __init__(self, towards: Vector, x: float, y: float) -> None:
        self.towards = towards / np.linalg.norm(towards)
        self.right = np.cross([0.0, 0.0, 1.0], self.towards)
        self.right = self.right / np.linalg.norm(self.right)
        self.above = np.cross(self.towards, self.right)
        self.x, self.y = x, y

    def at(self, up: Vector) -> tuple[float, float] | None:
        """Return where a direction is drawn; None on the other half."""
        towards = float(up @ self.towards)
        if towards < -1e-9:
            return None
        reach = _RADIUS / math.sqrt(1.0 + towards)
        return self.x + reach * float(up @ self.right), self.y - reach * float(up @ self.above)

    def add_cells(self, svg: Element, covariance: Square, top: float) -> None:
        """Add the shades, in each ring one piece for each stretch of one shade."""
        edges = np.linspace(0.0, 1.0, _RINGS + 1)
        turns = (np.arange(_TURNS) + 0.5) * 2.0 * np.pi / _TURNS
        for inner, outer in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            off = 2.0 * math.asin(0.5 * (inner + outer) / math.sqrt(2.0))
            flat = np.cos(turns)[:, None] * self.right + np.sin(turns)[:, None] * self.above
            values = force_sigmas(covariance, math.cos(off) * self.towards + math.sin(off) * flat)
            shades = np.minimum((values / top * len(SHADES)).astype(int), len(SHADES) - 1)
            start = 0
            for end in range(1, _TURNS + 1):
                if end == _TURNS or shades[end] != shades[start] or end - start > _TURNS // 4:
                    shade = SHADES[int(shades[start])]
                    piece = self._piece(inner, outer, start, end)
                    add(svg, "path", d=piece, fill=shade, stroke=shade, stroke_width=0.6)
                    start = end

    def _piece(self, inner: float, outer: float, start: int, end: int) -> str:
        first, last = (2.0 * math.pi * edge / _TURNS for edge in (start, end))

        def spot(radius: float, turn: float) -> str:
            place = _RADIUS * radius
            return f"{self.x + place * math.cos(turn):.1f} {self.y - place * math.sin(turn):.1f}"

        far, near = _RADIUS * outer, _RADIUS * inner
        return (
            f"M{spot(outer, first)}A{far:.1f} {far:.1f} 0 0 0 {spot(outer, last)}L{spot(inner, last)}"
            f"A{near:.1f} {near:.1f} 0 0 1 {spot(inner, first)}Z"
        )

    def add_axes(self, svg: Element) -> None:
        """Add the rim and the names of the axes on this half."""
        add(svg, "circle", cx=self.x, cy=self.y, r=_RADIUS, fill="none", stroke="#8b919c", stroke_width=1)
        for number, name in enumerate(_AXES):
            up = np.zeros(3)
            up[number // 2] = -1.0 if number % 2 else 1.0
            place = self.at(up)
            if place is not None:
                look = {"font_size": 11, "fill": "#c02b3c", **_ON_SHADES}
                add(svg, "text", name, x=place[0], y=place[1] + 18.0, **look)

    def add_points(self, svg: Element, directions: Vectors, labels: Sequence[str]) -> None:
        """Add the poses; those in one place have their numbers together."""
        groups: list[tuple[Vector, list[str]]] = []
        for up, number in zip(directions, labels, strict=True):
            for place, members in groups:
                if float(place @ up) > math.cos(0.03):
                    members.append(number)
                    break
            else:
                groups.append((up, [number]))
        for up, members in groups:
            place = self.at(up)
            if place is None:
                continue
            x, y = place
            words = ", ".join(members[:3]) + (" …" if len(members) > 3 else "")
            look = {"font_size": 10, "font_weight": 600, "fill": "#1d2129", **_ON_SHADES}
            add(svg, "circle", cx=x, cy=y, r=4, fill="#dd8a21", stroke="#fff", stroke_width=1.2)
            add(svg, "text", words, x=x, y=y - 6.0, **look)


def draw_scale(top: float, unit: str) -> str:
    """Return the legend of the shades as SVG.

    Parameters
    ----------
    top : of the darkest shade, in `unit`.
    unit : as shown.
    """
    svg = drawing(f"0 0 {_WIDTH} 44", "scale", font_family="sans-serif")
    width = 44.0
    left = 0.5 * (_WIDTH - width * len(SHADES))
    for number, shade in enumerate(SHADES):
        add(svg, "rect", x=left + number * width, y=2, width=width, height=14, fill=shade)
    for number in range(0, len(SHADES) + 1, 2):
        words = f"{top * number / len(SHADES):.3g}" + (f" {unit}" if number == len(SHADES) else "")
        look = {"font_size": 11, "text_anchor": "middle", "fill": "currentColor"}
        add(svg, "text", words, x=left + number * width, y=32, **look)
    return as_text(svg)
