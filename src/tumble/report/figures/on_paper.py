"""Figures as files for a paper, by matplotlib: PDF, SVG or PNG, one column wide, fonts embedded."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable
from importlib import import_module
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from tumble.errors import UsageError, install
from tumble.files import make_folder, written_beside
from tumble.report.figures import record

FORMS = ("pdf", "svg", "png")
COLUMN = 3.46
"""Inches: the column of most journals, 88 mm."""
_PIXELS = 190.0
"""Of a page's figure that are an inch of a paper's."""
_SYMBOLS = {"square": "s", "diamond": "D", "cross": "P", "x": "x", "triangle-up": "^", "triangle-down": "v"}
_DASHES = {"dash": (0, (5, 2)), "dot": (0, (1, 1.5)), "dashdot": (0, (5, 2, 1, 2))}


def write_figures(figures: Iterable[record.Figure], folder: Path, form: str) -> list[Path]:
    """Draw figures, each as a file NAME.form in a folder; return the files.

    Parameters
    ----------
    figures : of a page.
    folder : is made if there is none.
    form : of `FORMS`.

    Raises
    ------
    UsageError
        If the form is unknown, or matplotlib is not installed.
    OutputError
        If a file cannot be written.
    """
    if form not in FORMS:
        raise UsageError(f"--figures {form}: give one of {', '.join(FORMS)}.")
    made: list[Path] = []
    for figure in figures:
        make_folder(folder)
        with written_beside(folder / f"{figure.name}.{form}") as beside:
            beside.write_bytes(draw(figure, form))
        made.append(folder / f"{figure.name}.{form}")
    return made


def require_library() -> None:
    """Refuse before minutes of work that no figure can be drawn.

    Raises
    ------
    UsageError
        If matplotlib is not installed.
    """
    if find_spec("matplotlib") is None:
        raise UsageError(f"--figures needs matplotlib: {install('figures')}.")


def draw(figure: record.Figure, form: str) -> bytes:
    """Return a figure as a file holds it, flat where the page has three dimensions.

    Parameters
    ----------
    figure : of a page.
    form : of `FORMS`.

    Raises
    ------
    UsageError
        If matplotlib is not installed.
    """
    require_library()
    flat = figure.flat or figure
    style: Any = import_module("matplotlib.style")
    with style.context(files("tumble.report") / "templates" / "paper.mplstyle"):
        from matplotlib.figure import Figure as Picture

        picture: Any = Picture(figsize=(COLUMN, float(np.clip(flat.height / _PIXELS, 1.2, 8.0))))
        axes = _axes(picture, flat)
        ends: dict[int, Any] = {}
        for mark in flat.marks:
            if isinstance(mark, record.Bars) and flat.stacked:
                base = ends.setdefault(mark.panel, 0.0)
                ends[mark.panel] = base + np.nan_to_num(_values(mark.x if mark.lying else mark.y))
                _bars(axes[mark.panel], mark, base)
            elif isinstance(mark, record.Spans):
                _spans([axes[mark.panel]] if mark.lying else axes, mark)
            else:
                _DRAWN[type(mark)](axes[mark.panel], mark)
        _legend(picture, axes)
        # Of its axes, not of the sheet: there stands the legend.
        axes[0].set_title(_text(flat.title))
        out = io.BytesIO()
        dateless = {"pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": {}}[form]
        picture.savefig(out, format=form, metadata=dateless)
    return out.getvalue()


def _axes(picture: Any, figure: record.Figure) -> list[Any]:
    """The axes of each panel, set up: side by side, or from top to bottom as their shares lie."""
    panels, columns = figure.panels, figure.columns
    sizes = [max(axis.share[1] - axis.share[0], 0.02) for axis in panels]
    order = sorted(range(len(panels)), key=lambda k: -panels[k].share[0])
    if len(columns) > 1:
        made = picture.subplots(1, len(columns), squeeze=False)[0]
    else:
        ratios = [sizes[k] for k in order]
        stacked = picture.subplots(len(panels), 1, sharex=True, squeeze=False, height_ratios=ratios)
        made = [stacked[order.index(k), 0] for k in range(len(panels))]
    for k, one in enumerate(made):
        beside = len(columns) > 1
        _set_up(one, "x", columns[k if beside else 0], titled=beside or k == order[-1])
        _set_up(one, "y", panels[k])
        if figure.square:
            one.set_aspect("equal")
    return list(made)


def _set_up(one: Any, way: str, axis: record.Axis, *, titled: bool = True) -> None:
    """Title, scale, span and ticks of one axis."""
    if axis.kind == "log":
        getattr(one, f"set_{way}scale")("log")
    if titled:
        getattr(one, f"set_{way}label")(_text(axis.title))
    if axis.span:
        getattr(one, f"set_{way}lim")(axis.span)
        if isinstance(axis.every, int | float) and axis.every and axis.kind == "linear":
            from matplotlib.ticker import MultipleLocator

            getattr(one, f"{way}axis").set_major_locator(MultipleLocator(axis.every))
    if len(axis.ticks):
        getattr(one, f"set_{way}ticks")(axis.ticks, [f"{tick:g}" for tick in axis.ticks])
        if axis.kind == "log":
            getattr(one, f"{way}axis").minorticks_off()
    if axis.downwards:
        getattr(one, f"invert_{way}axis")()
    if axis.bare:
        one.grid(visible=False, axis=way)
        one.tick_params(axis=way, length=0, **{"labelbottom" if way == "x" else "labelleft": False})
    if axis.hidden:
        one.set_axis_off()


def _values(given: Any) -> np.ndarray:
    """Numbers, names or days as matplotlib takes them."""
    if any(isinstance(value, str) for value in given):
        return np.array([_text(value) for value in given])
    return np.array([np.nan if value is None else value for value in given], dtype=float)


def _text(text: str) -> str:
    return text.replace("$", r"\$")


def _colour(given: str | Iterable[str], opacity: float = 1.0) -> Any:
    """A colour, or one for each point."""
    from matplotlib.colors import to_rgba

    if isinstance(given, str):
        return to_rgba(given or "#1d2129", opacity)
    return [to_rgba(one, opacity) for one in given]


def _label(mark: record.Mark) -> str:
    return _text(mark.name) if mark.legend and mark.name else "_"


def _points(one: Any, mark: record.Points) -> None:
    """A line, points with their uncertainties, or texts."""
    y, label, colour = _values(mark.y), _label(mark), _colour(mark.colour, mark.opacity)
    step = mark.step if isinstance(mark, record.Curve) else 0.0
    x = mark.x + step * np.arange(y.size) if step else _values(mark.x)
    if isinstance(mark, record.Curve):
        one.plot(
            x, y, color=colour, linewidth=0.55 * mark.width, linestyle=_DASHES.get(mark.dash, "-"), label=label,
            drawstyle=f"steps-{mark.steps}" if mark.steps else "default",
        )  # fmt: skip
        label = "_"
    if len(mark.sigma):
        way = "yerr" if y.dtype.kind == "f" else "xerr"
        spread: dict[str, Any] = {way: _values(mark.sigma)}
        one.errorbar(x, y, **spread, fmt="none", elinewidth=0.7, capsize=1.5, ecolor=colour)
    if mark.symbol:
        hollow, symbol = mark.symbol.endswith("-open"), mark.symbol.removesuffix("-open")
        look = (
            {"facecolors": "none", "edgecolors": colour, "linewidths": 0.6} if hollow else {"color": colour}
        )
        look |= {"linewidths": 0.7} if symbol.startswith("x") else {}
        kind = _SYMBOLS.get(symbol.removesuffix("-thin"), "o")
        one.scatter(x, y, s=(0.45 * mark.size) ** 2, marker=kind, label=label, zorder=3, **look)
    for at, height, words in zip(x, y, mark.labels, strict=False):
        place = {"ha": "center", "va": "bottom" if mark.above else "center", "clip_on": True}
        inked = "#1d2129" if mark.symbol else _colour(mark.colour)
        one.annotate(_text(words), (at, height), fontsize=4.5, color=inked, **place)
    if y.dtype.kind != "f" and one.yaxis_inverted():
        _names(one)


def _names(one: Any) -> None:
    """Names one below the other, smaller where there are many."""
    few = len(one.get_yticks()) < 10
    one.margins(y=0.12 if few else 0.02)
    one.tick_params(axis="y", labelsize=7 if few else 5)


def _band(one: Any, mark: record.Band) -> None:
    x, colour = _values(mark.x), _colour(mark.colour, mark.opacity)
    low, high = map(_values, mark.y)
    one.fill_between(x, low, high, color=colour, linewidth=0.0, step=mark.steps or None, label=_label(mark))


def _bars(one: Any, mark: record.Bars, base: Any = 0.0) -> None:
    x, y, colour = _values(mark.x), _values(mark.y), _colour(mark.colour, mark.opacity)
    places, lengths = (y, x) if mark.lying else (x, y)
    base = base if mark.base is None else mark.base
    apart = np.diff(np.unique(places)) if places.dtype.kind == "f" else np.zeros(0)
    thick = mark.width or (0.8 * float(apart.min()) if apart.size else 0.7)
    look: dict[str, Any] = {"color": colour, "label": _label(mark)}
    if len(mark.sigma):
        look |= {"xerr" if mark.lying else "yerr": _values(mark.sigma), "error_kw": {"elinewidth": 0.7}}
    if mark.lying:
        one.barh(places, lengths, height=thick, left=base, **look)
        _names(one) if places.dtype.kind != "f" else None
    else:
        one.bar(places, lengths, width=thick, bottom=base, **look)


def _map(one: Any, mark: record.Map) -> None:
    from matplotlib.colors import LinearSegmentedColormap

    stops = [(0.0, _colour(record.LEAST)), (0.5, _colour(*record.NOTHING)), (1.0, _colour(record.MOST))]
    colours = LinearSegmentedColormap.from_list("page", stops)
    rows = [_values(row) for row in mark.values]
    shown = one.imshow(rows, cmap=colours, vmin=-1, vmax=1, aspect="auto", interpolation="none")
    one.grid(visible=False)
    one.set_xticks(range(len(mark.x)), [_text(name) for name in mark.x], rotation=90, fontsize=4.5)
    one.set_yticks(range(len(mark.y)), [_text(name) for name in mark.y], fontsize=4.5)
    one.figure.colorbar(shown, ax=one, shrink=0.5, pad=0.02)


_DRAWN: dict[type[record.Mark], Callable[[Any, Any], None]] = {
    record.Points: _points,
    record.Curve: _points,
    record.Band: _band,
    record.Bars: _bars,
    record.Map: _map,
}


def _spans(axes: list[Any], mark: record.Spans) -> None:
    """Lines and areas to compare with."""
    colours = [mark.colour] * len(mark.x) if isinstance(mark.colour, str) else mark.colour
    for one in axes:
        for first, last, colour in zip(mark.x, mark.y, colours, strict=True):
            if not one.axison:
                continue
            if first == last:
                line = one.axhline if mark.lying else one.axvline
                line(first, color=colour, linewidth=0.6, linestyle=_DASHES["dash"])
            else:
                area = one.axhspan if mark.lying else one.axvspan
                area(first, last, color=_colour(colour, mark.opacity), linewidth=0.0, zorder=0)


def _legend(picture: Any, axes: list[Any]) -> None:
    """One legend above the figure, each name once."""
    known: dict[str, Any] = {}
    for one in axes:
        for handle, name in zip(*one.get_legend_handles_labels(), strict=True):
            known.setdefault(name, handle)
    if len(known) > 1:
        columns = min(len(known), max(1, int(66 / (max(map(len, known)) + 6))))
        picture.set_figheight(picture.get_figheight() + 0.12 * -(-len(known) // columns))
        picture.legend(
            known.values(), known.keys(), loc="outside upper center", ncols=columns, fontsize=6,
            handlelength=1.2, columnspacing=1.0,
        )  # fmt: skip
