"""A figure as plain data for the plotting library in the page: no plotting library is imported here."""

from __future__ import annotations

import base64
import html
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Plot = dict[str, Any]

BLUE, RED, GREEN, ORANGE, GREY, PURPLE = "#3b82d6", "#d6485b", "#2f9e6e", "#dd8a21", "#8b919c", "#8f63c9"
TEAL = "#12a5ad"
AXIS_COLOURS = {"x": RED, "y": GREEN, "z": BLUE}


@dataclass(frozen=True, slots=True)
class Figure:
    """One drawing of the page.

    Attributes
    ----------
    name : identifier in the page.
    label : what a screen reader says.
    data, layout : traces and layout, colours of text and grid left to the page's theme.
    fallback : (data, layout) where three dimensions cannot be drawn.
    least_width, most_width : pixels below which it scrolls sideways instead of shrinking, and beyond
        which it does not grow; 0 for no limit.
    """

    name: str
    label: str
    data: list[Plot]
    layout: Plot
    fallback: tuple[list[Plot], Plot] | None = None
    least_width: int = 0
    most_width: int = 0

    @property
    def height(self) -> int:
        """Height in pixels."""
        return int(self.layout["height"])

    def as_dict(self) -> Plot:
        """Return what the page's script reads."""
        plot: Plot = {"name": self.name, "data": self.data, "layout": self.layout}
        if self.fallback is not None:
            plot["fallback"] = {"data": self.fallback[0], "layout": self.fallback[1]}
        return plot


@dataclass(frozen=True, slots=True)
class Section:
    """Figures that stand together, with one caption that says what to look for."""

    title: str
    figures: list[Figure]
    caption: str
    notes: list[str] = field(default_factory=list[str])


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


def text_axis(title: str, **more: Any) -> Plot:
    """Return an axis with a title and room for its labels."""
    return {"title": {"text": title}, "automargin": True, **more}


def base_layout(height: int, **more: Any) -> Plot:
    """Return the layout that all figures share."""
    return {
        "height": height,
        "margin": {"l": 56, "r": 12, "t": 12, "b": 44},
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
        "hovermode": "closest",
        **more,
    }
