"""What each turn still shows: gravity carried over it by the gyro, against gravity seen after it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.report.evidence.holds import numbered, rms
from tumble.report.evidence.uncalibrated import nominal_turn_angles
from tumble.report.figures.plot import BLUE, GREY, RED, base_layout, plain, scatter, text_axis
from tumble.report.page import Block, Figure, Figures, Plot, section

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
    shown: Plot = {"text": words, "hovertemplate": "turn %{x}: %{y:.3f}°<br>%{text}<extra></extra>"}
    x = (at + 1).tolist()
    data: list[Plot] = []
    caption = (
        f"Gravity carried over a turn by the corrected gyro ends {rms(after):.2g}° rms from where it "
        "is seen afterwards. The blue points should lie around the grey line of expected standard "
        "deviations, not above"
    )
    if before is not None:
        earlier = np.degrees(before.residuals[at])
        marker = {"color": GREY, "size": 7, "symbol": "circle-open"}
        data.append(scatter(x, earlier, name="before", marker=marker, **shown))
        caption += f". Before it was {rms(earlier):.2g}° rms, with {before.words}"
    gone = {int(np.searchsorted(at, left.index)) for left in estimate.left_out if left.kind == "turn"}
    colours = [RED if k in gone else BLUE for k in range(at.size)]
    data.append(scatter(x, after, name="after", marker={"color": colours, "size": 8}, **shown))
    line = {"color": GREY, "width": 1.5, "shape": "hvh"}
    hovered = "expected %{y:.3f}°<extra></extra>"
    expected = np.degrees(told.sigmas[at])
    data.append(scatter(x, expected, "lines", name="expected", line=line, hovertemplate=hovered))
    angles = text_axis("angle / °", type="log", **_decades([y for trace in data for y in trace["y"] if y]))
    layout = base_layout(380, xaxis=numbered("turn (from hold n to the next)", at + 1), yaxis=angles)
    label = "Angle between gravity carried over each turn and gravity seen, before and after"
    figure = Figure("turns", label, data, layout)
    return section("Turns: gravity carried by the gyro", Figures([figure], f"{caption}."))


def _decades(values: list[float]) -> Plot:
    """Return ticks of a logarithmic axis that are plain numbers: 1, 2, 5 or 1 only over many decades."""
    if not values:
        return {}
    low, high = min(values), max(values)
    steps = (1, 2, 5) if np.log10(high / low) < 2.5 else (1,)
    first, last = int(np.floor(np.log10(low))), int(np.ceil(np.log10(high)))
    ticks = [step * 10.0**decade for decade in range(first, last + 1) for step in steps]
    return {"tickvals": plain(ticks), "ticktext": [f"{tick:.12g}" for tick in ticks]}
