"""Figures on a page: what plotly draws, as plain data. The library itself is not imported."""

from __future__ import annotations

import base64
import html
from collections.abc import Callable
from typing import Any

import numpy as np

from tumble.report.figures import record

Plot = dict[str, Any]
_STEPS = {"": "linear", "post": "hv", "mid": "hvh"}


def plot(figure: record.Figure) -> Plot:
    """Return a figure as the page's script reads it: name, data, layout, and what is drawn where nothing turns."""
    data: list[Plot] = []
    for mark in figure.marks:
        beside = {"xaxis": _name("x", mark.panel)} if len(figure.columns) > 1 else {}
        data += [trace | beside for trace in _TRACES[type(mark)](mark)]
    made: Plot = {"name": figure.name, "data": data, "layout": _layout(figure)}
    if figure.flat is not None:
        flat = plot(figure.flat)
        made["fallback"] = {key: flat[key] for key in ("data", "layout")}
    return made


def packed(values: np.ndarray) -> Plot:
    """Return an array as the library's packed float32: short, fast, and nan breaks the line."""
    data = np.ascontiguousarray(values, dtype="<f4")
    return {"dtype": "f4", "bdata": base64.b64encode(data.tobytes()).decode("ascii")}


def _text(text: str) -> str:
    """Text that the library shows as it is."""
    return html.escape(text, quote=False).replace("\n", "<br>")


def _listed(values: Any) -> list[Any]:
    """Numbers of an array to five digits, a list as it is, its texts escaped."""
    if isinstance(values, np.ndarray):
        return record.plain(values)
    return [_text(value) if isinstance(value, str) else value for value in values]


def _faint(colour: str, opacity: float) -> str:
    """A colour that lets through what lies below."""
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity})"


def _shared(mark: record.Mark) -> Plot:
    """What all traces have: names, axes, and what a pointer is told."""
    made: Plot = {"name": _text(mark.name)} if mark.name else {}
    made |= {} if mark.legend else {"showlegend": False}
    made |= {"legendgroup": mark.group} if mark.group else {}
    made |= {"yaxis": _name("y", mark.panel)} if mark.panel else {}
    words = [_text(word) for word in mark.words]
    if mark.hover:
        return made | {"hovertemplate": mark.hover} | ({"text": words} if words else {})
    if words:
        return made | {"hoverinfo": "text", "hovertext": words}
    return made | ({} if mark.hover is None else {"hoverinfo": "skip"})


def _sigma(sigma: Any, lying: bool) -> Plot:
    bars = {"type": "data", "array": _listed(sigma), "thickness": 1.5, "width": 4}
    return {"error_x" if lying else "error_y": bars} if len(sigma) else {}


def _points(mark: record.Points) -> list[Plot]:
    modes = (("lines", isinstance(mark, record.Curve)), ("markers", mark.symbol), ("text", mark.labels))
    mode = "+".join(word for word, there in modes if there)
    trace: Plot = {"type": "scatter", "mode": mode, **_shared(mark)}
    if isinstance(mark, record.Curve) and mark.step:
        trace |= {"x0": mark.x, "dx": mark.step, "y": packed(mark.y)}
    else:
        trace |= {"x": _listed(mark.x), "y": _listed(mark.y)}
        trace |= _sigma(mark.sigma, lying=bool(trace["y"]) and isinstance(trace["y"][0], str))
    if mark.z is not None:
        trace |= {"type": "scatter3d", "z": _listed(mark.z)}
    if isinstance(mark, record.Curve):
        trace["line"] = {"color": mark.colour, "width": mark.width, "dash": mark.dash or "solid"}
        trace |= {"line": trace["line"] | ({"shape": _STEPS[mark.steps]} if mark.steps else {})}
        trace |= {"opacity": mark.opacity} if mark.opacity < 1.0 else {}
    if mark.symbol:
        colour = mark.colour if isinstance(mark.colour, str) else list(mark.colour)
        look = {"color": colour, "size": mark.size, "symbol": mark.symbol, "opacity": mark.opacity}
        trace["marker"] = look | ({"line": {"width": 2, "color": colour}} if "thin" in mark.symbol else {})
    if mark.labels:
        trace |= {"text": list(mark.labels), "textposition": "top center" if mark.above else "middle center"}
        if not mark.symbol:
            # As many of them as there is room for, which the page's script decides.
            trace |= {} if mark.z is not None else {"meta": "numbers"}
            trace["textfont"] = {"size": mark.size} | ({"color": mark.colour} if mark.colour else {})
    return [trace]


def _band(mark: record.Band) -> list[Plot]:
    line = {"width": 0, "shape": _STEPS[mark.steps], "color": mark.colour}
    low, high = (
        {"type": "scatter", "mode": "lines", **_shared(mark), "x": _listed(mark.x), "y": _listed(y), "line": line}
        for y in mark.y
    )  # fmt: skip
    filled = {"fill": "tonexty", "fillcolor": _faint(str(mark.colour), mark.opacity)}
    return [{**low, "showlegend": False}, {**high, **filled}]


def _bars(mark: record.Bars) -> list[Plot]:
    look = {"color": mark.colour if isinstance(mark.colour, str) else list(mark.colour), "line": {"width": 0}}
    trace: Plot = {"type": "bar", **_shared(mark), "marker": look | {"opacity": mark.opacity}}
    trace |= {"orientation": "h"} if mark.lying else {}
    trace |= {"textposition": "none"} if "text" in trace else {}
    trace |= {"x": _listed(mark.x), "y": _listed(mark.y), **_sigma(mark.sigma, mark.lying)}
    if mark.base is not None:
        trace |= {"base": packed(mark.base), "x": packed(mark.x)}
    return [trace | ({"width": mark.width} if mark.width else {})]


def _map(mark: record.Map) -> list[Plot]:
    colours = [[0, record.LEAST], [0.5, _faint(*record.NOTHING)], [1, record.MOST]]
    trace: Plot = {"type": "heatmap", **_shared(mark), "x": _listed(mark.x), "y": _listed(mark.y)}
    trace |= {"z": mark.values, "zmin": -1, "zmax": 1, "colorscale": colours, "xgap": 1, "ygap": 1}
    return [trace | {"colorbar": {"thickness": 12, "len": 0.6, "title": {"text": ""}}}]


_TRACES: dict[type[record.Mark], Callable[[Any], list[Plot]]] = {
    record.Points: _points,
    record.Curve: _points,
    record.Band: _band,
    record.Bars: _bars,
    record.Map: _map,
    record.Spans: lambda _: [],
}


def _layout(figure: record.Figure) -> Plot:
    legend = {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0, "traceorder": "normal"}
    layout: Plot = {"height": figure.height, "legend": legend, "hovermode": "closest"}
    named = sum(bool(mark.legend and mark.name) for mark in figure.marks) > 1
    top = 12 if not figure.title else 52 if named else 34
    left, below = (any(axis.title for axis in axes) for axes in (figure.panels, figure.columns))
    layout["margin"] = {"l": 56 if left else 30, "r": 12, "t": top, "b": 44 if below else 30}
    if figure.title:
        layout["title"] = {"text": _text(figure.title), "font": {"size": 12}, "x": 0.02, "y": 0.97}
    if any(isinstance(mark, record.Points) and mark.z is not None for mark in figure.marks):
        return layout | _scene()
    if any(isinstance(mark, record.Bars) for mark in figure.marks):
        layout["barmode"] = "stack" if figure.stacked else "overlay"
    lowest = min(range(len(figure.panels)), key=lambda k: figure.panels[k].share[0])
    for k, axis in enumerate(figure.columns):
        layout[_name("xaxis", k)] = _axis(axis, anchor=_name("y", k or lowest), **_names_below(axis))
    for k, axis in enumerate(figure.panels):
        beside = _name("x", k if len(figure.columns) > 1 else 0)
        square = {"scaleanchor": beside} if figure.square else {}
        layout[_name("yaxis", k)] = _axis(axis, anchor=beside, **square)
    top = max(axis.share[1] for axis in figure.panels if not axis.hidden)
    spans = [mark for mark in figure.marks if isinstance(mark, record.Spans)]
    return layout | {"shapes": [shape for mark in spans for shape in _shapes(mark, top)]}


def _name(letter: str, k: int) -> str:
    return f"{letter}{k + 1 if k else ''}"


def _scene() -> Plot:
    hidden: Plot = {"visible": False, "range": [-1.3, 1.3], "showspikes": False}
    scene: Plot = {f"{name}axis": dict(hidden) for name in "xyz"}
    # Off the diagonal, so that no standard attitude hides behind another.
    scene |= {"aspectmode": "cube", "camera": {"eye": {"x": 0.98, "y": 0.64, "z": 0.52}}}
    return {"scene": scene, "margin": dict.fromkeys("lrtb", 0), "dragmode": "orbit"}


def _names_below(axis: record.Axis) -> Plot:
    return {"tickangle": -60} if axis.kind == "names" else {}


def _axis(axis: record.Axis, **more: Any) -> Plot:
    made: Plot = {"title": {"text": _text(axis.title)}, "automargin": True, **more}
    if axis.hidden:
        return made | {"visible": False, "fixedrange": True, "range": axis.span, "domain": axis.share}
    kind = {"linear": {}, "names": {"type": "category"}, "log": {"type": "log", "exponentformat": "power"}}
    made |= kind.get(axis.kind, {"type": axis.kind})
    made |= {"range": axis.span} if axis.span else {}
    made |= {"domain": axis.share} if axis.share != (0.0, 1.0) else {}
    made |= {} if axis.zero else {"zeroline": False}
    made |= {"autorange": "reversed"} if axis.downwards else {}
    made |= {"showticklabels": False, "showgrid": False} if axis.bare else {}
    if len(axis.ticks):
        return made | {"tickvals": record.plain(axis.ticks), "ticktext": [f"{tick:g}" for tick in axis.ticks]}
    made |= {"dtick": axis.every} if axis.every else {}
    made |= {"tickformat": "~g"} if isinstance(axis.every, str) else {}
    small = {"tickfont": {"size": 11}, "showgrid": False}
    return made | (small if axis.every and axis.kind == "names" else {})


def _shapes(mark: record.Spans, top: float) -> list[Plot]:
    along, across = ("y", "x") if mark.lying else ("x", "y")
    colours = [mark.colour] * len(mark.x) if isinstance(mark.colour, str) else mark.colour
    shapes: list[Plot] = []
    for first, last, colour in zip(mark.x, mark.y, colours, strict=True):
        places = {f"{along}0": first, f"{along}1": last, f"{across}0": 0, f"{across}1": top}
        look: Plot = {"type": "rect", "fillcolor": colour, "line": {"width": 0}, "opacity": mark.opacity}
        if first == last:
            look = {"type": "line", "line": {"dash": "dash", "width": 1, "color": colour}}
        shapes.append({**places, f"{along}ref": along, f"{across}ref": "paper", "layer": "below", **look})
    return shapes
