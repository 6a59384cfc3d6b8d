"""Residuals before and after: what each hold and each turn still shows."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series
from tumble.calibration.estimate import Estimate
from tumble.report.figure import BLUE, GREY, RED, Figure, Plot, Section, base_layout, plain, text_axis
from tumble.report.uncalibrated import Uncalibrated


def hold_section(estimate: Estimate, before: Uncalibrated | None, poses: list[str]) -> Section:
    """Return the figure of the holds' norms against gravity, before and after.

    Parameters
    ----------
    estimate : residuals and their expected sigma, m/s².
    before : the same with nominal values.
    poses : each hold's pose in words.
    """
    number = np.arange(1, estimate.hold_norms.size + 1)
    after, sigma = 1e3 * estimate.hold_norms, 1e3 * estimate.hold_sigmas
    gone = {left.index for left in estimate.left_out if left.kind == "hold"}
    data = [*_band(number, sigma, "y"), _marks(number, after, gone, "after", "%{y:.2f} mm/s²", poses)]
    layout = base_layout(340, xaxis=_numbers("hold", number), yaxis=text_axis("norm − g, after / (mm/s²)"))
    rms = _rms(after)
    caption = (
        f"After calibration the norm of each hold differs from gravity by {rms:.2g} mm/s² rms; the points should "
        "scatter within the band (one and two expected standard deviations) without a trend"
    )
    if estimate.degrees_of_freedom <= 0:
        caption = (
            "With as many unknowns as holds the norms are fitted whatever they are: the points show nothing"
        )
    if before is not None:
        earlier = 1e3 * before.residuals
        data.append(_bars(number, earlier, poses))
        layout.update(
            height=460,
            xaxis=_numbers("hold", number),
            yaxis=text_axis("after / (mm/s²)", domain=[0.0, 0.55]),
            yaxis2=text_axis("before / (mm/s²)", domain=[0.63, 1.0]),
        )
        caption += (
            f". Before (above, another scale) it was {_rms(earlier):.3g} mm/s² rms, with {before.words}"
        )
    label = "Norm of the specific force in each hold minus gravity, before and after"
    return Section("Holds: norm against gravity", [Figure("holds", label, data, layout)], caption + ".")


def turn_section(estimate: Estimate, before: Uncalibrated | None, poses: list[str]) -> Section | None:
    """Return the figure of the turns' angles before and after, or None without turns."""
    turns = np.flatnonzero(np.isfinite(estimate.turn_angles))
    if turns.size == 0:
        return None
    number = turns + 1
    after = np.degrees(estimate.turn_angles[turns])
    sigma = np.degrees(estimate.turn_sigmas[turns])
    gone = {int(np.searchsorted(turns, left.index)) for left in estimate.left_out if left.kind == "turn"}
    words = [
        f"turned {size:.0f}°, from {poses[k]} to {poses[k + 1]}"
        for k, size in zip(turns, np.degrees(estimate.turn_sizes[turns]), strict=True)
    ]
    data: list[Plot] = []
    caption = (
        f"Gravity carried over a turn by the corrected gyro ends {_rms(after):.2g}° rms from where it is seen "
        "afterwards: the blue points should lie around the grey line of expected standard deviations, not above"
    )
    if before is not None:
        earlier = np.degrees(before.residuals[turns])
        data.append(
            _points(number, earlier, "before", {"color": GREY, "size": 7, "symbol": "circle-open"}, words)
        )
        caption += f". Before it was {_rms(earlier):.2g}° rms, with {before.words}"
    colours = [RED if k in gone else BLUE for k in range(turns.size)]
    data.append(_points(number, after, "after", {"color": colours, "size": 8}, words))
    data.append(
        {
            "type": "scatter",
            "mode": "lines",
            "name": "expected",
            "x": [int(n) for n in number],
            "y": plain(sigma),
            "line": {"color": GREY, "width": 1.5, "shape": "hvh"},
            "hovertemplate": "expected %{y:.3f}°<extra></extra>",
        }
    )
    layout = base_layout(
        380,
        xaxis=_numbers("turn (from hold n to the next)", number),
        yaxis=text_axis("angle / °", type="log", **_decades(_joined(data))),
    )
    label = "Angle between gravity carried over each turn and gravity seen, before and after"
    return Section(
        "Turns: gravity carried by the gyro", [Figure("turns", label, data, layout)], caption + "."
    )


def _joined(data: list[Plot]) -> list[float]:
    return [value for trace in data for value in trace["y"] if value]


def _decades(values: list[float]) -> Plot:
    """Return ticks of a logarithmic axis that are plain numbers: 1, 2, 5 or 1 only over many decades."""
    if not values:
        return {}
    low, high = min(values), max(values)
    steps = (1, 2, 5) if np.log10(high / low) < 2.5 else (1,)
    first, last = int(np.floor(np.log10(low))), int(np.ceil(np.log10(high)))
    ticks = [step * 10.0**decade for decade in range(first, last + 1) for step in steps]
    return {"tickvals": plain(ticks), "ticktext": [f"{tick:.12g}" for tick in ticks]}


def _rms(values: Series) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def _numbers(title: str, number: np.ndarray) -> Plot:
    span = [float(number[0]) - 0.8, float(number[-1]) + 0.8]
    return text_axis(title, dtick=_tick(int(number[-1])), range=span, anchor="y", zeroline=False)


def _tick(count: int) -> int:
    return 1 if count <= 15 else 5 if count <= 80 else 10 ** int(np.ceil(np.log10(count / 10.0)))


def _band(number: np.ndarray, sigma: Series, axis: str) -> list[Plot]:
    """Return the band of two and of one standard deviation, a step for each hold."""
    x = np.concatenate([number - 0.5, number[-1:] + 0.5])
    y = np.concatenate([sigma, sigma[-1:]])
    data: list[Plot] = []
    for factor, opacity in ((2.0, 0.16), (1.0, 0.3)):
        for sign in (-1.0, 1.0):
            data.append(
                {
                    "type": "scatter",
                    "mode": "lines",
                    "x": plain(x),
                    "y": plain(sign * factor * y),
                    "yaxis": axis,
                    "line": {"width": 0, "shape": "hv", "color": GREY},
                    "fill": "tonexty" if sign > 0 else "none",
                    "fillcolor": f"rgba(139,145,156,{opacity})",
                    "hoverinfo": "skip",
                    "name": "expected ± 1 and 2 sigma",
                    "showlegend": factor == 1.0 and sign > 0,
                }
            )
    return data


def _marks(
    number: np.ndarray, values: Series, gone: set[int], name: str, template: str, words: list[str]
) -> Plot:
    return {
        "type": "scatter",
        "mode": "markers",
        "name": name,
        "x": [int(n) for n in number],
        "y": plain(values),
        "text": words,
        "marker": {"size": 7, "color": [RED if k in gone else BLUE for k in range(values.size)]},
        "hovertemplate": "hold %{x}: " + template + "<br>%{text}<extra></extra>",
    }


def _bars(number: np.ndarray, values: Series, words: list[str]) -> Plot:
    return {
        "type": "bar",
        "name": "before",
        "x": [int(n) for n in number],
        "y": plain(values),
        "yaxis": "y2",
        "text": words,
        "textposition": "none",
        "marker": {"color": GREY},
        "hovertemplate": "hold %{x}: %{y:.1f} mm/s²<br>%{text}<extra></extra>",
    }


def _points(number: np.ndarray, values: Series, name: str, marker: Plot, words: list[str]) -> Plot:
    return {
        "type": "scatter",
        "mode": "markers",
        "name": name,
        "x": [int(n) for n in number],
        "y": plain(values),
        "text": words,
        "marker": marker,
        "hovertemplate": "turn %{x}: %{y:.3f}°<br>%{text}<extra></extra>",
    }


def restless_table(estimate: Estimate) -> str:
    """Return the holds that sway more than the others as an HTML table; nothing without such.

    Parameters
    ----------
    estimate : with the holds that the procedure found restless.
    """
    if not estimate.restless:
        return ""
    rows = "".join(
        f"<tr><td>{one.hold + 1}</td><td>{one.start:.1f} to {one.stop:.1f}</td><td>{1e3 * one.sway:.2g}</td>"
        f"<td>{1e3 * one.others:.2g}</td></tr>"
        for one in estimate.restless
    )
    heads = "".join(f"<th>{head}</th>" for head in ("hold", "s", "sways by, mrad", "the others, mrad"))
    return (
        "<h2>Holds that do not rest</h2>\n<p>One sigma about each axis, from a hold's start to its middle and from "
        "there to its end. These holds count for less. Support the unit firmly and record them again.</p>"
        f'<div class="scroll"><table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table></div>'
    )
