"""Maps of the sphere as plain SVG: how uncertain a calibrated specific force is in every direction, and the poses."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence

import numpy as np

from tumble.arrays import Series, Square, Vector, Vectors

# Light to dark in even steps of lightness: a grey copy reads the same.
SHADES = ("#f4f8fb", "#d8e6f1", "#b9d2e6", "#93b9d8", "#6a9cc6", "#437db0", "#275e93", "#123f6e")
_RINGS, _TURNS = 20, 90
_RADIUS = 112.0
_WIDTH, _HEIGHT = 520, 262
# From this side all faces are off the rim, and all edges: nothing is drawn twice.
_FRONT = np.array([0.80, 0.50, 0.33])
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
    parts = [
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" '
            f'aria-label="{html.escape(label)}" font-family="sans-serif">'
        )
    ]
    for towards, middle in ((_FRONT, 130.0), (-_FRONT, 390.0)):
        half = _Half(towards, middle, 131.0)
        parts += half.cells(covariance, top)
        parts += half.axes()
        parts += half.points(directions, labels)
    parts.append("</svg>")
    return "".join(parts)


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

    def cells(self, covariance: Square, top: float) -> list[str]:
        """Return the shades, in each ring one piece for each stretch of one shade."""
        drawn: list[str] = []
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
                    drawn.append(self._piece(inner, outer, start, end, SHADES[int(shades[start])]))
                    start = end
        return drawn

    def _piece(self, inner: float, outer: float, start: int, end: int, shade: str) -> str:
        first, last = (2.0 * math.pi * edge / _TURNS for edge in (start, end))

        def spot(radius: float, turn: float) -> str:
            place = _RADIUS * radius
            return f"{self.x + place * math.cos(turn):.1f} {self.y - place * math.sin(turn):.1f}"

        far, near = _RADIUS * outer, _RADIUS * inner
        return (
            f'<path d="M{spot(outer, first)}A{far:.1f} {far:.1f} 0 0 0 {spot(outer, last)}L{spot(inner, last)}'
            f'A{near:.1f} {near:.1f} 0 0 1 {spot(inner, first)}Z" fill="{shade}" stroke="{shade}" stroke-width="0.6"/>'
        )

    def axes(self) -> list[str]:
        """Return the rim and the names of the axes on this half."""
        drawn = [
            f'<circle cx="{self.x}" cy="{self.y}" r="{_RADIUS}" fill="none" stroke="#8b919c" stroke-width="1"/>'
        ]
        for number, name in enumerate(_AXES):
            up = np.zeros(3)
            up[number // 2] = -1.0 if number % 2 else 1.0
            place = self.at(up)
            if place is not None:
                drawn.append(
                    f'<text x="{place[0]:.1f}" y="{place[1] + 18:.1f}" font-size="11" text-anchor="middle" '
                    f'fill="#c02b3c" stroke="#fff" stroke-width="2.5" paint-order="stroke">{name}</text>'
                )
        return drawn

    def points(self, directions: Vectors, labels: Sequence[str]) -> list[str]:
        """Return the poses; those in one place have their numbers together."""
        groups: list[tuple[Vector, list[str]]] = []
        for up, number in zip(directions, labels, strict=True):
            for place, members in groups:
                if float(place @ up) > math.cos(0.03):
                    members.append(number)
                    break
            else:
                groups.append((up, [number]))
        drawn: list[str] = []
        for up, members in groups:
            place = self.at(up)
            if place is None:
                continue
            x, y = place
            text = ", ".join(members[:3]) + (" …" if len(members) > 3 else "")
            drawn.append(
                f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="#dd8a21" stroke="#fff" stroke-width="1.2"/>'
                f'<text x="{x:.1f}" y="{y - 6:.1f}" font-size="10" font-weight="600" text-anchor="middle" '
                f'fill="#1d2129" stroke="#fff" stroke-width="2.5" paint-order="stroke">{html.escape(text)}</text>'
            )
        return drawn


def draw_scale(top: float, unit: str) -> str:
    """Return the legend of the shades as SVG.

    Parameters
    ----------
    top : of the darkest shade, in `unit`.
    unit : as shown.
    """
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} 44" role="img" aria-label="scale">'
    ]
    width = 44.0
    left = 0.5 * (_WIDTH - width * len(SHADES))
    for number, shade in enumerate(SHADES):
        parts.append(f'<rect x="{left + number * width}" y="2" width="{width}" height="14" fill="{shade}"/>')
    for number in range(0, len(SHADES) + 1, 2):
        text = f"{top * number / len(SHADES):.3g}" + (f" {unit}" if number == len(SHADES) else "")
        parts.append(
            f'<text x="{left + number * width:.0f}" y="32" font-size="11" text-anchor="middle" '
            f'font-family="sans-serif" fill="currentColor">{text}</text>'
        )
    parts.append("</svg>")
    return "".join(parts)
