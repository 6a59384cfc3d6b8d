"""The figures of a page as files for a paper: PDF, SVG or PNG, one column wide, fonts embedded.

A page carries its figures as data (`report.html`), and so every page that tumble writes can be drawn again.
"""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, cast

import numpy as np

from tumble.errors import UsageError, install
from tumble.files import make_folder, written_beside
from tumble.report.html import figures_of
from tumble.report.page import Plot

FORMS = ("pdf", "svg", "png")
COLUMN = 3.46
"""Inches: the column of most journals, 88 mm."""
_PIXELS = 190.0
"""Of a page's figure that are an inch of a paper's."""
_STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 7.0,
    "axes.linewidth": 0.5,
    "axes.titlesize": 7.0,
    "axes.grid": True,
    "grid.linewidth": 0.3,
    "grid.color": "#d5d8dd",
    "axes.axisbelow": True,
    "xtick.major.width": 0.5,
    "ytick.major.width": 0.5,
    "legend.frameon": False,
    "pdf.fonttype": 42,
    "svg.fonttype": "path",
    "svg.hashsalt": "tumble",
    "savefig.dpi": 600,
    "figure.constrained_layout.use": True,
}
_SYMBOLS = {
    "square": "s",
    "diamond": "D",
    "cross": "P",
    "x": "x",
    "x-thin": "x",
    "triangle-up": "^",
    "triangle-down": "v",
}
_DASHES = {"dash": (0, (5, 2)), "dot": (0, (1, 1.5)), "dashdot": (0, (5, 2, 1, 2))}
_STEPS = {"hv": "steps-post", "hvh": "steps-mid"}


def draw_page(path: Path, form: str) -> list[Path]:
    """Draw the figures of a page beside it, each as a file NAME.form in a folder ``figures``; return the files.

    Parameters
    ----------
    path : of a page that tumble wrote.
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
    folder = path.parent / "figures"
    made: list[Path] = []
    for name, picture in draw_figures(path.read_text(encoding="utf-8"), form).items():
        make_folder(folder)
        with written_beside(folder / name) as beside:
            beside.write_bytes(picture)
        made.append(folder / name)
    return made


def draw_figures(page: str, form: str) -> dict[str, bytes]:
    """Return the figures of a page, drawn, by the names of their files.

    Parameters
    ----------
    page : HTML that tumble wrote.
    form : of `FORMS`.

    Raises
    ------
    UsageError
        If matplotlib is not installed.
    """
    return {f"{plot['name']}.{form}": _drawn(plot, form) for plot in figures_of(page)}


def require_library() -> None:
    """Refuse before minutes of work that no figure can be drawn.

    Raises
    ------
    UsageError
        If matplotlib is not installed.
    """
    if find_spec("matplotlib") is None:
        raise UsageError(f"--figures needs matplotlib: {install('figures')}.")


def _drawn(plot: Plot, form: str) -> bytes:
    """One figure, flat where the page has three dimensions."""
    import io

    require_library()
    library: Any = import_module("matplotlib")
    with library.rc_context(_STYLE):
        from matplotlib.figure import Figure

        flat = plot.get("fallback") or plot
        layout = flat["layout"]
        picture: Any = Figure(figsize=(COLUMN, float(np.clip(layout["height"] / _PIXELS, 1.2, 8.0))))
        axes = _axes(picture, layout)
        stacked: dict[str, Any] = {}
        for trace in flat["data"]:
            _add(axes, trace, layout, stacked)
        for name, one in axes.items():
            _set_up(one, layout, "x", layout.get("xaxis", {}), last=one is list(axes.values())[-1])
            _set_up(one, layout, "y", layout.get(_long(name), {}), last=True)
        _shapes(axes, layout)
        _legend(picture, axes, layout)
        if title := _text(layout.get("title", {}).get("text", "")):
            picture.suptitle(title, fontsize=7)
        out = io.BytesIO()
        dateless = {"pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": {}}[form]
        picture.savefig(out, format=form, metadata=dateless)
    return out.getvalue()


def _long(name: str) -> str:
    return f"yaxis{name[1:]}"


def _axes(picture: Any, layout: Plot) -> dict[str, Any]:
    """Axes by their short name (y, y2, …), from top to bottom as their domains lie."""
    names = sorted(
        (f"y{key[5:]}" for key in layout if re.fullmatch(r"yaxis\d*", key)),
        key=lambda name: -layout[_long(name)].get("domain", [0.0, 1.0])[0],
    ) or ["y"]
    spans = [layout.get(_long(name), {}).get("domain", [0.0, 1.0]) for name in names]
    made = picture.subplots(
        len(names), 1, sharex=True, squeeze=False, height_ratios=[max(b - a, 0.02) for a, b in spans]
    )
    return {name: made[k, 0] for k, name in enumerate(names)}


def _add(axes: dict[str, Any], trace: Plot, layout: Plot, stacked: dict[str, Any]) -> None:
    """Draw one trace into its axes."""
    one = axes[trace.get("yaxis", "y")]
    if trace["type"] == "bar":
        _bars(one, trace, layout, stacked)
    elif trace["type"] == "heatmap":
        _heatmap(one, trace)
    else:
        _points(one, trace)


def _values(given: Any) -> np.ndarray:
    """Numbers of a trace, packed or listed, or its categories."""
    if isinstance(given, dict):
        told = cast("Plot", given)
        return np.frombuffer(base64.b64decode(told["bdata"]), dtype=f"<{told['dtype']}").astype(float)
    if any(isinstance(value, str) for value in given):
        return np.array([_text(str(value)) for value in given])
    return np.array([np.nan if value is None else value for value in given], dtype=float)


def _text(text: str) -> str:
    """Plain text of a label that may hold the page's markup."""
    return html.unescape(re.sub(r"<[^>]*>", "", text.replace("<br>", "\n"))).replace("$", r"\$")


def _colour(given: Any, opacity: float = 1.0) -> Any:
    """A colour of the page, or one for each point."""
    if isinstance(given, list):
        return [_colour(one, opacity) for one in cast("list[Any]", given)]
    if isinstance(given, str) and (parts := re.fullmatch(r"rgba?\(([^)]*)\)", given)):
        red, green, blue, *rest = (float(part) for part in parts[1].split(","))
        return (red / 255.0, green / 255.0, blue / 255.0, (rest[0] if rest else 1.0) * opacity)
    from matplotlib.colors import to_rgba

    return to_rgba(given or "#3b82d6", opacity)


def _label(trace: Plot) -> str:
    shown = trace.get("showlegend", True) and trace.get("name")
    return _text(trace["name"]) if shown else "_"


def _points(one: Any, trace: Plot) -> None:
    """A line, points with their uncertainties, or texts."""
    y, mode = _values(trace["y"]), trace.get("mode", "lines")
    x = (
        _values(trace["x"])
        if "x" in trace
        else trace.get("x0", 0.0) + trace.get("dx", 1.0) * np.arange(y.size)
    )
    line, marker, label = trace.get("line", {}), trace.get("marker", {}), _label(trace)
    opacity = float(trace.get("opacity", 1.0))
    if "fill" in trace and trace["fill"] != "none":
        _fill(one, trace, x, y, label)
        label = "_"
    if "lines" in mode and line.get("width", 1.0) > 0.0:
        one.plot(
            x, y, color=_colour(line.get("color"), opacity), linewidth=0.55 * line.get("width", 1.5),
            linestyle=_DASHES.get(line.get("dash", ""), "-"), label=label,
            drawstyle=_STEPS.get(line.get("shape", ""), "default"),
        )  # fmt: skip
        label = "_"
    one._tumble_edge = (x, y)  # what the next trace may fill up to
    for way in ("error_x", "error_y"):
        if way in trace:
            spread = _values(trace[way]["array"])
            one.errorbar(
                x, y, **{way.replace("error_", "") + "err": spread}, fmt="none", elinewidth=0.7, capsize=1.5,
                ecolor=_colour(trace[way].get("color") or _first(marker.get("color"))),
            )  # fmt: skip
    if "markers" in mode:
        _markers(one, {"color": line.get("color"), **marker}, x, y, opacity, label)
    if "text" in mode:
        _texts(one, trace, x, y)


def _first(colour: Any) -> Any:
    return cast("list[Any]", colour)[0] if isinstance(colour, list) else colour


def _markers(one: Any, marker: Plot, x: np.ndarray, y: np.ndarray, opacity: float, label: str) -> None:
    symbol = _first(marker.get("symbol", "circle"))
    hollow, size = symbol.endswith("-open"), marker.get("size", 6)
    colour = _colour(marker.get("color"), opacity * float(marker.get("opacity", 1.0)))
    area = (0.45 * np.asarray(size, dtype=float)) ** 2
    look = {"facecolors": "none", "edgecolors": colour, "linewidths": 0.6} if hollow else {"color": colour}
    if symbol.startswith("x"):
        look |= {"linewidths": 0.7}
    one.scatter(
        x, y, s=area, marker=_SYMBOLS.get(symbol.removesuffix("-open"), "o"), label=label, zorder=3, **look
    )


def _texts(one: Any, trace: Plot, x: np.ndarray, y: np.ndarray) -> None:
    place = trace.get("textposition", "middle center")
    up = {"top": "bottom", "bottom": "top"}.get(place.split()[0], "center")
    colour = _colour(trace.get("textfont", {}).get("color", "#1d2129"))
    texts: Sequence[Any] = trace["text"] if isinstance(trace.get("text"), list) else []
    for at, height, words in zip(x, y, texts, strict=False):
        if words:
            one.annotate(
                _text(str(words)), (at, height), ha="center", va=up, fontsize=4.5, color=colour, clip_on=True
            )


def _fill(one: Any, trace: Plot, x: np.ndarray, y: np.ndarray, label: str) -> None:
    """An area: of a closed line, down to zero, or to the line before."""
    colour = _colour(trace.get("fillcolor") or trace.get("line", {}).get("color"))
    step = {"hv": "post", "hvh": "mid"}.get(trace.get("line", {}).get("shape", ""))
    if trace["fill"] == "toself":
        parts = np.flatnonzero(np.isnan(x.astype(float)) | np.isnan(y))
        for k, (a, b) in enumerate(zip([0, *(parts + 1)], [*parts, x.size], strict=True)):
            one.fill(x[a:b], y[a:b], color=colour, linewidth=0.0, label=label if k == 0 else "_")
        return
    below: Any = 0.0
    if trace["fill"] == "tonexty":
        _, below = getattr(one, "_tumble_edge", (x, np.zeros_like(y)))
    one.fill_between(x, y, below, color=colour, linewidth=0.0, step=step, label=label)


def _bars(one: Any, trace: Plot, layout: Plot, stacked: dict[str, Any]) -> None:
    """Bars up or to the right, upon those before where the figure stacks them."""
    lying, marker = trace.get("orientation") == "h", trace.get("marker", {})
    places, lengths = _values(trace["y" if lying else "x"]), _values(trace["x" if lying else "y"])
    key = f"{trace.get('yaxis', 'y')}"
    base: Any = _values(trace["base"]) if "base" in trace else 0.0
    if layout.get("barmode") in ("stack", "relative"):
        base = stacked.get(key, np.zeros(lengths.size))
        stacked[key] = base + np.nan_to_num(lengths)
    apart = np.diff(np.unique(places)) if places.dtype.kind == "f" else np.zeros(0)
    usual = 0.8 * float(apart.min()) if apart.size else 0.7
    thick = trace.get("width", usual)
    opacity = float(trace.get("opacity", 1.0)) * float(marker.get("opacity", 1.0))
    look = {"color": _colour(marker.get("color"), opacity), "label": _label(trace)}
    if lying:
        one.barh(places, lengths, height=thick, left=base, **look)
    else:
        one.bar(places, lengths, width=thick, bottom=base, **look)


def _heatmap(one: Any, trace: Plot) -> None:
    """A map of numbers between two sets of names."""
    from matplotlib.colors import LinearSegmentedColormap

    rows = [[np.nan if v is None else v for v in row] for row in trace["z"]]
    stops = [(at, _colour(colour)) for at, colour in trace["colorscale"]]
    colours = LinearSegmentedColormap.from_list("page", stops)
    shown = one.imshow(
        rows,
        cmap=colours,
        vmin=trace.get("zmin"),
        vmax=trace.get("zmax"),
        aspect="auto",
        interpolation="none",
    )
    one.grid(visible=False)
    one.set_xticks(
        range(len(trace["x"])), [_text(str(name)) for name in trace["x"]], rotation=90, fontsize=4.5
    )
    one.set_yticks(range(len(trace["y"])), [_text(str(name)) for name in trace["y"]], fontsize=4.5)
    one.figure.colorbar(shown, ax=one, shrink=0.5, pad=0.02)


def _set_up(one: Any, layout: Plot, way: str, axis: Plot, *, last: bool) -> None:
    """Title, scale, range and ticks of one axis as the page has them."""
    given: Any = axis.get("title", "")
    name = str(given if isinstance(given, str) else given.get("text", ""))
    if axis.get("type") == "log":
        getattr(one, f"set_{way}scale")("log")
    if last:
        getattr(one, f"set_{way}label")(_text(name))
    if "range" in axis:
        limits = [10.0**v if axis.get("type") == "log" else v for v in axis["range"]]
        getattr(one, f"set_{way}lim")(limits)
        if "dtick" in axis and axis.get("type") != "log":
            from matplotlib.ticker import MultipleLocator

            getattr(one, f"{way}axis").set_major_locator(MultipleLocator(axis["dtick"]))
    if axis.get("tickvals") is not None:
        texts = [_text(str(t)) for t in axis.get("ticktext", axis["tickvals"])]
        getattr(one, f"set_{way}ticks")(axis["tickvals"], texts)
        if axis.get("type") == "log":
            getattr(one, f"{way}axis").minorticks_off()
            if "range" not in axis:
                one.autoscale(axis=way)
    if axis.get("autorange") == "reversed" and not getattr(one, f"{way}axis_inverted")():
        getattr(one, f"invert_{way}axis")()
    if not axis.get("showgrid", True):
        one.grid(visible=False, axis=way)
    if not axis.get("showticklabels", True):
        one.tick_params(axis=way, length=0, **{"labelbottom" if way == "x" else "labelleft": False})
    if axis.get("scaleanchor"):
        one.set_aspect("equal")
    if axis.get("autorange") == "reversed" and "dtick" not in axis:  # names, one below the other
        one.margins(**{way: 0.12 if len(one.get_yticks()) < 10 else 0.02})
        one.tick_params(axis=way, labelsize=7 if len(one.get_yticks()) < 10 else 5)
    if axis.get("visible") is False:
        one.set_axis_off()


def _shapes(axes: dict[str, Any], layout: Plot) -> None:
    """Lines and areas to compare with, in the axes that they refer to, or through all."""
    for shape in layout.get("shapes", []):
        for name, one in axes.items():
            if shape.get("yref", "y") not in ("paper", name) or not one.axison:
                continue
            colour = shape.get("fillcolor") or shape.get("line", {}).get("color", "#8b919c")
            opacity = float(shape.get("opacity", 1.0))
            across = shape.get("xref") == "paper"
            if shape["type"] == "rect":
                area = one.axhspan if across else one.axvspan
                ends = ("y0", "y1") if across else ("x0", "x1")
                area(shape[ends[0]], shape[ends[1]], color=_colour(colour, opacity), linewidth=0.0, zorder=0)
                continue
            dash = _DASHES.get(shape.get("line", {}).get("dash", ""), "-")
            draw, at = (
                (one.axhline, shape["y0"])
                if shape.get("yref", "y") != "paper"
                else (one.axvline, shape["x0"])
            )
            draw(at, color=_colour(colour, opacity), linewidth=0.6, linestyle=dash)


def _legend(picture: Any, axes: dict[str, Any], layout: Plot) -> None:
    """One legend above the figure, each name once."""
    if not layout.get("showlegend", True):
        return
    known: dict[str, Any] = {}
    for one in axes.values():
        for handle, name in zip(*one.get_legend_handles_labels(), strict=True):
            known.setdefault(name, handle)
    if len(known) > 1:
        columns = min(len(known), max(1, int(66 / (max(map(len, known)) + 6))))
        picture.set_figheight(picture.get_figheight() + 0.12 * -(-len(known) // columns))
        picture.legend(
            known.values(), known.keys(), loc="outside upper center", ncols=columns, fontsize=6,
            handlelength=1.2, columnspacing=1.0,
        )  # fmt: skip
