"""What each hold still shows: its norm against gravity before and after, and which holds do not rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import Series
from tumble.calibration.evidence import ThermalCurves
from tumble.report.evidence.uncalibrated import Uncalibrated, nominal_hold_norms
from tumble.report.figures.plot import BLUE, GREY, RED, base_layout, plain, scatter, text_axis
from tumble.report.page import Block, Figure, Figures, Plot, Sentences, Table, section

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
        label = "Norm of the specific force in each hold minus gravity, before and after"
        figure = Figure("holds", label, *_drawn(told, subject, before))
        found += section("Holds: norm against gravity", Figures([figure], _caption(told, subject, before)))
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


def _drawn(told: Holds, subject: Subject, before: Uncalibrated | None) -> tuple[list[Plot], Plot]:
    number = np.arange(1, told.norms.size + 1)
    x = number.tolist()
    colours = [RED if k in subject.holds_left_out else BLUE for k in range(number.size)]
    hovered = "hold %{x}: %{y:.2f} mm/s²<br>%{text}<extra></extra>"
    look: Plot = {"name": "after", "marker": {"size": 7, "color": colours}, "hovertemplate": hovered}
    data = _band(number, 1e3 * told.sigmas)
    data.append(scatter(x, 1e3 * told.norms, text=subject.poses, **look))
    across = numbered("hold", number)
    if before is None:
        return data, base_layout(340, xaxis=across, yaxis=text_axis("norm − g, after / (mm/s²)"))
    data.append(
        {
            "type": "bar",
            "name": "before",
            "x": x,
            "y": plain(1e3 * before.residuals),
            "yaxis": "y2",
            "text": subject.poses,
            "textposition": "none",
            "marker": {"color": GREY},
            "hovertemplate": "hold %{x}: %{y:.1f} mm/s²<br>%{text}<extra></extra>",
        }
    )
    axes = {
        "yaxis": text_axis("after / (mm/s²)", domain=[0.0, 0.55]),
        "yaxis2": text_axis("before / (mm/s²)", domain=[0.63, 1.0]),
    }
    return data, base_layout(460, xaxis=across, **axes)


def _band(number: np.ndarray, sigma: Series) -> list[Plot]:
    """Return the band of two and of one standard deviation, a step for each hold."""
    x = plain(np.concatenate([number - 0.5, number[-1:] + 0.5]))
    y = np.concatenate([sigma, sigma[-1:]])
    return [
        scatter(
            x,
            sign * factor * y,
            "lines",
            yaxis="y",
            line={"width": 0, "shape": "hv", "color": GREY},
            fill="tonexty" if sign > 0 else "none",
            fillcolor=f"rgba(139,145,156,{opacity})",
            hoverinfo="skip",
            name="expected ± 1 and 2 sigma",
            showlegend=factor == 1.0 and sign > 0,
        )
        for factor, opacity in ((2.0, 0.16), (1.0, 0.3))
        for sign in (-1.0, 1.0)
    ]


def rms(values: Series) -> float:
    """Return the root mean square of what is finite."""
    return float(np.sqrt(np.nanmean(values**2)))


def numbered(title: str, number: np.ndarray) -> Plot:
    """Return an axis of whole numbers, marked as often as there is room for.

    Parameters
    ----------
    title : of the axis.
    number : (n,) ascending.
    """
    count = int(number[-1])
    step = 1 if count <= 15 else 5 if count <= 80 else 10 ** int(np.ceil(np.log10(count / 10.0)))
    span = [float(number[0]) - 0.8, float(number[-1]) + 0.8]
    return text_axis(title, dtick=step, range=span, anchor="y", zeroline=False)


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
