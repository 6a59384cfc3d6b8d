"""What each hold still shows: its norm against gravity before and after, and which holds do not rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import Series
from tumble.calibration.evidence import ThermalCurves
from tumble.report.evidence.uncalibrated import Uncalibrated, nominal_hold_norms
from tumble.report.figures.record import BLUE, GREY, RED, Axis, Band, Bars, Figure, Look, Mark, Points
from tumble.report.page import Block, Figures, Sentences, Table, section

if TYPE_CHECKING:
    from tumble.calibration.evidence import Holds
    from tumble.report.subject import Subject


def holds(told: Holds, subject: Subject) -> list[Block]:
    """Return the figure of the holds' norms and the table of those that sway; nothing without holds.

    Parameters
    ----------
    told : what the estimate rests on.
    subject : of a thermal test the residuals are the rests', and stand elsewhere.
    """
    found: list[Block] = []
    if told.norms.size and subject.estimate.shown(ThermalCurves) is None:
        before = nominal_hold_norms(subject.recording, subject.means, subject.calibration.site.gravity)
        figures = Figures([_drawn(told, subject, before)], _caption(told, subject, before))
        found += section("Holds: norm against gravity", figures)
    return found + restless(told)


def _caption(told: Holds, subject: Subject, before: Uncalibrated | None) -> str:
    caption = (
        f"After calibration the norm of each hold differs from gravity by {rms(1e3 * told.norms):.2g} mm/s² "
        "rms; the points should scatter within the band (one and two expected standard deviations) without a trend"
    )
    if subject.estimate.degrees_of_freedom <= 0:
        caption = (
            "With as many unknowns as holds the norms are fitted whatever they are: the points show nothing"
        )
    if before is None:
        return f"{caption}."
    earlier = rms(1e3 * before.residuals)
    return f"{caption}. Before (above, another scale) it was {earlier:.3g} mm/s² rms, with {before.words}."


def _drawn(told: Holds, subject: Subject, before: Uncalibrated | None) -> Figure:
    number = np.arange(1, told.norms.size + 1)
    colours = [RED if k in subject.holds_left_out else BLUE for k in range(number.size)]
    hover = "hold %{x}: %{y:.2f} mm/s²<br>%{text}<extra></extra>"
    marks: list[Mark] = _band(number, 1e3 * told.sigmas)
    marks.append(
        Points(number.tolist(), 1e3 * told.norms, "after", colours, hover=hover, words=subject.poses)
    )
    panels = [Axis("norm − g, after / (mm/s²)")]
    if before is not None:
        hover = "hold %{x}: %{y:.1f} mm/s²<br>%{text}<extra></extra>"
        look: Look = {"panel": 1, "hover": hover, "words": subject.poses}
        marks.append(Bars(number.tolist(), 1e3 * before.residuals, "before", GREY, **look))
        panels = [Axis("after / (mm/s²)", share=(0.0, 0.55)), Axis("before / (mm/s²)", share=(0.63, 1.0))]
    label = "Norm of the specific force in each hold minus gravity, before and after"
    return Figure("holds", label, marks, numbered("hold", number), panels, 340 if before is None else 460)


def _band(number: np.ndarray, sigma: Series) -> list[Mark]:
    """Return the band of two and of one standard deviation, a step for each hold."""
    x = np.append(number - 0.5, number[-1] + 0.5)
    y = np.append(sigma, sigma[-1])
    return [
        Band(
            x,
            (-factor * y, factor * y),
            "expected ± 1 and 2 sigma",
            GREY,
            opacity=opacity,
            legend=factor == 1.0,
            steps="post",
        )
        for factor, opacity in ((2.0, 0.16), (1.0, 0.3))
    ]


def rms(values: Series) -> float:
    """Return the root mean square of what is finite."""
    return float(np.sqrt(np.nanmean(values**2)))


def numbered(title: str, number: np.ndarray) -> Axis:
    """Return an axis of whole numbers, marked as often as there is room for.

    Parameters
    ----------
    title : of the axis.
    number : (n,) ascending.
    """
    count = int(number[-1])
    step = 1 if count <= 15 else 5 if count <= 80 else 10 ** int(np.ceil(np.log10(count / 10.0)))
    span = (float(number[0]) - 0.8, float(number[-1]) + 0.8)
    return Axis(title, every=step, span=span, zero=False)


def restless(told: Holds) -> list[Block]:
    """Return the holds that sway more than the others as a table; nothing without such.

    Parameters
    ----------
    told : with the holds that the procedure found restless.
    """
    if not told.restless:
        return []
    rows = [
        [
            str(one.hold + 1),
            f"{one.start:.1f} to {one.stop:.1f}",
            f"{1e3 * one.sway:.2g}",
            f"{1e3 * one.others:.2g}",
        ]
        for one in told.restless
    ]
    words = (
        "One sigma about each axis, from a hold's start to its middle and from there to its end. These holds count "
        "for less. Support the unit firmly and record them again."
    )
    heads = ("hold", "s", "sways by, mrad", "the others, mrad")
    return section("Holds that do not rest", Sentences([words], "paragraphs"), Table(heads, rows))
