"""What a table's rotations showed: the axes as both triads saw them, and the angles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.calibration.verdict import two_digits
from tumble.report.figures.plot import BLUE, GREY, ORANGE, base_layout, error_bars, hover, scatter, text_axis
from tumble.report.page import Block, Figure, Figures, Plot, Sentences, Table, section
from tumble.report.rounding import with_uncertainty
from tumble.units import ARCSECOND

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tumble.calibration.evidence import RotationFit, Rotations
    from tumble.report.subject import Subject

_HEADS = (
    "axis",
    "against the vertical",
    "table's angle",
    "gyros − table",
    "the triads' axes differ by",
    "distance from the plane",
    "",
)
_TABLE = (
    "Each axis was turned about both ways. The gyros' angle is the table's but for the residual; the accelerometers "
    "see gravity go round in a plane whose normal is the same axis. ± is one standard deviation of a residual."
)
_FIGURE = (
    "What the calibrated gyros turned through, minus what the table's display said. Points of the "
    "two ways that lie equally far above and below zero show a misread angle, or a bias of that hour "
    "if all axes do it. Both above or both below show an angle that does not fit the others. Six "
    "axes and no more are fitted exactly in their sum. Bars are one standard deviation."
)


def rotations(told: Rotations, subject: Subject) -> list[Block]:
    """Return the axes and angles as a table, and the angles' residuals as a figure; nothing without rotations.

    Parameters
    ----------
    told : what the estimate rests on.
    subject : of the report.
    """
    if not told.fits:
        return []
    layout = base_layout(
        320, xaxis=text_axis("", type="category"), yaxis=text_axis("gyros − table / ″", zeroline=True)
    )
    label = "Residual of the table's angle in each rotation"
    figure = Figure("rotations", label, _drawn(told.fits), layout)
    table = Table(_HEADS, [cells for fit in told.fits for cells in _rows(fit)])
    return [
        *section("Rotations of the table", Sentences([_TABLE], "paragraphs"), table),
        *section("Rotations: gyros against the table's angle", Figures([figure], _FIGURE)),
    ]


def _rows(fit: RotationFit) -> list[list[str]]:
    """Return a row for each rotation; what is the axis' own stands in the first."""
    missed = plane = inclination = ""
    if np.isfinite(fit.missed):
        expected = two_digits(np.sqrt(2.0) * fit.missed_sigma / ARCSECOND)
        missed = f"{two_digits(fit.missed / ARCSECOND)} ″ (expected {expected} ″)"
    if np.isfinite(fit.plane_residual):
        plane = f"{two_digits(1e3 * fit.plane_residual)} mm/s²"
    if np.isfinite(fit.inclination):
        inclination = f"{np.degrees(fit.inclination):.1f}°"
    rows: list[list[str]] = []
    for number, turned in enumerate(fit.angles):
        way = f"{np.degrees(turned.angle):+.9g}° in {turned.seconds:.1f} s"
        off = f"{with_uncertainty(turned.residual / ARCSECOND, turned.sigma / ARCSECOND)} ″"
        note = "" if turned.from_rest else "at the constant rate"
        if number == 0:
            notes = "; ".join(word for word in (note, fit.why) if word)
            rows.append([fit.name, inclination, way, off, missed, plane, notes])
        else:
            rows.append(["", "", way, off, "", "", note])
    return rows


def _drawn(fits: Sequence[RotationFit]) -> list[Plot]:
    data: list[Plot] = []
    for sign, name, colour in ((1.0, "counter-clockwise", BLUE), (-1.0, "clockwise", ORANGE)):
        turned = [(fit.name, angle) for fit in fits for angle in fit.angles if sign * angle.angle > 0.0]
        sigmas = [angle.sigma / ARCSECOND for _, angle in turned]
        data.append(
            scatter(
                [hover(f"about {axis}") for axis, _ in turned],
                np.array([angle.residual / ARCSECOND for _, angle in turned]),
                name=name,
                error_y=error_bars(sigmas, color=GREY, thickness=1),
                marker={"size": 9, "color": colour, "symbol": "circle" if sign > 0 else "diamond"},
                hovertemplate="%{x}: %{y:.3g} ″<extra></extra>",
            )
        )
    return data
