"""A figure as a record of plain data: axes with units, and what stands between them.

`on_page` makes of it what plotly draws, `on_paper` files by matplotlib. Text is plain here; a line break is one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from tumble.records import dataclass

Look = dict[str, Any]
"""Fields of a mark, by their names."""

BLUE, RED, GREEN, ORANGE, GREY, PURPLE = "#3b82d6", "#d6485b", "#2f9e6e", "#dd8a21", "#8b919c", "#8f63c9"
TEAL = "#12a5ad"
PALETTE = (BLUE, TEAL, GREEN, ORANGE, RED, PURPLE, GREY, "#9a6238", "#d678b4", "#b3a125")
AXIS_COLOURS = {"x": RED, "y": GREEN, "z": BLUE}
# Of three axes or angles the axes' own; of nine each another.
OF_FAMILY = (*AXIS_COLOURS.values(), *(one for one in PALETTE if one not in AXIS_COLOURS.values()))
# Of a map: least, nothing, most; what is nothing lets the page through.
LEAST, NOTHING, MOST = "#c8394d", (GREY, 0.1), "#2f6fc2"


def plain(values: Any, digits: int = 5) -> list[float | None]:
    """Return numbers with `digits` significant digits; what is not finite becomes None."""
    return [
        float(f"{value:.{digits}g}") if np.isfinite(value) else None
        for value in np.asarray(values, dtype=float)
    ]


def in_brackets(unit: str) -> str:
    """Return a unit as an axis divides by it: one that is a quotient itself stands in brackets."""
    return f"({unit})" if "/" in unit or " " in unit else unit


@dataclass(frozen=True)
class Axis:
    """What a figure has along one side.

    Attributes
    ----------
    title : words with the unit.
    kind : of what stands along it.
    span : first and last; None for what the figure holds.
    ticks : where it is marked; empty for as many places as there is room for.
    every : from mark to mark, 1 for each name or each power of ten, "D1" or "D2" for marks between those; 0 as above.
    zero : whether a line stands at zero.
    downwards : from top to bottom, as names below each other are read.
    bare, hidden : without marks and grid; not there at all.
    share : of the figure's height or width that it takes, from below or from the left.
    """

    title: str = ""
    kind: Literal["linear", "log", "date", "names"] = "linear"
    span: tuple[float, float] | None = None
    ticks: Sequence[float] = ()
    every: float | str = 0
    zero: bool = True
    downwards: bool = False
    bare: bool = False
    hidden: bool = False
    share: tuple[float, float] = (0.0, 1.0)


@dataclass(frozen=True)
class Mark:
    """What stands in a figure.

    Attributes
    ----------
    x, y : (n,) arrays, drawn to five digits, or lists as they are.
    name : in the legend.
    colour, opacity : the colour as #rrggbb, of all or of each.
    panel : number of the upright axis that it belongs to.
    legend, group : whether the legend names it, and with what else it is switched off.
    hover : what a pointer is told of a place, as plotly writes it; empty for nothing, None for its numbers.
    words : (n,) for `hover`, or instead of it.
    """

    x: Any
    y: Any
    name: str = ""
    colour: str | Sequence[str] = BLUE
    opacity: float = 1.0
    panel: int = 0
    legend: bool = True
    group: str = ""
    hover: str | None = None
    words: Sequence[str] = ()


@dataclass(frozen=True)
class Points(Mark):
    """Points with their standard uncertainties.

    Attributes
    ----------
    symbol, size : as plotly calls it, and in pixels; no symbol for labels alone.
    sigma : (n,) along the axis of numbers.
    labels, above : what stands at the points, or above them.
    z : (n,) of points in space.
    """

    symbol: str = "circle"
    size: float = 7.0
    sigma: Any = ()
    labels: Sequence[str] = ()
    above: bool = False
    z: Any = None


@dataclass(frozen=True)
class Curve(Points):
    """A line through points, which it shows if it has a symbol; None breaks it.

    Attributes
    ----------
    width, dash : in pixels, and as plotly calls it.
    steps : a value holds after its place ("post") or about it ("mid").
    step : from point to point, if they are so many that only the first one's `x` is given; 0 if all are.
    """

    symbol: str = ""
    width: float = 2.0
    dash: str = ""
    steps: Literal["", "post", "mid"] = ""
    step: float = 0.0


@dataclass(frozen=True)
class Band(Mark):
    """An area between two lines, which are `y`: the lower one and the upper one."""

    opacity: float = 0.15
    hover: str | None = ""
    steps: Literal["", "post", "mid"] = ""


@dataclass(frozen=True)
class Bars(Mark):
    """Bars up, or to the right where `lying`: then `y` has their places.

    Attributes
    ----------
    base : (n,) where they begin; None for zero, or the end of the bars before in a figure that is `stacked`.
    width : of each; 0 for as wide as there is room for.
    sigma : (n,) of their lengths.
    """

    lying: bool = False
    base: Any = None
    width: float = 0.0
    sigma: Any = ()


@dataclass(frozen=True)
class Map(Mark):
    """Numbers from −1 to 1 between the names `x` and `y`, as colours: `values`, a row for each of `y`."""

    values: Sequence[Sequence[float | None]] = ()


@dataclass(frozen=True)
class Spans(Mark):
    """Stretches from `x` to `y` behind the rest, through all panels, or through one where they are `lying`.

    Where both ends are one it is a line to compare with.
    """

    lying: bool = False


@dataclass(frozen=True)
class Figure:
    """One figure.

    Attributes
    ----------
    name : identifier in the page, and of the file.
    label : what a screen reader says.
    marks : in the order in which they are drawn.
    x, y : axes. Several of `y` are panels above one another; several of `x`, too, stand side by side.
    height : in pixels.
    title : above it.
    stacked : bars stand upon one another.
    square : both axes have one measure.
    flat : what is drawn where three dimensions cannot be.
    least_width, most_width : pixels below which it scrolls sideways instead of shrinking, and beyond
        which it does not grow; 0 for no limit.
    """

    name: str
    label: str
    marks: Sequence[Mark]
    x: Axis | Sequence[Axis]
    y: Axis | Sequence[Axis]
    height: int
    title: str = ""
    stacked: bool = False
    square: bool = False
    flat: Figure | None = None
    least_width: int = 0
    most_width: int = 0

    @property
    def columns(self) -> Sequence[Axis]:
        """The axes from left to right."""
        return [self.x] if isinstance(self.x, Axis) else self.x

    @property
    def panels(self) -> Sequence[Axis]:
        """The upright axes."""
        return [self.y] if isinstance(self.y, Axis) else self.y
