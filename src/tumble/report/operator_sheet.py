"""A sheet for the operator, to be printed: each pose as a drawing, how long it rests, and a box to tick."""

from __future__ import annotations

import html
import math
import re
from typing import TYPE_CHECKING

import numpy as np

from tumble.report.unit_drawing import draw_unit

if TYPE_CHECKING:
    from tumble.arrays import Vector
    from tumble.protocol import Protocol

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
.pose .soft { color: #444; font-size: 9pt; }
@page { margin: 10mm; }
@media print { main { padding: 0; max-width: none; } }
"""


def render_sheet(protocol: Protocol, title: str) -> str:
    """Return the sheet as one HTML page that prints on A4 and needs nothing else.

    Parameters
    ----------
    protocol : holds and turns.
    title : what the poses are, in words.
    """
    from tumble.protocol import HoldStep

    holds = [step for step in protocol.steps if isinstance(step, HoldStep)]
    turns = [step.duration for step in protocol.steps if not isinstance(step, HoldStep)]
    between = f", about {np.median(turns):.0f} s to turn to the next" if turns else ""
    cards = "".join(_card(number, step) for number, step in enumerate(holds, 1))
    name, minutes = html.escape(protocol.name), protocol.duration / 60.0
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n"
        f"<title>{name}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n<main>\n"
        f"<h1>{name}</h1>"
        f"<p>{len(holds)} poses ({html.escape(title)}){between}; {minutes:.1f} min in all. Keep the order. In each "
        "pose the unit rests untouched; a few degrees off do not matter, movement does.</p>"
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
