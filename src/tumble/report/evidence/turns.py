"""What each turn still shows: gravity carried over it by the gyro, against gravity seen after it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.arrays import Series
from tumble.report.evidence.holds import numbered, rms
from tumble.report.evidence.uncalibrated import nominal_turn_angles
from tumble.report.figures.record import BLUE, GREY, RED, Axis, Curve, Figure, Mark, Points
from tumble.report.page import Block, Figures, section

if TYPE_CHECKING:
    from tumble.calibration.evidence import Turns
    from tumble.report.subject import Subject


def turns(told: Turns, subject: Subject) -> list[Block]:
    """Return the figure of the turns' angles before and after; nothing without turns.

    Parameters
    ----------
    told : what the estimate rests on.
    subject : of the report.
    """
    estimate, poses = subject.estimate, subject.poses
    at = np.flatnonzero(np.isfinite(told.angles))
    if at.size == 0:
        return []
    before = nominal_turn_angles(subject.recording, subject.timeline, subject.means, estimate.model)
    after = np.degrees(told.angles[at])
    words = [
        f"turned {size:.0f}°, from {poses[k]} to {poses[k + 1]}"
        for k, size in zip(at, np.degrees(told.sizes[at]), strict=True)
    ]
    shown: dict[str, Any] = {"words": words, "hover": "turn %{x}: %{y:.3f}°<br>%{text}<extra></extra>"}
    x, expected = (at + 1).tolist(), np.degrees(told.sigmas[at])
    marks: list[Mark] = []
    caption = (
        f"Gravity carried over a turn by the corrected gyro ends {rms(after):.2g}° rms from where it "
        "is seen afterwards. The blue points should lie around the grey line of expected standard "
        "deviations, not above"
    )
    if before is not None:
        earlier = np.degrees(before.residuals[at])
        marks.append(Points(x, earlier, "before", GREY, symbol="circle-open", **shown))
        caption += f". Before it was {rms(earlier):.2g}° rms, with {before.words}"
    gone = {int(np.searchsorted(at, left.index)) for left in estimate.left_out if left.kind == "turn"}
    colours = [RED if k in gone else BLUE for k in range(at.size)]
    marks.append(Points(x, after, "after", colours, size=8, **shown))
    hover = "expected %{y:.3f}°<extra></extra>"
    marks.append(Curve(x, expected, "expected", GREY, hover=hover, width=1.5, steps="mid"))
    every = np.concatenate([mark.y for mark in marks])
    angles = Axis("angle / °", "log", ticks=_decades(every[every > 0.0]))
    label = "Angle between gravity carried over each turn and gravity seen, before and after"
    across = numbered("turn (from hold n to the next)", at + 1)
    figure = Figure("turns", label, marks, across, angles, 380)
    return section("Turns: gravity carried by the gyro", Figures([figure], f"{caption}."))


def _decades(values: Series) -> list[float]:
    """Return ticks of a logarithmic axis that are plain numbers: 1, 2, 5 or 1 only over many decades."""
    if not values.size:
        return []
    low, high = values.min(), values.max()
    steps = (1, 2, 5) if np.log10(high / low) < 2.5 else (1,)
    first, last = int(np.floor(np.log10(low))), int(np.ceil(np.log10(high)))
    return [step * 10.0**decade for decade in range(first, last + 1) for step in steps]
