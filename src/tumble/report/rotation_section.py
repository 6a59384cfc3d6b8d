"""What a table's rotations showed: the axes as both triads saw them, and the angles."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

import numpy as np

from tumble.calibration.evidence import RotationFit
from tumble.calibration.verdict import two_digits
from tumble.report.figure import (
    BLUE,
    GREY,
    ORANGE,
    Figure,
    Plot,
    Section,
    base_layout,
    hover,
    plain,
    text_axis,
)
from tumble.report.rounding import with_uncertainty

if TYPE_CHECKING:
    from tumble.calibration.estimate import Estimate

ARCSEC = np.pi / 648000.0


def rotation_table(estimate: Estimate) -> str:
    """Return the axes and angles as an HTML table; nothing without rotations.

    Parameters
    ----------
    estimate : with what the rotations showed.
    """
    if not estimate.rotations:
        return ""
    heads = (
        "axis",
        "against the vertical",
        "table's angle",
        "gyros − table",
        "the triads' axes differ by",
        "distance from the plane",
        "",
    )
    rows = "".join(_rows(fit) for fit in estimate.rotations)
    head = "".join(f"<th>{name}</th>" for name in heads)
    return (
        "<h2>Rotations of the table</h2>\n<p>Each axis was turned about both ways. The gyros' angle is the table's but "
        "for the residual; the accelerometers see gravity go round in a plane whose normal is the same axis. ± is one "
        "standard deviation of a residual.</p>"
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>'
    )


def _rows(fit: RotationFit) -> str:
    cells: list[str] = []
    for number, turned in enumerate(fit.angles):
        way = f"{np.degrees(turned.angle):+.9g}° in {turned.seconds:.1f} s".replace("-", "−")
        off = f"{with_uncertainty(turned.residual / ARCSEC, turned.sigma / ARCSEC)} ″".replace("-", "−")
        note = "" if turned.from_rest else "at the constant rate"
        first = "<td></td><td></td>"
        last = f"<td></td><td></td><td>{note}</td>"
        if number == 0:
            first = f"<td>{html.escape(fit.name)}</td><td>{_degrees(fit.inclination)}</td>"
            notes = "; ".join(word for word in (note, fit.why) if word)
            last = f"<td>{_missed(fit)}</td><td>{_plane(fit)}</td><td>{html.escape(notes)}</td>"
        cells.append(f"<tr>{first}<td>{way}</td><td>{off}</td>{last}</tr>")
    return "".join(cells)


def _degrees(angle: float) -> str:
    return f"{np.degrees(angle):.1f}°" if np.isfinite(angle) else ""


def _missed(fit: RotationFit) -> str:
    if not np.isfinite(fit.missed):
        return ""
    return f"{two_digits(fit.missed / ARCSEC)} ″ (expected {two_digits(np.sqrt(2.0) * fit.missed_sigma / ARCSEC)} ″)"


def _plane(fit: RotationFit) -> str:
    return f"{two_digits(1e3 * fit.plane_residual)} mm/s²" if np.isfinite(fit.plane_residual) else ""


def rotation_section(estimate: Estimate) -> Section | None:
    """Return the figure of the angles' residuals, or None without rotations.

    Parameters
    ----------
    estimate : with what the rotations showed.
    """
    if not estimate.rotations:
        return None
    data: list[Plot] = []
    for sign, name, colour in ((1.0, "counter-clockwise", BLUE), (-1.0, "clockwise", ORANGE)):
        turned = [
            (fit.name, angle)
            for fit in estimate.rotations
            for angle in fit.angles
            if sign * angle.angle > 0.0
        ]
        data.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": name,
                "x": [hover(f"about {axis}") for axis, _ in turned],
                "y": plain([angle.residual / ARCSEC for _, angle in turned]),
                "error_y": {
                    "type": "data",
                    "array": plain([angle.sigma / ARCSEC for _, angle in turned]),
                    "color": GREY,
                    "thickness": 1,
                },
                "marker": {"size": 9, "color": colour, "symbol": "circle" if sign > 0 else "diamond"},
                "hovertemplate": "%{x}: %{y:.3g} ″<extra></extra>",
            }
        )
    layout = base_layout(
        320, xaxis=text_axis("", type="category"), yaxis=text_axis("gyros − table / ″", zeroline=True)
    )
    caption = (
        "What the calibrated gyros turned through, minus what the table's display said. Points of the two ways on "
        "either side of zero alike show a bias of that hour if all axes do it, and a misread angle if one does; "
        "both above or both below, an angle that does not fit the others. Six axes and no more are fitted exactly "
        "in their sum. Bars are one standard deviation."
    )
    label = "Residual of the table's angle in each rotation"
    return Section(
        "Rotations: gyros against the table's angle", [Figure("rotations", label, data, layout)], caption
    )
