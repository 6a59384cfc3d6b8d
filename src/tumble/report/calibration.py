"""The report of a calibration, of a magnetometer by itself too: verdict, parameters, evidence, formulas, what next."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Vectors
from tumble.calibration import Magnetometer, ThermalCurves
from tumble.document import FIELD_ALONE, Calibration, plain
from tumble.files import templates
from tumble.parameters import plain_unit
from tumble.report.advice import next_steps
from tumble.report.evidence import RENDERERS, render_evidence
from tumble.report.evidence.magnetometer import magnetometer_blocks
from tumble.report.figures.parameters import correlations, intervals, poses
from tumble.report.figures.timeline import timeline
from tumble.report.html import render_page
from tumble.report.page import Block, Code, Facts, Footer, Page, Sentences, Table, Verdict, section
from tumble.report.parameters import ParameterRow, headed_table
from tumble.report.planned import planned, protocol
from tumble.report.predictions import predictions
from tumble.report.subject import Subject
from tumble.report.words import (
    chance,
    component_words,
    left_out_sentences,
    limits_section,
    quality_sentences,
    term_words,
    verdict_words,
)


def _field_page(calibration: Calibration, found: Magnetometer, samples: Vectors) -> Page:
    """Return what the report of a magnetometer by itself says."""
    verdict, block = calibration.verdict, calibration.magnetometer
    facts = [
        ("Recording", ", ".join(r.name for r in calibration.recordings) or "not from a file"),
        ("Samples of the magnetometer", str(len(samples))),
        *_notes(calibration),
        ("Frame", calibration.frame.description),
        ("Made", f"{calibration.created} by {calibration.software}"),
    ]
    blocks: list[Block] = [Facts(facts), Verdict(verdict.fit, verdict_words(verdict.fit), verdict.reasons)]
    blocks += limits_section(calibration)
    if block is not None:
        blocks += section("Magnetometer", *magnetometer_blocks(found, block, samples))
    blocks += _how(calibration)
    return Page(title(calibration), blocks)


# Of a thermal calibration the curves come before the parameters, which hold at one temperature alone.
FIRST = (ThermalCurves,)
# More recordings than this are counted, as one a step often are.
MOST_FILES_NAMED = 4
HEADS = ("parameter", "value ± standard uncertainty", "95 % interval", "in other units")


def render_report(subject: Subject, library: str | None = None) -> str:
    """Return the report of a calibration as one HTML page that works offline and holds the document.

    Parameters
    ----------
    subject : what it is made from.
    library : where the plotting library lies, seen from the page; None puts it into the page.
    """
    document = plain(subject.calibration)
    return render_page(calibration_page(subject), {"calibration": document}, library)


def calibration_page(subject: Subject) -> Page:
    """Return what a calibration's report says.

    Parameters
    ----------
    subject : what it is made from.
    """
    calibration, correlation = subject.calibration, subject.estimate.correlations
    alone, field = subject.estimate.shown(Magnetometer), subject.recording.magnetic_field
    if calibration.procedure == FIELD_ALONE and alone is not None and field is not None:
        return _field_page(calibration, alone, field.values)
    fit = calibration.verdict.fit
    blocks: list[Block] = [
        Facts(_facts(subject)),
        Verdict(fit, verdict_words(fit), calibration.verdict.reasons),
        *limits_section(calibration),
        *render_evidence(subject, *FIRST),
        *_parameters(subject),
        *planned(subject),
        *predictions(subject),
        *protocol(subject),
        *timeline(subject),
    ]
    if subject.up_b is not None:
        # Where poses were asked for, others are not missing.
        blocks += poses(subject.up_b, subject.holds_left_out, by_hand=subject.protocol is None)
    blocks += render_evidence(subject, *(kind for kind in RENDERERS if kind not in FIRST))
    blocks += intervals(subject.rows, calibration.quality.coverage_factor)
    blocks += correlations(subject.rows[: len(correlation)], correlation)
    blocks += [*_terms(calibration), *_components(calibration), *_formulas(calibration), *_end(subject)]
    return Page(title(calibration), blocks)


def title(calibration: Calibration) -> str:
    """Return the page's title: the unit, or else its recordings.

    Parameters
    ----------
    calibration : the document.
    """
    unit = " ".join(part for part in (calibration.imu.model, calibration.imu.serial_number) if part)
    return f"Calibration of {unit or _file_names(calibration) or 'an IMU'}"


def _file_names(calibration: Calibration) -> str:
    """Return the recordings by name; of many the first and the last, the document names them all."""
    names = [recording.name for recording in calibration.recordings]
    if len(names) <= MOST_FILES_NAMED:
        return ", ".join(names)
    return f"{len(names)} files, {names[0]} … {names[-1]}"


def _facts(subject: Subject) -> list[tuple[str, str]]:
    calibration, recording = subject.calibration, subject.recording
    site = calibration.site
    where = f"g = {site.gravity:.5f} m/s² ({site.gravity_source})"
    if site.latitude_deg is not None:
        where = f"latitude {site.latitude_deg:.4f}°, {where}"
    samples = (
        f"{len(recording)} at {recording.rate:g} Hz, {recording.duration:.0f} s; "
        f"specific force in {plain_unit(calibration.raw_units.specific_force)}, "
        f"angular rate in {plain_unit(calibration.raw_units.angular_rate)}"
        + ("" if recording.angular_rate is not None else " (none recorded)")
    )
    celsius = calibration.temperature_celsius
    return [
        ("Recording", _file_names(calibration) or "not from a file"),
        ("Samples", samples),
        *([] if celsius is None else [("Temperature", f"{celsius:.1f} °C")]),
        ("Site", where),
        *_notes(calibration),
        ("Frame", calibration.frame.description),
        ("Made", f"{calibration.created} by {calibration.software}"),
    ]


def _notes(calibration: Calibration) -> list[tuple[str, str]]:
    return [(key.capitalize(), value) for key, value in calibration.notes.items()]


def parameter_table(rows: list[ParameterRow], factor: float) -> Table:
    """Return the parameters with their intervals, in groups in the order of `GROUPS`.

    Parameters
    ----------
    rows : parameters for readers.
    factor : coverage factor of those that have none of their own.
    """
    lines = [
        (
            row.name,
            (
                row.shown.text,
                row.shown.interval(row.factor(factor)),
                "" if row.other is None else row.other.text,
            ),
        )
        for row in rows
    ]
    return headed_table(HEADS, lines, spare=1)


def _parameters(subject: Subject) -> list[Block]:
    calibration = subject.calibration
    blocks = section(
        "Parameters",
        parameter_table(subject.rows, calibration.quality.coverage_factor),
        Sentences([*quality_sentences(calibration), *left_out_sentences(calibration)]),
    )
    if calibration.not_determined:
        words = "What this recording does not determine:"
        blocks += [Sentences([words], "paragraphs"), Sentences(calibration.not_determined)]
    return blocks


def _terms(calibration: Calibration) -> list[Block]:
    terms = calibration.quality.optional_terms
    if not terms:
        return []
    rows = [
        [
            term_words(term.name),
            f"{term.f_statistic:.3g}",
            str(term.degrees_of_freedom),
            chance(term),
            f"{term.limit:.2g}",
            "kept" if term.kept else "not kept",
        ]
        for term in terms
    ]
    words = (
        "Each term was tried and is kept only if the data want it: a large F statistic is one that chance would "
        "hardly give."
    )
    heads = ("term", "F statistic", "unknowns", "probability of chance", "limit", "decision")
    return section("Optional terms", Sentences([words], "paragraphs"), Table(heads, rows))


def _components(calibration: Calibration) -> list[Block]:
    components = calibration.quality.variance_components
    if not components:
        return []
    words = (
        "Beyond the noise seen inside the holds, the residuals show the following standard deviations; the stated "
        "uncertainties include them."
    )
    found = Sentences([component_words(name, sigma) for name, sigma in components.items()])
    return section("What the noise really does", Sentences([words], "paragraphs"), found)


def _formulas(calibration: Calibration) -> list[Block]:
    words = (
        "True values are in frame b and SI; raw values are in the recording's own units. At rest the specific force "
        "points up."
    )
    if calibration.thermal is not None:
        celsius = calibration.thermal.basis.reference_celsius
        words += f" These numbers hold at {celsius:g} °C; at another temperature use `tumble apply`."
    blocks = section("The formula, both ways", Sentences([words], "paragraphs"))
    blocks.append(Code(formula_text(calibration)))
    if calibration.test_vectors:
        check = "To check an implementation, raw in and corrected out:"
        blocks += [Sentences([check], "paragraphs"), _test_vectors(calibration)]
    apply = (
        "`tumble apply calibration.json RECORDING` corrects a recording; `tumble convert calibration.json --to python` "
        "writes the formula as code, `c`, `cpp` or `matlab` too."
    )
    return [*blocks, Sentences([apply], "paragraphs")]


def formula_text(calibration: Calibration) -> str:
    """Return both formulas, forward and backward, with matrices and biases, as plain text."""
    units = calibration.raw_units
    triads = [
        {
            "index": index,
            "what": what,
            "true": true,
            "unit": plain_unit(unit),
            "block": block,
            "inverse": np.linalg.inv(np.array(block.matrix or np.eye(3), dtype=float)),
        }
        for index, what, true, unit, block in (
            ("a", "specific force f in m/s²", "f", units.specific_force, calibration.accelerometer),
            ("g", "angular rate w in rad/s", "w", units.angular_rate, calibration.gyroscope),
        )
        if block is not None
    ]
    return templates().get_template("formula.txt").render(triads=triads).rstrip("\n")


def _test_vectors(calibration: Calibration) -> Table:
    rows = [
        [what, *(", ".join(repr(v) for v in row) for row in (raw, true))]
        for vector in calibration.test_vectors
        for what, raw, true in (
            ("specific force", vector.raw_specific_force, vector.specific_force),
            ("angular rate", vector.raw_angular_rate, vector.angular_rate),
        )
        if raw is not None and true is not None
    ]
    return Table(("", "raw", "corrected (SI)"), rows, verbatim=True)


def _end(subject: Subject) -> list[Block]:
    return [*section("What to do next", Sentences(next_steps(subject))), *_how(subject.calibration)]


def _how(calibration: Calibration) -> list[Block]:
    made = section("How it was made", Sentences(calibration.remarks)) if calibration.remarks else []
    words = (
        f"{calibration.software}, {calibration.created}. This page holds the whole calibration as JSON (element "
        "`calibration`) and works without a network."
    )
    return [*made, Footer(words)]
