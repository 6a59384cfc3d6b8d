"""A small drawing of a unit in a pose: a box on a table, with its axes and which of its faces are up."""

from __future__ import annotations

import itertools
import math

import numpy as np

from tumble.arrays import Matrix, Vector, Vectors

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
    lowest = float(corners[:, 1].min())
    parts = [
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{-_SIZE // 2} {-_SIZE // 2} {_SIZE} {_SIZE}" role="img" '
            'aria-label="the unit in this pose" font-family="sans-serif">'
        ),
        _table(lowest),
    ]
    faces = [(axis, sign) for axis in range(3) for sign in (-1.0, 1.0) if sign * C_vb[2, axis] > 1e-6]
    parts += [_axis_behind(C_vb, axis) for axis in range(3) if (axis, 1.0) not in faces]
    for axis, sign in sorted(faces, key=lambda face: face[1] * float(C_vb[2, face[0]])):
        parts.append(_face(C_vb, axis, sign))
    parts.append(
        '<path d="M-72 -38V-70M-77 -63L-72 -71L-67 -63" fill="none" stroke="#1d2129" stroke-width="2"/>'
        '<text x="-72" y="-24" font-size="11" text-anchor="middle">up</text></svg>'
    )
    return "".join(parts)


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


def _polygon(points: Vectors, look: str) -> str:
    return f'<path d="M{"L".join(_spot(point) for point in points)}Z" {look}/>'


def _table(lowest: float) -> str:
    y = -40.0 * lowest + 1.0
    return f'<path d="M-80 {y:.1f}H80" stroke="#8b919c" stroke-width="2" stroke-dasharray="6 3"/>'


def _face(C_vb: Matrix, axis: int, sign: float) -> str:
    """One visible face with its name."""
    others = [other for other in range(3) if other != axis]
    corners = np.zeros((4, 3))
    corners[:, axis] = sign * HALVES[axis]
    for corner, (a, b) in zip(corners, ((-1, -1), (1, -1), (1, 1), (-1, 1)), strict=True):
        corner[others] = np.array([a, b]) * HALVES[others]
    middle = np.zeros(3)
    middle[axis] = sign * HALVES[axis]
    # Brighter the more it looks up.
    bright = 0.5 + 0.5 * sign * float(C_vb[1, axis])
    grey = int(178 + 70 * bright)
    x, y = (float(v) for v in (C_vb @ middle)[:2])
    name = f"{'+' if sign > 0 else '−'}{'xyz'[axis]}"
    seen = abs(float(C_vb[2, axis]))
    text = (
        f'<text x="{40 * x:.1f}" y="{-40 * y + 5:.1f}" font-size="15" font-weight="600" text-anchor="middle" '
        f'fill="{_COLOURS[axis]}">{name}</text>'
        if seen > 0.15
        else ""
    )
    return (
        _polygon(
            corners @ C_vb.T,
            f'fill="rgb({grey},{grey},{min(grey + 6, 255)})" stroke="#1d2129" stroke-width="1.2"',
        )
        + text
    )


def _axis_behind(C_vb: Matrix, axis: int) -> str:
    """The positive axis out of a face that looks away, dashed."""
    start, end = np.zeros(3), np.zeros(3)
    start[axis], end[axis] = HALVES[axis], HALVES[axis] + 0.55
    tip, tail, label = C_vb @ end, C_vb @ start, C_vb @ (end + 0.35 * (end - start))
    return (
        f'<path d="M{_spot(tail)}L{_spot(tip)}" stroke="{_COLOURS[axis]}" stroke-width="2" fill="none" '
        f'stroke-dasharray="4 3"/><circle cx="{40 * float(tip[0]):.1f}" cy="{-40 * float(tip[1]):.1f}" r="2.6" '
        f'fill="{_COLOURS[axis]}"/><text x="{40 * float(label[0]):.1f}" y="{-40 * float(label[1]) + 4:.1f}" '
        f'font-size="12" text-anchor="middle" fill="{_COLOURS[axis]}">+{"xyz"[axis]}</text>'
    )
