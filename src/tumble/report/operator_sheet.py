"""A planned test on paper: the sheet for the operator, with drawings of its poses.

Of a table's rotations: about which axis of the unit, which way, how far, and lines for what the display shows.

A small drawing of a unit in a pose: a box on a table, with its axes and which of its faces are up.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from tumble.arrays import AnyArray, Matrix, Vector
from tumble.files import templates
from tumble.protocol import HoldStep, Protocol, SpinStep
from tumble.report.html import render_page
from tumble.report.page import Blanks, Card, Cards, Page, Sentences

# Halves of the box' edges: all different, so that a pose is not taken for another.
HALVES = np.array([1.0, 0.72, 0.42])
# Of a length of one.
_PIXELS = 40.0
_COLOURS = ("#c02b3c", "#18794e", "#2563b8")
# Seen from a little above.
_ELEVATION = math.radians(24.0)


def draw_unit(up_b: Vector) -> str:
    """Return an SVG of the unit with `up_b` up, turned so that its labelled axes are seen best.

    Parameters
    ----------
    up_b : (3,) unit vector in the unit's axes.
    """
    C_vb = _best_view(up_b)
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * HALVES @ C_vb.T
    faces = [(axis, sign) for axis in range(3) for sign in (-1.0, 1.0) if sign * C_vb[2, axis] > 1e-6]
    faces.sort(key=lambda face: face[1] * float(C_vb[2, face[0]]))
    return (
        templates()
        .get_template("unit.svg")
        .render(
            # The table that it stands on.
            floor=-_PIXELS * float(corners[:, 1].min()) + 1.0,
            behind=[_axis_behind(C_vb, axis) for axis in range(3) if (axis, 1.0) not in faces],
            faces=[_face(C_vb, *face) for face in faces],
        )
    )


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


def _spots(points: AnyArray) -> Any:
    """Pixels to the right and down of places to the right, up and towards the eye."""
    return (points[..., :2] * [_PIXELS, -_PIXELS]).tolist()


def _face(C_vb: Matrix, axis: int, sign: float) -> dict[str, Any]:
    """One visible face with its name."""
    others = [other for other in range(3) if other != axis]
    corners = np.zeros((4, 3))
    corners[:, axis] = sign * HALVES[axis]
    corners[:, others] = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * HALVES[others]
    # Brighter the more it looks up.
    grey = int(178 + 70 * (0.5 + 0.5 * sign * float(C_vb[1, axis])))
    return {
        "corners": _spots(corners @ C_vb.T),
        "shade": f"rgb({grey},{grey},{min(grey + 6, 255)})",
        "seen": abs(float(C_vb[2, axis])) > 0.15,
        "name": f"{'+' if sign > 0 else '−'}{'xyz'[axis]}",
        "middle": _spots(sign * HALVES[axis] * C_vb[:, axis]),
        "colour": _COLOURS[axis],
    }


def _axis_behind(C_vb: Matrix, axis: int) -> dict[str, Any]:
    """The positive axis out of a face that looks away."""
    tail, tip, label = (_spots((HALVES[axis] + beyond) * C_vb[:, axis]) for beyond in (0.0, 0.55, 0.7425))
    return {"tail": tail, "tip": tip, "label": label, "name": f"+{'xyz'[axis]}", "colour": _COLOURS[axis]}


_FORM = (("Unit", "Date", "Operator"), ("File", "Temperature", "Place"))
_READ_ANGLES = (
    "Before and after each rotation, with the table at rest, read its display and write down every "
    "digit. The difference goes into the protocol as angle_deg, with the sign of the way it turned "
    "and with whole turns counted. If the table does not stop where it should, write down where it "
    "did: nothing is lost."
)
_BELIEVE_RATES = "The rates count as the protocol has them: write down any other."


def render_sheet(protocol: Protocol, title: str) -> str:
    """Return the sheet as one HTML page that prints on A4 and needs nothing else.

    Parameters
    ----------
    protocol : holds, turns and a table's rotations.
    title : what the poses are, in words.
    """
    steps = [step for step in protocol.steps if isinstance(step, HoldStep | SpinStep)]
    spins = [step for step in steps if isinstance(step, SpinStep)]
    words = _table_words(protocol, title, spins) if spins else _pose_words(protocol, title)
    cards = [_card(step) if isinstance(step, HoldStep) else _spin_card(step) for step in steps]
    return render_page(Page(protocol.name, [Sentences([words], "paragraphs"), Blanks(_FORM), Cards(cards)]))


def _pose_words(protocol: Protocol, title: str) -> str:
    turns = [step.duration for step in protocol.steps if not isinstance(step, HoldStep)]
    between = f", about {np.median(turns):.0f} s to turn to the next" if turns else ""
    return (
        f"{len(protocol.steps) - len(turns)} poses ({title}){between}; {protocol.duration / 60.0:.1f} min in all. Keep "
        "the order. In each pose the unit rests untouched; a few degrees off do not matter, movement does."
    )


def _table_words(protocol: Protocol, title: str, spins: list[SpinStep]) -> str:
    rests = sum(isinstance(step, HoldStep) for step in protocol.steps)
    return (
        f"{title} {rests} rests and {len(spins)} rotations of the table; "
        f"{protocol.duration / 60.0:.0f} min in all. Keep the order. At rest nobody touches unit or "
        "table. `Counter-clockwise` is as seen by someone whom the named axis of the unit points at. "
        "The unit stays as it is mounted from the rest before a rotation to the rest after it. "
        + (_READ_ANGLES if any(step.angle is not None for step in spins) else _BELIEVE_RATES)
    )


def _card(step: HoldStep) -> Card:
    lines = [f"`{step.duration:.0f} s` at rest"]
    if step.pose is None:
        return Card(step.name or "rest", lines)
    up_b = step.pose.up_b
    return Card(step.name or "rest", lines, svg=draw_unit(up_b), note=_elevations(up_b))


def _spin_card(step: SpinStep) -> Card:
    way, arrow = ("counter-clockwise", "↺") if step.rate > 0.0 else ("clockwise", "↻")
    seconds = step.duration + 2.0 * step.ramp
    angle = step.rate * (step.duration + step.ramp) if step.angle is None else step.angle
    degrees = abs(math.degrees(angle))
    turns = f"{degrees / 360.0:.4g} turns ({degrees:.6g}°)" if degrees >= 360.0 else f"{degrees:.6g}°"
    axis = "the vertical" if step.axis_b is None else f"`{_axis_words(step.axis_b)}` of the unit"
    lines = [
        f"about {axis}",
        f"`{way}`, {turns} at {abs(math.degrees(step.rate)):.4g}°/s: about {seconds:.0f} s",
    ]
    read = [("display before", "°"), ("display after", "°")]
    blanks = [("rate, if another", "°/s")] if step.angle is None else read
    return Card("turn the table", lines, arrow=arrow, blanks=blanks)


def _axis_words(axis_b: Vector) -> str:
    """The axis as an operator finds it on the unit."""
    axis = axis_b / float(np.linalg.norm(axis_b))
    parts = [
        f"{'+' if value > 0.0 else '−'}{name}"
        for value, name in zip(axis.tolist(), "xyz", strict=True)
        if abs(value) > 0.02
    ]
    strong = np.abs(axis[np.abs(axis) > 0.02])
    if len(parts) == 1:
        return parts[0]
    if float(np.ptp(strong)) < 0.02:
        return ("halfway between " if len(parts) == 2 else "the diagonal of ") + " and ".join(parts)
    return "(" + ", ".join(f"{value:.3f}" for value in axis.tolist()) + ")"


def _elevations(up_b: Vector) -> str:
    """How far each axis points above the horizon."""
    if float(np.max(np.abs(up_b))) > math.cos(math.radians(0.5)):
        return "other axes level"
    angles = np.degrees(np.arcsin(np.clip(up_b, -1.0, 1.0))).tolist()
    parts = [
        f"{axis} {angle + 0.0:+.0f}°" if abs(angle) > 0.5 else f"{axis} level"
        for axis, angle in zip("xyz", angles, strict=True)
    ]
    return f"above level: {', '.join(parts)}"
