"""A sheet for the operator, to be printed: each pose as a drawing, how long it rests, and a box to tick.

Of a table's rotations: about which axis of the unit, which way, how far, and lines for what the display shows.
"""

from __future__ import annotations

import html
import math
import re
from typing import TYPE_CHECKING

import numpy as np

from tumble.report.unit_drawing import draw_unit

if TYPE_CHECKING:
    from tumble.arrays import Vector
    from tumble.protocol import Protocol, SpinStep

_STYLE = """
body { margin: 0; font: 11pt/1.35 "Helvetica Neue", Arial, sans-serif; color: #000; background: #fff; }
main { max-width: 190mm; margin: 0 auto; padding: 8mm 5mm; }
h1 { font-size: 16pt; margin: 0 0 2mm; }
p { margin: 1mm 0; }
.line { display: inline-block; border-bottom: 1px solid #000; min-width: 38mm; }
.poses { display: grid; grid-template-columns: repeat(3, 1fr); gap: 3mm; margin-top: 4mm; }
.pose { border: 1px solid #888; border-radius: 2mm; padding: 2mm 3mm; break-inside: avoid; position: relative; }
.pose svg { display: block; width: 100%; height: 36mm; }
.pose b { font-size: 12pt; }
.pose .name { padding-right: 8mm; min-height: 2.7em; }
.pose .box { position: absolute; top: 2.5mm; right: 3mm; width: 6mm; height: 6mm; border: 1.6px solid #000; }
.pose .short { display: inline-block; border-bottom: 1px solid #000; min-width: 24mm; height: 6mm; }
.turn { background: #f3f3f3; }
.turn .arrow { font-size: 34pt; line-height: 1; text-align: center; }
.pose .soft { color: #444; font-size: 9pt; }
@page { margin: 10mm; }
@media print { main { padding: 0; max-width: none; } }
"""


def render_sheet(protocol: Protocol, title: str) -> str:
    """Return the sheet as one HTML page that prints on A4 and needs nothing else.

    Parameters
    ----------
    protocol : holds, turns and a table's rotations.
    title : what the poses are, in words.
    """
    from tumble.protocol import HoldStep, SpinStep

    if any(isinstance(step, SpinStep) for step in protocol.steps):
        return _table_sheet(protocol, title)
    holds = [step for step in protocol.steps if isinstance(step, HoldStep)]
    turns = [step.duration for step in protocol.steps if not isinstance(step, HoldStep)]
    between = f", about {np.median(turns):.0f} s to turn to the next" if turns else ""
    cards = "".join(_card(number, step) for number, step in enumerate(holds, 1))
    return _sheet(
        protocol,
        f"{len(holds)} poses ({html.escape(title)}){between}; {protocol.duration / 60.0:.1f} min in all. Keep the "
        "order. In each pose the unit rests untouched; a few degrees off do not matter, movement does.",
        cards,
    )


def _table_sheet(protocol: Protocol, title: str) -> str:
    from tumble.protocol import HoldStep, SpinStep

    steps = [step for step in protocol.steps if isinstance(step, HoldStep | SpinStep)]
    spins = [step for step in steps if isinstance(step, SpinStep)]
    read = any(step.angle is not None for step in spins)
    wanted = (
        " Before and after each rotation, with the table at rest, read its display and write down every digit: the "
        "difference, with the sign of the way it turned and whole turns counted, goes into the protocol as angle_deg. "
        "If the table does not stop where it should, write down where it did; nothing is lost."
        if read
        else " The rates count as the protocol has them: write down any other."
    )
    cards = "".join(
        _card(number, step) if isinstance(step, HoldStep) else _spin_card(number, step)
        for number, step in enumerate(steps, 1)
    )
    return _sheet(
        protocol,
        f"{html.escape(title)} {len(steps) - len(spins)} rests and {len(spins)} rotations of the table; "
        f"{protocol.duration / 60.0:.0f} min in all. Keep the order. At rest nobody touches unit or table. "
        "<b>Counter-clockwise</b> is as seen by someone whom the named axis of the unit points at; the unit stays "
        f"as it is mounted from the rest before a rotation to the rest after it.{wanted}",
        cards,
    )


def _sheet(protocol: Protocol, words: str, cards: str) -> str:
    name = html.escape(protocol.name)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n"
        f"<title>{name}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n<main>\n"
        f"<h1>{name}</h1>"
        f"<p>{words}</p>"
        '<p>Unit <span class="line"></span> Date <span class="line"></span> Operator <span class="line"></span></p>'
        '<p>File <span class="line"></span> Temperature <span class="line"></span> Place <span class="line"></span></p>'
        f'<div class="poses">{cards}</div>\n</main>\n</body>\n</html>\n'
    )


def signed_text(value: str) -> str:
    """Return text escaped, with the typographic minus before numbers and axes, and hyphens left alone.

    Parameters
    ----------
    value : plain text.
    """
    return re.sub(r"(?<!\w)-(?=[\dxyz])", "−", html.escape(value, quote=True))


def _card(number: int, step: object) -> str:
    from tumble.protocol import HoldStep

    assert isinstance(step, HoldStep)
    words = step.name or "rest"
    drawing = "" if step.pose is None else draw_unit(step.pose.up_b)
    tilt = "" if step.pose is None else f'<div class="soft">{_elevations(step.pose.up_b)}</div>'
    return (
        f'<div class="pose"><span class="box"></span><div class="name"><b>{number}.</b> {signed_text(words)}</div>'
        f"{drawing}<div><b>{step.duration:.0f} s</b> at rest</div>{tilt}</div>"
    )


def _spin_card(number: int, step: SpinStep) -> str:
    way = "counter-clockwise" if step.rate > 0.0 else "clockwise"
    arrow = "↺" if step.rate > 0.0 else "↻"
    seconds = step.duration + 2.0 * step.ramp
    angle = step.rate * (step.duration + step.ramp) if step.angle is None else step.angle
    degrees = abs(math.degrees(angle))
    turns = f"{degrees / 360.0:.4g} turns ({degrees:.6g}°)" if degrees >= 360.0 else f"{degrees:.6g}°"
    axis = "the vertical" if step.axis_b is None else f"<b>{_axis_words(step.axis_b)}</b> of the unit"
    lines = (
        '<div>display before <span class="short"></span>°</div><div>display after <span class="short"></span>°</div>'
        if step.angle is not None
        else '<div>rate, if another <span class="short"></span>°/s</div>'
    )
    return (
        f'<div class="pose turn"><span class="box"></span><div class="name"><b>{number}.</b> turn the table</div>'
        f'<div class="arrow">{arrow}</div><div>about {axis}<br><b>{way}</b>, {turns} at '
        f"{abs(math.degrees(step.rate)):.4g}°/s: about {seconds:.0f} s</div>{lines}</div>"
    )


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
    return "(" + ", ".join(f"{value:.3f}".replace("-", "−") for value in axis.tolist()) + ")"


def _elevations(up_b: Vector) -> str:
    """How far each axis points above the horizon."""
    angles = np.degrees(np.arcsin(np.clip(up_b, -1.0, 1.0))).tolist()
    parts = [
        f"{axis} {angle + 0.0:+.0f}°" if abs(angle) > 0.5 else f"{axis} level"
        for axis, angle in zip("xyz", angles, strict=True)
    ]
    return "above level: " + ", ".join(parts).replace("-", "−") if not _is_face(up_b) else "other axes level"


def _is_face(up_b: Vector) -> bool:
    return float(np.max(np.abs(up_b))) > math.cos(math.radians(0.5))
