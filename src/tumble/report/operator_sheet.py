"""A sheet for the operator, to be printed: each pose as a drawing, how long it rests, and a box to tick.

Of a table's rotations: about which axis of the unit, which way, how far, and lines for what the display shows.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from tumble.report.figures.unit_drawing import draw_unit
from tumble.report.html import render_page
from tumble.report.page import Blanks, Card, Cards, Page, Sentences

if TYPE_CHECKING:
    from tumble.arrays import Vector
    from tumble.protocol import HoldStep, Protocol, SpinStep

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
    from tumble.protocol import HoldStep, SpinStep

    steps = [step for step in protocol.steps if isinstance(step, HoldStep | SpinStep)]
    spins = [step for step in steps if isinstance(step, SpinStep)]
    words = _table_words(protocol, title, spins) if spins else _pose_words(protocol, title)
    cards = [_card(step) if isinstance(step, HoldStep) else _spin_card(step) for step in steps]
    return render_page(Page(protocol.name, [Sentences([words], "paragraphs"), Blanks(_FORM), Cards(cards)]))


def _pose_words(protocol: Protocol, title: str) -> str:
    from tumble.protocol import HoldStep

    turns = [step.duration for step in protocol.steps if not isinstance(step, HoldStep)]
    between = f", about {np.median(turns):.0f} s to turn to the next" if turns else ""
    return (
        f"{len(protocol.steps) - len(turns)} poses ({title}){between}; {protocol.duration / 60.0:.1f} min in all. Keep "
        "the order. In each pose the unit rests untouched; a few degrees off do not matter, movement does."
    )


def _table_words(protocol: Protocol, title: str, spins: list[SpinStep]) -> str:
    from tumble.protocol import HoldStep

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
