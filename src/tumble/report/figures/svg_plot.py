"""A figure as SVG, drawn by ourselves: a picture that every browser and printer shows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import Element

import numpy as np

from tumble.report.figures.plot import BLUE, GREEN, GREY, ORANGE, PURPLE, RED, TEAL
from tumble.report.figures.svg import add, as_text, drawing

if TYPE_CHECKING:
    from tumble.arrays import Series
    from tumble.reproduction.outcome import Curve, Plot

WIDTH, HEIGHT = 640, 400
LEFT, RIGHT, TOP, BOTTOM = 84, 20, 46, 56
COLOURS = (BLUE, GREEN, ORANGE, PURPLE, TEAL)
# A line through more points than this shows no point.
_DOTS = 100
# Up to so many places of a logarithmic axis have a tick each.
_FEW = 8
_DIGITS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def draw_plot(plot: Plot) -> str:
    """Return the figure as SVG: each curve as a line in its band.

    Parameters
    ----------
    plot : what to draw; on logarithmic axes values that are not positive are left out.
    """
    curves = [curve for curve in plot.curves if plot.linear or np.any(curve.y > 0)]
    lows = [curve.low if plot.linear else above_zero(curve) for curve in curves]
    seen_y = [values for c, low in zip(curves, lows, strict=True) for values in (c.y, c.high, low)]
    if plot.marks is not None:
        seen_y.append(plot.marks.y)
    limits = _steps if plot.linear else _decades
    (x_low, x_high), (y_low, y_high) = limits([curve.x for curve in curves]), limits(seen_y)
    if few := few_places(plot):
        x_low, x_high = (float(np.log10(x)) for x in (few[0] / 1.2, few[-1] * 1.2))

    def at(x: Series, y: Series) -> list[str]:
        x, y = (x, y) if plot.linear else (np.log10(x), np.log10(y))
        across = LEFT + (WIDTH - LEFT - RIGHT) * (x - x_low) / (x_high - x_low)
        up = HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * (y - y_low) / (y_high - y_low)
        return [f"{a:.1f},{b:.1f}" for a, b in zip(across, up, strict=True)]

    svg = _frame(plot, (x_low, x_high), (y_low, y_high))
    drawn = add(svg, "g", fill="none", stroke_width=2)
    for curve, low, colour in zip(curves, lows, COLOURS, strict=False):
        seen = np.isfinite(curve.y) if plot.linear else curve.y > 0
        x, y = curve.x[seen], curve.y[seen]
        band = [*at(x, low[seen]), *at(x[::-1], curve.high[seen][::-1])]
        add(drawn, "polygon", points=" ".join(band), fill=colour, fill_opacity="0.15", stroke="none")
        add(drawn, "polyline", points=" ".join(at(x, y)), stroke=colour)
        for place in at(x, y) if len(x) <= _DOTS else []:
            across, up = place.split(",")
            add(drawn, "circle", cx=across, cy=up, r=3, fill=colour, stroke="none")
    if plot.marks is not None:
        for place in at(plot.marks.x, plot.marks.y):
            _cross(drawn, *map(float, place.split(",")))
    _legend(svg, plot, curves)
    return as_text(svg) + "\n"


def few_places(plot: Plot) -> list[float]:
    """Return where the points stand of a logarithmic plot below two decades, which has hardly a power of ten.

    Parameters
    ----------
    plot : of any kind; of others the list is empty.
    """
    places = np.unique(np.concatenate([np.zeros(0), *(curve.x for curve in plot.curves)]))
    if plot.linear or not 2 <= len(places) <= _FEW or not places[0] > 0.0 or places[-1] >= 100.0 * places[0]:
        return []
    return [float(place) for place in places]


def above_zero(curve: Curve) -> Series:
    """Return the band's lower edge; a zero, which has no logarithm, is a hundredth of the line."""
    return np.where(curve.low > 0, curve.low, 1e-2 * curve.y)


def _decades(series: list[Series]) -> tuple[float, float]:
    values = np.concatenate([np.zeros(0), *series])
    positive = values[np.isfinite(values) & (values > 0)]
    if not positive.size:
        return 0.0, 1.0
    low, high = (
        float(np.floor(np.log10(positive.min()) + 1e-9)),
        float(np.ceil(np.log10(positive.max()) - 1e-9)),
    )
    return low, max(high, low + 1.0)


def _steps(series: list[Series]) -> tuple[float, float]:
    """Return limits at whole steps of 1, 2 or 5 times a power of ten."""
    values = np.concatenate([np.zeros(0), *series])
    values = values[np.isfinite(values)]
    if not values.size:
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    if high - low <= 1e-9 * max(abs(low), abs(high)):  # a flat line stands in the middle
        half = 0.5 * abs(high) or 0.5
        low, high = low - half, high + half
    step = _step(high - low)
    return step * float(np.floor(low / step)), step * float(np.ceil(high / step + 1e-9))


def _step(span: float) -> float:
    """Return a step of 1, 2 or 5 times a power of ten, of which some five to ten cover the span."""
    power = 10.0 ** np.floor(np.log10(span / 5.0))
    return float(power * max(m for m in (1.0, 2.0, 5.0) if m * power <= span / 5.0 * (1.0 + 1e-9)))


def _frame(plot: Plot, x_range: tuple[float, float], y_range: tuple[float, float]) -> Element:
    """Return the drawing with its title, its grid and the names of its axes."""
    look: dict[str, Any] = {"width": WIDTH, "font_family": "system-ui, sans-serif", "font_size": 13}
    svg = drawing(f"0 0 {WIDTH} {HEIGHT}", **look)
    inner_width, inner_height = WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM
    add(svg, "title", plot.title)
    add(svg, "rect", width=WIDTH, height=HEIGHT, fill="#ffffff")
    add(svg, "text", plot.title, x=LEFT, y=20, font_weight=600)
    add(svg, "rect", x=LEFT, y=TOP, width=inner_width, height=inner_height, fill="none", stroke=GREY)
    few = few_places(plot)
    across = [(float(np.log10(x)), f"{x:g}") for x in few] if few else _ticks(x_range, plot.linear)
    bottom = HEIGHT - BOTTOM
    for tick, words in across:
        x = LEFT + inner_width * (tick - x_range[0]) / (x_range[1] - x_range[0])
        add(svg, "line", x1=x, x2=x, y1=TOP, y2=bottom, stroke="#e3e6ea")
        add(svg, "text", words, x=x, y=bottom + 18, text_anchor="middle")
    for tick, words in _ticks(y_range, plot.linear):
        y = bottom - inner_height * (tick - y_range[0]) / (y_range[1] - y_range[0])
        add(svg, "line", x1=LEFT, x2=WIDTH - RIGHT, y1=y, y2=y, stroke="#e3e6ea")
        add(svg, "text", words, x=LEFT - 8, y=y + 4.0, text_anchor="end")
    add(svg, "text", plot.x_label, x=LEFT + inner_width // 2, y=HEIGHT - 14, text_anchor="middle")
    upright = f"translate(20 {TOP + inner_height / 2:.0f}) rotate(-90)"
    add(svg, "text", plot.y_label, transform=upright, text_anchor="middle")
    return svg


def _ticks(limits: tuple[float, float], linear: bool) -> list[tuple[float, str]]:
    """Return where the ticks stand, and their words."""
    low, high = limits
    if linear:
        step = _step(high - low)
        at = [step * number for number in range(round(low / step), round(high / step) + 1)]
        return [(tick, f"{float(f'{tick:.12g}'):g}".replace("-", "−")) for tick in at]
    decades = range(int(low), int(high) + 1, 1 if high - low <= 8 else 2)
    return [(float(decade), _power(decade)) for decade in decades]


def _power(decade: int) -> str:
    return {0: "1", 1: "10", 2: "100"}.get(decade, f"10{str(decade).translate(_DIGITS)}")


def _cross(parent: Element, x: float, y: float) -> None:
    """Add a saltire: what the paper prints."""
    add(parent, "path", d=f"M{x - 5:.1f},{y - 5:.1f}l10,10m0,-10l-10,10", stroke=RED, stroke_width="1.8")


def _legend(svg: Element, plot: Plot, curves: list[Curve]) -> None:
    x = LEFT
    for curve, colour in zip(curves, COLOURS, strict=False):
        add(svg, "rect", x=x, y=30, width=18, height=4, fill=colour)
        add(svg, "text", curve.name, x=x + 24, y=37)
        x += 40 + 8 * len(curve.name)
    if plot.marks is not None:
        _cross(svg, x + 9, 32)
        add(svg, "text", plot.marks.name, x=x + 24, y=37)
    words = f"line: {plot.line}; band: {plot.band}"
    add(svg, "text", words, x=WIDTH - RIGHT, y=20, text_anchor="end", fill=GREY)
