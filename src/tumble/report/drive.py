"""A calibration's worth on a drive: drift, outages, and what the filter says."""

from __future__ import annotations

from typing import Any

from tumble.parameters import two_digits, with_uncertainty
from tumble.report.figures import record
from tumble.report.html import render_page
from tumble.report.page import Block, Figures, Page, Sentences, Table, Verdict, section

# Curves that lie close are told apart by more than their colours.
_LOOKS = (
    (record.RED, "", "circle"),
    (record.ORANGE, "dot", "square"),
    (record.PURPLE, "dash", "diamond"),
    (record.GREEN, "dashdot", "triangle-up"),
    (record.BLUE, "", "x"),
    (record.GREY, "dot", "cross"),
)
_SECONDS = (1, 2, 5, 10, 20, 30, 60, 120, 300, 600)
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
# Name, key in the document, axis, label and caption of what is shown over the uncalibrated samples.
_RATIOS = (
    ("shares", "drift", "s since the start", "Free drift", _SHARES),
    ("sliding", "outages_sliding", "s without positions", "Outages one by one", _SLIDING),
    ("repeated", "outages_repeated", "s without positions", "Outages again and again", _GAPS),
)
_OUTAGES = (("outages_sliding", "one by one"), ("outages_repeated", "again and again"))
_WITHIN = "± is the standard uncertainty within this drive. Another drive differs by more."


def render_drive(document: dict[str, Any], command: str) -> str:
    """Return the page as HTML.

    Parameters
    ----------
    document : of `tumble.workflows.drive.DriveVerification`.
    command : how to make it again.
    """
    return render_page(_drive_page(document, command))


def _drive_page(document: dict[str, Any], command: str) -> Page:
    """Return what a drive's verification says."""
    variants = document["variants"]
    drift = _drift_figure(variants)
    ratios = [Figures([_ratio_figure(variants, *words)], caption) for *words, caption in _RATIOS]
    compared = [document["time_offset"]["words"], document["alignment"], *document["setting"]]
    verdict = Verdict(document["fit"], "Serves" if document["fit"] else "Does not serve", document["reasons"])
    blocks: list[Block] = [
        Figures([drift], _DRIFT),
        verdict,
        *section(
            "Which error costs how many metres",
            _drift_table(variants),
            _outage_table(variants),
            Sentences([_WITHIN], "paragraphs"),
            ratios,
        ),
        *section("How it was compared", Sentences([words for words in compared if words])),
        *(section("What was noticed", Sentences(document["remarks"])) if document["remarks"] else []),
        Sentences([f"Again: `{command}`"], "paragraphs"),
    ]
    return Page(f"Verification of a calibration by the drive {document['recording']}", blocks)


def metres(number: dict[str, float | None]) -> str:
    """Return a number with its standard uncertainty, to two digits of that.

    Parameters
    ----------
    number : value and standard_uncertainty, or nulls.
    """
    value, sigma = number["value"], number["standard_uncertainty"]
    if value is None:
        return "–"
    return with_uncertainty(value, sigma) if sigma else two_digits(value)


def _drift_table(variants: list[dict[str, Any]]) -> Table:
    last = variants[0]["drift"][-1]["seconds"]
    heads = ["corrected by", f"free drift, {last:g} s, m", "over uncalibrated", "class", "innovations"]
    rows = [
        [
            variant["name"],
            metres(variant["drift"][-1]["horizontal_rms"]),
            metres(variant["drift"][-1]["ratio_to_uncalibrated"]),
            variant["accuracy_class"].partition(" ")[0],
            "–" if variant["innovations"] is None else f"{variant['innovations']:.2f}",
        ]
        for variant in variants
    ]
    return Table(heads, rows, right=range(1, len(heads)))


def _outage_table(variants: list[dict[str, Any]]) -> Table:
    """Both kinds of outages in metres, a row for each variant and kind."""
    heads = ["outages, m", *(f"{one['seconds']:g} s" for one in variants[0]["outages_sliding"])]
    rows = [
        [f"{variant['name']}, {word}", *(metres(one["horizontal_rms"]) for one in variant[key])]
        for key, word in _OUTAGES
        for variant in variants
    ]
    return Table(heads, rows, right=range(1, len(heads)))


def _drift_figure(variants: list[dict[str, Any]]) -> record.Figure:
    marks = [
        _curve(variant, at, [(one["seconds"], one["horizontal_rms"]) for one in variant["drift"]], " m")
        for at, variant in enumerate(variants)
    ]
    across = record.Axis("s since the start", "log", ticks=_SECONDS)
    upright = record.Axis("horizontal rms / m", "log", every=1)
    label = "Free inertial drift with and without the calibration"
    return record.Figure("drift", label, marks, across, upright, 400)


def _ratio_figure(
    variants: list[dict[str, Any]], name: str, key: str, across: str, words: str
) -> record.Figure:
    """Errors over those of the first variant, which is uncalibrated, by their length."""
    marks = [
        _curve(
            variant, at, [(one["seconds"], one["ratio_to_uncalibrated"]) for one in variant[key]], " of it"
        )
        for at, variant in enumerate(variants)
        if at
    ]
    label = f"{words}, error over that of the uncalibrated samples"
    return record.Figure(
        name, label, marks, record.Axis(across, "log", ticks=_SECONDS), record.Axis("over uncalibrated"), 320
    )


def _curve(
    variant: dict[str, Any], at: int, points: list[tuple[float, dict[str, float | None]]], unit: str
) -> record.Curve:
    known = [(x, y) for x, y in points if y["value"]]
    colour, dash, symbol = _LOOKS[at % len(_LOOKS)]
    beside = (1.0 + _APART) ** (at - 2)
    return record.Curve(
        record.plain([x * beside for x, _ in known]),
        record.plain([y["value"] for _, y in known]),
        variant["name"],
        colour,
        hover=f"%{{fullData.name}}<br>%{{text}} s: %{{y:.3g}}{unit}<extra></extra>",
        words=[f"{x:g}" for x, _ in known],
        symbol=symbol,
        sigma=record.plain([y["standard_uncertainty"] or 0.0 for _, y in known]),
        dash=dash,
    )
