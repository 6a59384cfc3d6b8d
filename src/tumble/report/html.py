"""The HTML report: one file that needs nothing else, with figures, numbers and words.

The plotting library is embedded in the page; its figures are plain data. Everything that comes from a
file or a user is escaped, and a content security policy forbids the page every connection.
"""

from __future__ import annotations

import html
import json
import os
from functools import cache
from importlib.resources import files
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.report.advice import next_steps
from tumble.report.beside_section import beside_section, beside_table
from tumble.report.figure import Section
from tumble.report.formula import formula_text, python_snippet
from tumble.report.parameter_figures import correlation_section, interval_section
from tumble.report.parameters import GROUPS, ParameterRow, parameter_rows, plain_unit
from tumble.report.pose_figure import pose_section, pose_words
from tumble.report.prediction_section import prediction_table
from tumble.report.protocol_section import protocol_table, spin_section
from tumble.report.residual_figures import hold_section, restless_table, turn_section
from tumble.report.rotation_section import rotation_section, rotation_table
from tumble.report.sequence_section import sequence_tables
from tumble.report.thermal_section import thermal_sections
from tumble.report.timeline_figure import timeline_section
from tumble.report.turn_ons_section import turn_ons_section, turn_ons_table
from tumble.report.uncalibrated import nominal_hold_norms, nominal_turn_angles
from tumble.report.uncertainty_section import budget_section, budget_table, reliability_table
from tumble.report.words import (
    chance,
    left_out_sentences,
    quality_sentences,
    term_words,
    verdict_words,
)

if TYPE_CHECKING:
    from tumble.calibration.estimate import Estimate
    from tumble.document.result import Calibration
    from tumble.protocol import Protocol
    from tumble.recording.recording import Recording
    from tumble.segmentation import HoldMeans, Timeline
    from tumble.segmentation.matching import Matching

# More recordings than this are counted, as one a step often are.
MOST_FILES_NAMED = 4
# The page may run what it holds and draw what it made, and fetch nothing.
_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:; font-src data:"
)


def write_report(
    path: str | os.PathLike[str],
    *,
    calibration: Calibration,
    estimate: Estimate,
    recording: Recording,
    timeline: Timeline,
    means: HoldMeans,
) -> None:
    """Write the report beside `path`, then rename it there: never half a file.

    Raises
    ------
    OutputError
        If it cannot be written; what was at `path` is intact.
    """
    from tumble.files import write_text

    page = render_report(
        calibration=calibration, estimate=estimate, recording=recording, timeline=timeline, means=means
    )
    write_text(Path(path), page)


def render_report(
    *,
    calibration: Calibration,
    estimate: Estimate,
    recording: Recording,
    timeline: Timeline,
    means: HoldMeans,
    protocol: Protocol | None = None,
    matching: Matching | None = None,
) -> str:
    """Return the report of a calibration as one HTML page that works offline.

    Parameters
    ----------
    calibration, estimate : the result, and what the procedure made.
    recording, timeline, means : what it was made from.
    protocol, matching : what was to be done, and which hold and spin is which step, if it was told.
    """
    rows = parameter_rows(calibration)
    sections = _sections(calibration, estimate, recording, timeline, means, rows, matching)
    first = thermal_sections(estimate, calibration)
    body = [
        _header(calibration, recording),
        _verdict(calibration),
        *(_figures(section) for section in first),
        _parameters(calibration, rows),
        turn_ons_table(calibration),
        prediction_table(calibration),
        ""
        if protocol is None or matching is None
        else protocol_table(protocol, matching, recording, timeline),
        rotation_table(estimate),
        sequence_tables(estimate),
        restless_table(estimate),
        *(_figures(section) for section in sections),
        beside_table(estimate, rows),
        budget_table(estimate, rows),
        reliability_table(estimate, rows),
        _terms(calibration),
        _components(calibration),
        _formulas(calibration),
        _next(calibration, estimate, recording, timeline, means, rows),
        (
            f"<footer>{_text(calibration.software)}, {_text(calibration.created)}. This page holds the whole "
            "calibration as JSON (element <code>calibration</code>) and works without a network.</footer>"
        ),
    ]
    figures = [figure.as_dict() for section in (*first, *sections) for figure in section.figures]
    return _page(_title(calibration), "\n".join(body), calibration, figures)


def _page(title: str, body: str, calibration: Calibration, figures: list[dict[str, Any]]) -> str:
    document = _json(calibration.model_dump(mode="json"))
    return standalone_page(
        title, body, figures, f'<script type="application/json" id="calibration">{document}</script>\n'
    )


def standalone_page(title: str, body: str, figures: list[dict[str, Any]], data: str = "") -> str:
    """Return a page with the plotting library in it, that needs nothing else and may connect to nothing.

    Parameters
    ----------
    title : plain text.
    body : HTML, escaped already, with a place for each figure by its name.
    figures : as `Figure.as_dict` has them.
    data : further elements for the end of the body.
    """
    parts = [
        (
            '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
            f"<title>{_text(title)}</title>\n<style>\n{_resource('page.css')}</style>\n</head>\n<body>\n<main>\n"
        ),
        body,
        f'\n</main>\n{data}<script type="application/json" id="figures">',
        _json(figures),
        "</script>\n<script>\n",
        _plotting_library(),
        "\n</script>\n<script>\n",
        _resource("page.js"),
        "</script>\n</body>\n</html>\n",
    ]
    return "".join(parts)


@cache
def _plotting_library() -> str:
    """Return the source of plotly.js as the installed plotly package brings it."""
    return (files("plotly") / "package_data" / "plotly.min.js").read_text(encoding="utf-8")


@cache
def _resource(name: str) -> str:
    return (files("tumble.report") / name).read_text(encoding="utf-8")


def _text(value: str) -> str:
    return html.escape(value, quote=True)


def _number(value: str) -> str:
    """Return a number's text escaped, with the typographic minus."""
    return _text(value).replace("-", "−")


def _json(value: Any) -> str:
    """Return JSON that cannot end the script element it stands in, and that has no NaN."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _paragraphs(sentences: list[str]) -> str:
    return "".join(f'<p class="note">{_text(sentence)}</p>' for sentence in sentences)


def _list(sentences: list[str]) -> str:
    return "<ul>" + "".join(f"<li>{_marked(sentence)}</li>" for sentence in sentences) + "</ul>"


def _marked(sentence: str) -> str:
    """Return a sentence escaped, with what stands between backticks as code."""
    parts = _text(sentence).split("`")
    if len(parts) % 2 == 0:
        return "`".join(parts)
    return "".join(f"<code>{part}</code>" if k % 2 else part for k, part in enumerate(parts))


def _title(calibration: Calibration) -> str:
    unit = " ".join(part for part in (calibration.imu.model, calibration.imu.serial_number) if part)
    return f"Calibration of {unit or _file_names(calibration) or 'an IMU'}"


def _file_names(calibration: Calibration) -> str:
    """Return the recordings by name; of many the first and the last, the document names them all."""
    names = [recording.name for recording in calibration.recordings]
    if len(names) <= MOST_FILES_NAMED:
        return ", ".join(names)
    return f"{len(names)} files, {names[0]} … {names[-1]}"


def _header(calibration: Calibration, recording: Recording) -> str:
    site = calibration.site
    where = f"g = {site.gravity:.5f} m/s² ({site.gravity_source})"
    if site.latitude_deg is not None:
        where = f"latitude {site.latitude_deg:.4f}°, {where}"
    facts = [
        ("Recording", _file_names(calibration) or "not from a file"),
        (
            "Samples",
            f"{len(recording)} at {recording.rate:g} Hz, {recording.duration:.0f} s; "
            f"specific force in {plain_unit(calibration.raw_units.specific_force)}, "
            f"angular rate in {calibration.raw_units.angular_rate}"
            + ("" if recording.angular_rate is not None else " (none recorded)"),
        ),
        ("Procedure", calibration.procedure),
        ("Site", where),
        ("Frame", calibration.frame.description),
        ("Made", f"{calibration.created} by {calibration.software}"),
    ]
    if calibration.temperature_celsius is not None:
        facts.insert(2, ("Temperature", f"{calibration.temperature_celsius:.1f} °C"))
    listed = "".join(f"<dt>{_text(name)}</dt><dd>{_text(value)}</dd>" for name, value in facts)
    return f'<h1>{_text(_title(calibration))}</h1>\n<dl class="facts">{listed}</dl>'


def _verdict(calibration: Calibration) -> str:
    fit = calibration.verdict.fit
    return (
        f'<div class="verdict{"" if fit else " bad"}"><strong>{verdict_words(fit)}</strong>'
        f"{_list(calibration.verdict.reasons)}</div>\n<noscript><p>The figures need JavaScript; all numbers and "
        "words are here without it.</p></noscript>"
    )


def _parameters(calibration: Calibration, rows: list[ParameterRow]) -> str:
    factor = calibration.quality.coverage_factor
    cells: list[str] = []
    ordered = sorted(rows, key=lambda row: GROUPS.index(row.group))
    for group, members in groupby(ordered, key=lambda row: row.group):
        cells.append(f'<tr class="group"><th colspan="4">{_text(group)}</th></tr>')
        for row in members:
            other = "" if row.other is None else row.other.text
            numbers = "".join(
                f"<td>{_number(text)}</td>"
                for text in (row.shown.text, row.shown.interval(row.factor(factor)), other)
            )
            cells.append(f"<tr><td>{_text(row.label)}</td>{numbers}</tr>")
    heads = "".join(
        f"<th>{head}</th>"
        for head in ("parameter", "value ± standard uncertainty", "95 % interval", "in other units")
    )
    return (
        f'<h2>Parameters</h2>\n<div class="scroll"><table><thead><tr>{heads}</tr></thead><tbody>{"".join(cells)}'
        f"</tbody></table></div>{_list([*quality_sentences(calibration), *left_out_sentences(calibration)])}"
        + _not_determined(calibration)
    )


def _not_determined(calibration: Calibration) -> str:
    if not calibration.not_determined:
        return ""
    return f"<p>What this recording does not determine:</p>{_list(calibration.not_determined)}"


def _sections(
    calibration: Calibration,
    estimate: Estimate,
    recording: Recording,
    timeline: Timeline,
    means: HoldMeans,
    rows: list[ParameterRow],
    matching: Matching | None,
) -> list[Section]:
    spun = [] if matching is None else [(spin.start, spin.stop) for spin in matching.spins]
    sections = [timeline_section(recording, timeline, estimate, spun)]
    up_b = _up(estimate, means)
    poses = [] if up_b is None else [pose_words(up) for up in up_b]
    gone = {left.index for left in estimate.left_out if left.kind == "hold"}
    if up_b is not None:
        sections.append(pose_section(up_b, gone, by_hand=not calibration.procedure.endswith("six-position")))
    # Of a thermal test the residuals are the rests', and stand first.
    if estimate.hold_norms.size and estimate.thermal_evidence is None:
        before = nominal_hold_norms(recording, means, calibration.site.gravity)
        sections.append(hold_section(estimate, before, poses))
    spins = spin_section(estimate)
    if spins is not None:
        sections.append(spins)
    rotations = rotation_section(estimate)
    if rotations is not None:
        sections.append(rotations)
    if np.any(np.isfinite(estimate.turn_angles)):
        before = nominal_turn_angles(recording, timeline, means, estimate.model)
        turns = turn_section(estimate, before, poses)
        if turns is not None:
            sections.append(turns)
    sections.append(interval_section(rows, calibration.quality.coverage_factor))
    for made in (
        turn_ons_section(calibration),
        beside_section(estimate, rows),
        budget_section(estimate, rows),
    ):
        if made is not None:
            sections.append(made)
    sections.append(correlation_section(rows[: len(estimate.correlations)], estimate.correlations))
    return sections


def _up(estimate: Estimate, means: HoldMeans) -> np.ndarray | None:
    """Return (holds, 3) the corrected specific force of each hold, which points up."""
    if means.specific_force is None or estimate.model.accelerometer is None:
        return None
    return estimate.model.accelerometer.correct(means.specific_force)


def _figures(section: Section) -> str:
    places: list[str] = []
    for figure in section.figures:
        width = f"min-width:{figure.least_width}px;" if figure.least_width else ""
        width += f"max-width:{figure.most_width}px;" if figure.most_width else ""
        place = (
            f'<div id="{figure.name}" role="img" aria-label="{_text(figure.label)}" '
            f'style="{width}height:{figure.height}px"></div>'
        )
        places.append(f'<div class="scroll">{place}</div>' if figure.least_width else place)
    many = " many" if len(places) > 1 else ""
    return (
        f"<h2>{_text(section.title)}</h2>\n<figure><figcaption>{_text(section.caption)}</figcaption>"
        f'<div class="plots{many}">{"".join(places)}</div></figure>{_paragraphs(section.notes)}'
    )


def _terms(calibration: Calibration) -> str:
    terms = calibration.quality.optional_terms
    if not terms:
        return ""
    columns = ("term", "F statistic", "unknowns", "probability of chance", "limit", "decision")
    heads = "".join(f"<th>{head}</th>" for head in columns)
    rows = "".join(
        f"<tr><td>{_text(term_words(term.name, calibration.procedure))}</td><td>{term.f_statistic:.3g}</td>"
        f"<td>{term.degrees_of_freedom}</td><td>{_number(chance(term))}</td><td>{term.limit:.2g}</td>"
        f"<td>{'kept' if term.kept else 'not kept'}</td></tr>"
        for term in terms
    )
    return (
        "<h2>Optional terms</h2>\n<p>Each term was tried and is kept only if the data want it: a large F statistic "
        "is one that chance would hardly give.</p>"
        f'<div class="scroll"><table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table></div>'
    )


def _components(calibration: Calibration) -> str:
    components = calibration.quality.variance_components
    if not components:
        return ""
    sentences = [component_words(name, sigma) for name, sigma in components.items()]
    return (
        "<h2>What the noise really does</h2>\n<p>Beyond the noise seen inside the holds, the residuals show "
        "the following standard deviations; the stated uncertainties include them.</p>" + _list(sentences)
    )


def component_words(name: str, sigma: float) -> str:
    """Return a variance component (name with SI unit after a comma, standard deviation) in words.

    Examples
    --------
    >>> component_words("accelerometer bias from hold to hold, m/s²", 0.00981)
    'Accelerometer bias from hold to hold: 9.8 mm/s² (1000 µg).'
    """
    what, _, unit = name.rpartition(", ")
    what = (what or name)[:1].upper() + (what or name)[1:]
    if sigma == 0.0:
        return f"{what}: none found beyond the noise."
    if unit == "m/s²":
        return f"{what}: {1e3 * sigma:.2g} mm/s² ({_digits(1e6 * sigma / 9.80665)} µg)."
    if unit == "rad/s":
        degrees = np.degrees(sigma)
        return f"{what}: {_digits(degrees)} °/s ({_digits(3600 * degrees)} °/h)."
    if unit == "rad":
        return f"{what}: {1e3 * sigma:.2g} mrad ({np.degrees(sigma):.2g}°)."
    return f"{what}: {sigma:.2g} {unit}."


def _digits(value: float) -> str:
    """Return two significant digits without a power of ten."""
    return f"{float(f'{value:.2g}'):.10g}"


def _at_what(calibration: Calibration) -> str:
    """Return at which temperature the numbers hold, where they change with it."""
    if calibration.thermal is None:
        return ""
    celsius = calibration.thermal.basis.reference_celsius
    return (
        f" These numbers hold at {celsius:g} °C; at another temperature use the lines below, or "
        "<code>tumble apply</code>."
    )


def _formulas(calibration: Calibration) -> str:
    parts = [
        (
            "<h2>The formula, both ways</h2>\n<p>True values are in frame b and SI; raw values are in the recording's "
            f"own units. At rest the specific force points up.{_at_what(calibration)}</p>"
            f"<pre>{_text(formula_text(calibration))}</pre>"
        ),
    ]
    if calibration.test_vectors:
        parts.append(
            "<p>To check an implementation, raw in and corrected out:</p>" + _test_vectors(calibration)
        )
    parts.append(
        "<p>In Python, with numpy alone (rows are samples), or with <code>tumble apply calibration.json "
        f"RECORDING</code>:</p><pre>{_text(python_snippet(calibration))}</pre>"
    )
    return "".join(parts)


def _test_vectors(calibration: Calibration) -> str:
    rows: list[str] = []
    for vector in calibration.test_vectors:
        for what, raw, true in (
            ("specific force", vector.raw_specific_force, vector.specific_force),
            ("angular rate", vector.raw_angular_rate, vector.angular_rate),
        ):
            if raw is None or true is None:
                continue
            cells = "".join(f"<td>{_text(', '.join(repr(v) for v in row))}</td>" for row in (raw, true))
            rows.append(f"<tr><td>{what}</td>{cells}</tr>")
    return (
        '<div class="scroll"><table><thead><tr><th></th><th>raw</th><th>corrected (SI)</th></tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def _next(
    calibration: Calibration,
    estimate: Estimate,
    recording: Recording,
    timeline: Timeline,
    means: HoldMeans,
    rows: list[ParameterRow],
) -> str:
    up_b = _up(estimate, means)
    steps = next_steps(calibration, rows, up_b, recording, timeline)
    remarks = f"<h2>How it was made</h2>{_list(calibration.remarks)}" if calibration.remarks else ""
    return f"<h2>What to do next</h2>{_list(steps)}{remarks}"
