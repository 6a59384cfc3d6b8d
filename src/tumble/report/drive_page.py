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
.verdict { font-size: 1.3rem; font-weight: 600; }
"""
_COLOURS = (RED, ORANGE, PURPLE, GREEN, BLUE, GREY)
_DRIFT = (
    "Free inertial drift: position, velocity and attitude are known at the start, then the sensors are alone. "
    "Horizontal rms over all starts of the drive; bars are standard uncertainties by a block bootstrap."
)
_SLIDING = (
    "Outages one by one: the filter has had all positions before each. It has estimated the sensors' errors by then as "
    "far as the drive shows them, so that less is left for the calibration."
)
_GAPS = "Outages again and again, with one position between: the filter learns less, the calibration is worth more."


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
        (_outage_figure("sliding", variants, "outages_sliding"), _SLIDING),
        (_outage_figure("repeated", variants, "outages_repeated"), _GAPS),
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
    lengths = [one["seconds"] for one in variants[0]["outages_sliding"]]
    heads = ["corrected by", f"free drift, {last:g} s, m", "over uncalibrated", "class"]
    heads += [f"outage {length:g} s, m" for length in lengths] + ["innovations"]
    rows = [
        [
            variant["name"],
            metres(variant["drift"][-1]["horizontal_rms"], ""),
            metres(variant["drift"][-1]["ratio_to_uncalibrated"], ""),
            variant["accuracy_class"].partition(" ")[0],
            *(metres(one["horizontal_rms"], "") for one in variant["outages_sliding"]),
            f"{variant['innovations']:.2f}",
        ]
        for variant in variants
    ]
    head = "".join(f"<th>{html.escape(word)}</th>" for word in heads)
    lines = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    table = f'<table class="drive"><thead><tr>{head}</tr></thead><tbody>{lines}</tbody></table>'
    return f'<div class="scroll">{table}</div>'


def _drift_figure(variants: list[dict[str, Any]]) -> Figure:
    data = [
        _curve(variant["name"], colour, [(one["seconds"], one["horizontal_rms"]) for one in variant["drift"]])
        for variant, colour in zip(variants, _COLOURS, strict=False)
    ]
    return Figure(
        "drift", "Free inertial drift with and without the calibration", data, _layout("s since the start")
    )


def _outage_figure(name: str, variants: list[dict[str, Any]], key: str) -> Figure:
    data = [
        _curve(variant["name"], colour, [(one["seconds"], one["horizontal_rms"]) for one in variant[key]])
        for variant, colour in zip(variants, _COLOURS, strict=False)
    ]
    return Figure(
        name, f"Position error at the end of outages, {name}", data, _layout("s without positions", 320)
    )


def _curve(name: str, colour: str, points: list[tuple[float, dict[str, float | None]]]) -> Plot:
    known = [(x, y) for x, y in points if y["value"]]
    return {
        "type": "scatter",
        "mode": "lines+markers",
        "name": name,
        "x": plain([x for x, _ in known]),
        "y": plain([y["value"] for _, y in known]),
        "error_y": {
            "type": "data",
            "array": plain([y["standard_uncertainty"] or 0.0 for _, y in known]),
            "thickness": 1,
        },
        "line": {"color": colour},
        "marker": {"color": colour, "size": 6},
        "hovertemplate": f"{html.escape(name)}<br>%{{x}} s: %{{y:.3g}} m<extra></extra>",
    }


def _layout(across: str, height: int = 400) -> Plot:
    seconds = [1, 2, 5, 10, 20, 30, 60, 120, 300, 600]
    return base_layout(
        height,
        xaxis=text_axis(across, type="log", tickvals=seconds, ticktext=[str(t) for t in seconds]),
        yaxis=text_axis("horizontal rms, m", type="log", exponentformat="power", dtick=1),
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
