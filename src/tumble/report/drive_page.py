"""A calibration's worth on a drive as one HTML page that works offline: drift, outages, what the filter says."""

from __future__ import annotations

import html
import math
from typing import Any

from tumble.report.figure import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    RED,
    Figure,
    Plot,
    base_layout,
    plain,
    text_axis,
)

_STYLE = """
main { max-width: 1100px; }
table.drive td, table.drive th { padding-right: 1.2rem; text-align: right; }
table.drive td:first-child, table.drive th:first-child { text-align: left; }
table.drive { margin-bottom: 1.5rem; }
.verdict { font-size: 1.3rem; font-weight: 600; }
p code { white-space: pre-wrap; overflow-wrap: anywhere; }
"""
# Curves that lie close are told apart by more than their colours.
_LOOKS = (
    (RED, "solid", "circle"),
    (ORANGE, "dot", "square"),
    (PURPLE, "dash", "diamond"),
    (GREEN, "dashdot", "triangle-up"),
    (BLUE, "solid", "x"),
    (GREY, "dot", "cross"),
)
# And stand beside one another: each is moved by this share of a length.
_APART = 0.02
_DRIFT = (
    "Free inertial drift: position, velocity and attitude are known at the start, then the sensors are alone. "
    "Horizontal rms over all starts of the drive; bars are standard uncertainties by a block bootstrap."
)
_SHARES = (
    "The same over the drift of the uncalibrated samples from the same starts: below 1 the calibration helps. What is "
    "hard to navigate in this drive cancels, so that the bars are shorter."
)
_SLIDING = (
    "Outages one by one, error over that of the uncalibrated samples: the filter has had all positions before each. It "
    "has estimated the sensors' errors by then as far as the drive shows them: less is left for the calibration."
)
_GAPS = (
    "Outages again and again, with one position between, error over that of the uncalibrated samples: the filter "
    "learns less, the calibration is worth more."
)


def render_drive(document: dict[str, Any], command: str) -> str:
    """Return the page.

    Parameters
    ----------
    document : as `tumble.workflows.drive_document.drive_document` makes it.
    command : how to make it again.
    """
    from tumble.report.html import standalone_page

    variants = document["variants"]
    figures = [
        (_drift_figure(variants), _DRIFT),
        (_share_figure("shares", variants, "drift", "s since the start"), _SHARES),
        (_share_figure("sliding", variants, "outages_sliding", "s without positions"), _SLIDING),
        (_share_figure("repeated", variants, "outages_repeated", "s without positions"), _GAPS),
    ]
    title = f"Verification of a calibration by the drive {document['recording']}"
    word = "Serves" if document["fit"] else "Does not serve"
    first, *others = figures
    body = (
        f"<style>{_STYLE}</style><h1>{html.escape(title)}</h1>"
        + _place(*first)
        + f'<p class="verdict">{word}</p>{_listed(document["reasons"])}'
        + "<h2>Which error costs how many metres</h2>"
        + _table(variants)
        + _outage_table(variants)
        + "<p>± is the standard uncertainty within this drive. Another drive differs by more.</p>"
        + "".join(_place(*figure) for figure in others)
        + "<h2>How it was compared</h2>"
        + _listed([document["time_offset"]["words"], document["alignment"], *document["setting"]])
        + ("<h2>What was noticed</h2>" + _listed(document["remarks"]) if document["remarks"] else "")
        + f"<p>Again: <code>{html.escape(command)}</code></p>"
    )
    return standalone_page(title, body, [figure.as_dict() for figure, _ in figures])


def metres(number: dict[str, float | None], unit: str = " m") -> str:
    """Return a number with its standard uncertainty, to two digits of that.

    Parameters
    ----------
    number : value and standard_uncertainty, or nulls.
    unit : to stand behind.
    """
    value, sigma = number["value"], number["standard_uncertainty"]
    if value is None:
        return "–"
    if sigma is None or sigma <= 0.0:
        return f"{value:.2g}{unit}"
    digits = max(0, 1 - math.floor(math.log10(sigma)))
    return f"{value:,.{digits}f} ± {sigma:,.{digits}f}{unit}"


def _table(variants: list[dict[str, Any]]) -> str:
    last = variants[0]["drift"][-1]["seconds"]
    heads = ["corrected by", f"free drift, {last:g} s, m", "over uncalibrated", "class", "innovations"]
    rows = [
        [
            variant["name"],
            metres(variant["drift"][-1]["horizontal_rms"], ""),
            metres(variant["drift"][-1]["ratio_to_uncalibrated"], ""),
            variant["accuracy_class"].partition(" ")[0],
            f"{variant['innovations']:.2f}",
        ]
        for variant in variants
    ]
    return _laid_out(heads, rows)


def _outage_table(variants: list[dict[str, Any]]) -> str:
    """Both kinds of outages in metres, a row for each variant and kind."""
    kinds = (("outages_sliding", "one by one"), ("outages_repeated", "again and again"))
    heads = ["outages, m", *(f"{one['seconds']:g} s" for one in variants[0]["outages_sliding"])]
    rows = [
        [f"{variant['name']}, {word}", *(metres(one["horizontal_rms"], "") for one in variant[key])]
        for key, word in kinds
        for variant in variants
    ]
    return _laid_out(heads, rows)


def _laid_out(heads: list[str], rows: list[list[str]]) -> str:
    head = "".join(f"<th>{html.escape(word)}</th>" for word in heads)
    lines = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    table = f'<table class="drive"><thead><tr>{head}</tr></thead><tbody>{lines}</tbody></table>'
    return f'<div class="scroll">{table}</div>'


def _drift_figure(variants: list[dict[str, Any]]) -> Figure:
    data = [
        _curve(variant, at, [(one["seconds"], one["horizontal_rms"]) for one in variant["drift"]], " m")
        for at, variant in enumerate(variants)
    ]
    upright = text_axis("horizontal rms, m", type="log", exponentformat="power", dtick=1)
    return Figure(
        "drift",
        "Free inertial drift with and without the calibration",
        data,
        _layout("s since the start", upright, 400),
    )


def _share_figure(name: str, variants: list[dict[str, Any]], key: str, across: str) -> Figure:
    """Errors over those of the first variant, which is uncalibrated, by their length."""
    data = [
        _curve(
            variant, at, [(one["seconds"], one["ratio_to_uncalibrated"]) for one in variant[key]], " of it"
        )
        for at, variant in enumerate(variants)
        if at
    ]
    upright = text_axis("over uncalibrated")
    words = {"shares": "Free drift", "sliding": "Outages one by one", "repeated": "Outages again and again"}
    label = f"{words[name]}, error over that of the uncalibrated samples"
    return Figure(name, label, data, _layout(across, upright, 320))


def _curve(
    variant: dict[str, Any], at: int, points: list[tuple[float, dict[str, float | None]]], unit: str
) -> Plot:
    known = [(x, y) for x, y in points if y["value"]]
    colour, dash, symbol = _LOOKS[at % len(_LOOKS)]
    beside = (1.0 + _APART) ** (at - 2)
    name = html.escape(variant["name"])
    return {
        "type": "scatter",
        "mode": "lines+markers",
        "name": variant["name"],
        "x": plain([x * beside for x, _ in known]),
        "y": plain([y["value"] for _, y in known]),
        "customdata": plain([x for x, _ in known]),
        "error_y": {
            "type": "data",
            "array": plain([y["standard_uncertainty"] or 0.0 for _, y in known]),
            "thickness": 1,
        },
        "line": {"color": colour, "dash": dash},
        "marker": {"color": colour, "size": 7, "symbol": symbol},
        "hovertemplate": f"{name}<br>%{{customdata}} s: %{{y:.3g}}{unit}<extra></extra>",
    }


def _layout(across: str, upright: Plot, height: int) -> Plot:
    seconds = [1, 2, 5, 10, 20, 30, 60, 120, 300, 600]
    return base_layout(
        height,
        xaxis=text_axis(across, type="log", tickvals=seconds, ticktext=[str(t) for t in seconds]),
        yaxis=upright,
    )


def _listed(sentences: list[str]) -> str:
    return f"<ul>{''.join(f'<li>{html.escape(text)}</li>' for text in sentences if text)}</ul>"


def _place(figure: Figure, caption: str) -> str:
    return (
        f"<figure><figcaption>{html.escape(caption)}</figcaption>"
        f'<div id="{figure.name}" role="img" aria-label="{html.escape(figure.label)}" '
        f'style="height:{figure.height}px"></div></figure>'
    )


__all__ = ["metres", "render_drive"]
