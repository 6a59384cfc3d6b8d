"""Traces, axes and layouts as plain data for the plotting library in the page: none is imported here."""

from __future__ import annotations

import base64
import html
from typing import Any

import numpy as np

from tumble.report.page import Plot

BLUE, RED, GREEN, ORANGE, GREY, PURPLE = "#3b82d6", "#d6485b", "#2f9e6e", "#dd8a21", "#8b919c", "#8f63c9"
TEAL = "#12a5ad"
AXIS_COLOURS = {"x": RED, "y": GREEN, "z": BLUE}


def packed(values: np.ndarray) -> Plot:
    """Return an array as the library's packed float32: short, fast, and nan breaks the line."""
    data = np.ascontiguousarray(values, dtype="<f4")
    return {"dtype": "f4", "bdata": base64.b64encode(data.tobytes()).decode("ascii")}


def plain(values: Any, digits: int = 5) -> list[float | None]:
    """Return numbers with `digits` significant digits for JSON; what is not finite becomes null."""
    return [
        float(f"{value:.{digits}g}") if np.isfinite(value) else None
        for value in np.asarray(values, dtype=float)
    ]


def hover(text: str) -> str:
    """Return text that the library shows as it is."""
    return html.escape(text, quote=False)


def scatter(x: Any, y: Any, mode: str = "markers", **look: Any) -> Plot:
    """Return a trace of points or of a line.

    Parameters
    ----------
    x, y : (n,) numbers; lists stand as they are, for categories and for numbers with digits of their own.
    mode : "markers", "lines" or both.
    look : whatever else the library knows.
    """
    places: Plot = {"x": x if isinstance(x, list) else plain(x), "y": y if isinstance(y, list) else plain(y)}
    return {"type": "scatter", "mode": mode, **places, **look}


def error_bars(sigmas: Any, **look: Any) -> Plot:
    """Return the bars that stand for standard uncertainties `sigmas`, (n,)."""
    return {"type": "data", "array": plain(sigmas), **look}


def faint(colour: str, opacity: float = 0.15) -> str:
    """Return a colour of the form #rrggbb that lets through what lies below."""
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity})"


def text_axis(title: str, **more: Any) -> Plot:
    """Return an axis with a title and room for its labels."""
    return {"title": {"text": title}, "automargin": True, **more}


def small_title(text: str, **more: Any) -> Plot:
    """Return the title of a figure or of an axis where room is short."""
    return {"text": text, "font": {"size": 12}, **more}


def upright_line(at: float, **look: Any) -> Plot:
    """Return a line from bottom to top, to compare with."""
    places: Plot = {"type": "line", "x0": at, "x1": at, "yref": "paper", "y0": 0, "y1": 1}
    return {**places, "line": {"dash": "dash", "width": 1, "color": GREY}, **look}


def base_layout(height: int, **more: Any) -> Plot:
    """Return the layout that all figures share."""
    return {
        "height": height,
        "margin": {"l": 56, "r": 12, "t": 12, "b": 44},
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
        "hovermode": "closest",
        **more,
    }
