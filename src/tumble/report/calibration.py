"""The report of a calibration, of a magnetometer by itself too: verdict, parameters, evidence, formulas, what next."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from tumble.arrays import Vector, Vectors
from tumble.calibration import (
    PROCEDURES,
    Magnetometer,
    ThermalCurves,
    describe_direction,
    most_telling_poses,
    norm_rows,
)
from tumble.document import FIELD_ALONE, Answer, Calibration, DocumentPart, answers, plain, practical
from tumble.files import templates
from tumble.parameters import (
    ACCELEROMETER,
    BETWEEN,
    GROUPS,
    GYRO,
    Measure,
    plain_unit,
    spaced,
    with_uncertainty,
)
from tumble.protocol import SpinStep, Step, TurnStep
from tumble.recording import Recording
from tumble.report.evidence import RENDERERS, render_evidence
from tumble.report.evidence.magnetometer import magnetometer_blocks
from tumble.report.figures.parameters import correlations, intervals, poses
from tumble.report.figures.timeline import timeline
from tumble.report.html import render_page
from tumble.report.page import Block, Code, Facts, Footer, Page, Sentences, Table, Verdict, section
from tumble.report.parameters import ParameterRow, achieved_beside, headed_table
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

FORMAT: Literal["tumble filter states"] = "tumble filter states"
VERSION: Literal[1] = 1
MODEL = "corrected = (1 + E) true + bias (a rate also + G specific_force); a state is an entry of E, G, bias"


class _Strict(DocumentPart, forbid_unknown_fields=True):
    """A part that has no other keys."""


class StateBlock(_Strict):
    """A state of a sensor, in SI.

    Attributes
    ----------
    name : in words.
    row : axis of the sensor: 0 for x.
    column : axis of the input for an entry of E or G; null for a bias.
    sigma : one standard deviation at the start, from the calibration.
    unit : of sigma.
    walk_per_root_second : by how much it wanders: root of the density that drives it.
    largest_share_of_variance : of the variance of horizontal or vertical position, tilt or heading, after any
        of the times.
    carry : whether a filter on such a trajectory should have it.
    """

    name: str
    kind: Literal["accelerometer", "gyroscope", "g-sensitivity"]
    row: Annotated[int, Meta(ge=0, le=2)]
    column: Annotated[int, Meta(ge=0, le=2)] | None
    sigma: Annotated[float, Meta(ge=0.0)]
    unit: str
    walk_per_root_second: Annotated[float, Meta(ge=0.0)]
    largest_share_of_variance: Annotated[float, Meta(ge=0.0)]
    carry: bool


class FilterDocument(_Strict):
    """The sensor states that a filter could have, and which of them it should.

    Attributes
    ----------
    model : what a state is an entry of.
    trajectory : that they were judged on.
    seconds : s of free navigation after which they were judged.
    """

    format: Literal["tumble filter states"] = FORMAT
    version: Literal[1] = VERSION
    model: str = MODEL
    trajectory: str
    seconds: list[float]
    states: list[StateBlock]
    remarks: list[str]


PREDICTED = ("after", "uncalibrated", "calibrated, one sigma", "most of it from")
_WORTH = (
    "The error that this calibration leaves, in position after some time without satellites or other "
    "aiding, and in attitude after a turn. Beside it is the error of the same unit with nominal "
    "scale factors and no bias. Its worst pose is its own; the one that is named is the calibration's."
)
FOOTNOTE = (
    "Horizontal position from a known start; attitude in all three components. From the calibration's covariance "
    "alone: the sensors' noise, the wander of their biases and how far these move until the unit is next switched on "
    "come on top."
)
OF_SEVERAL = (
    "Horizontal position from a known start; attitude in all three components. From the "
    "calibration's covariance alone, with biases as uncertain as they are when the unit is next "
    "switched on. The sensors' noise and the wander of their biases come on top."
)
_GROUPS = {
    "accelerometer.bias": "accelerometer bias",
    "accelerometer.matrix": "accelerometer scale and angles",
    "accelerometer.quadratic": "accelerometer quadratic",
    "accelerometer.asymmetry": "accelerometer asymmetry",
    "gyroscope.bias": "gyro bias",
    "gyroscope.matrix": "gyro scale and angles",
    "gyroscope.quadratic": "gyro quadratic",
    "gyroscope.asymmetry": "gyro asymmetry",
    "gyroscope.g_sensitivity": "g-sensitivity",
}


def predictions(subject: Subject) -> list[Block]:
    """Return the predicted errors.

    Parameters
    ----------
    subject : of the report.
    """
    calibration = subject.calibration
    told = answers(calibration)
    if not told:
        return []
    note = FOOTNOTE if calibration.turn_ons is None else OF_SEVERAL
    return section(
        "What it is worth",
        Sentences([_WORTH], "paragraphs"),
        Table(PREDICTED, [cells(answer) for answer in told]),
        Sentences([note], "notes"),
    )


def cells(answer: Answer, *, with_sheet: bool = False) -> list[str]:
    """Return question, uncalibrated error, calibrated one and its main cause as texts.

    Parameters
    ----------
    answer : a prediction.
    with_sheet : put what the data sheet promises third.
    """
    sheet = [_about_zero(answer.kind, answer.sheet)] if with_sheet else []
    return [answer.question, _before(answer), *sheet, _about_zero(answer.kind, answer.after), _causes(answer)]


def _about_zero(kind: str, error: float | None) -> str:
    if error is None or not math.isfinite(error):
        return "–" if error is None else "attitude lost"
    value, unit = practical(kind, error)
    return f"{with_uncertainty(0.0, value)}{spaced(unit)}"


def _before(answer: Answer) -> str:
    if answer.before is None or not math.isfinite(answer.before):
        return _about_zero(answer.kind, answer.before)
    value, unit = practical(answer.kind, answer.before)
    scale = value / answer.before if answer.before > 0.0 else 1.0
    return f"{with_uncertainty(value, scale * answer.after)}{spaced(unit)}"


def _causes(answer: Answer) -> str:
    """Name what makes up nine tenths of the variance, two groups at most."""
    named: list[str] = []
    whole = 0.0
    for group, share in list(answer.shares.items())[:2]:
        named.append(f"{_GROUPS.get(group, group)} {100.0 * min(share, 1.0):.0f} %")
        whole += share
        if whole > 0.9:
            break
    return ", ".join(named)


def protocol(subject: Subject) -> list[Block]:
    """Return the steps of the protocol, and what was said of them; nothing without a protocol.

    Parameters
    ----------
    subject : of the report.
    """
    told, matching, recording = subject.protocol, subject.matching, subject.recording
    if told is None or matching is None:
        return []
    places: dict[int, list[str]] = {}
    for matched in matching.holds:
        hold = subject.timeline.holds[matched.hold]
        where = f"hold {matched.hold + 1}, {_span(recording, hold.start, hold.stop)}"
        places.setdefault(matched.step, []).append(where)
    for spin in matching.spins:
        places.setdefault(spin.step, []).append(_span(recording, spin.start, spin.stop))
    rows = [
        [str(number + 1), _step_words(step), "; ".join(places.get(number, ["not found"]))]
        for number, step in enumerate(told.steps)
        if number in places or not isinstance(step, TurnStep)
    ]
    said = (
        Sentences(matching.remarks)
        if matching.remarks
        else Sentences(["Every step was found, and nothing else."], "paragraphs")
    )
    table = Table(("step", "what", "found"), rows, folded="The steps and where they were found")
    return section(f"Protocol {told.name}", said, table)


def _span(recording: Recording, first: int, stop: int) -> str:
    start = float(recording.time[0])
    return f"{recording.time[first] - start:.1f} to {recording.time[stop - 1] - start:.1f} s"


def _step_words(step: Step) -> str:
    """Return what a step is, in words.

    Examples
    --------
    >>> import numpy as np
    >>> from tumble.protocol import HoldStep, SpinStep
    >>> _step_words(HoldStep(5.0, None, "on its back")), _step_words(SpinStep(8.0, -np.pi / 4))
    ('hold: on its back', 'spin: -45°/s about up')
    """
    if isinstance(step, SpinStep):
        axis = "up" if step.axis_b is None else "(" + ", ".join(f"{v:.3g}" for v in step.axis_b) + ")"
        words = f"{np.degrees(step.rate):.6g}°/s about {axis}"
        return f"spin: {step.name}, {words}" if step.name else f"spin: {words}"
    kind = type(step).__name__.removesuffix("Step").lower()
    return f"{kind}: {step.name}" if step.name else kind


def planned(subject: Subject) -> list[Block]:
    """Return a section with predicted and achieved uncertainties; nothing without a plan.

    Parameters
    ----------
    subject : of the report.
    """
    sentence = planned_sentence(subject.calibration, subject.predicted)
    if sentence is None:
        return []
    rows = [
        [
            row.name,
            predicted.text,
            achieved.text,
            f"{achieved.sigma / predicted.sigma:.2g}",
        ]
        for row, predicted, achieved in sorted(
            achieved_beside(subject.calibration, subject.predicted),
            key=lambda one: GROUPS.index(one[0].group),
        )
    ]
    heads = ("standard uncertainty of", "predicted", "achieved", "achieved over predicted")
    return section("Beside the plan", Sentences([sentence], "paragraphs"), Table(heads, rows))


def planned_sentence(calibration: Calibration, predicted: Mapping[str, float]) -> str | None:
    """Return how the uncertainties compare with those that a plan predicted; None without a plan.

    Parameters
    ----------
    calibration : the result.
    predicted : standard uncertainties by name, SI.
    """
    beside = achieved_beside(calibration, predicted)
    if not beside:
        return None
    ratios = sorted((achieved.sigma / foreseen.sigma, row.name) for row, foreseen, achieved in beside)
    middle = ratios[len(ratios) // 2][0]
    return (
        f"Beside the plan: the median uncertainty is {middle:.2g} times the predicted one. Least for "
        f"{ratios[0][1]} ({ratios[0][0]:.2g} times), most for {ratios[-1][1]} ({ratios[-1][0]:.2g} times)."
    )


# One axis turned less than this share of the best one is worth a sentence.
_MUCH_LESS = 0.6


def next_steps(subject: Subject) -> list[str]:
    """Return what would improve the calibration or make it more trustworthy, as sentences.

    Parameters
    ----------
    subject : of the report; with a protocol nobody holds the unit with a corner up.
    """
    calibration, protocol, up_b = subject.calibration, subject.protocol, subject.up_b
    steps: list[str] = []
    if not calibration.verdict.fit:
        steps.append("The calibration is not fit for use: mend what the verdict names, and record again.")
    procedure = None if protocol is None else PROCEDURES.get(protocol.procedure)
    if procedure is not None and procedure.placement:
        steps.append(procedure.placement)
    elif up_b is not None:
        steps += _poses(_without_gravity(calibration, subject.rows), up_b)
        if procedure is None or procedure.free_turns:
            steps += _turns(subject, up_b)
    if calibration.accelerometer is not None:
        steps += _gravity(calibration)
        steps.append(
            "Verify it on another recording that it has not seen, of the same unit, some minutes of holds and turns: "
            "`tumble verify calibration.json` RECORDING."
        )
    temperature = calibration.temperature_celsius
    at = "at one temperature" if temperature is None else f"at {temperature:.0f} °C"
    steps.append(
        f"The values hold {at}. Calibrate again after a shock or a new mounting, when it works more "
        "than about 10 °C from where it was calibrated, and when a verification fails. Biases change "
        "with every power cycle: keep the unit at rest for a few seconds before each use."
    )
    return steps


def _without_gravity(calibration: Calibration, rows: list[ParameterRow]) -> list[ParameterRow]:
    """Return the rows with what gravity's uncertainty does to the scale factors taken out: no pose mends it."""
    site = calibration.site
    share = site.gravity_standard_uncertainty / site.gravity

    def reduced(row: ParameterRow) -> ParameterRow:
        sigma = _relative_sigma(row)
        if row.group != ACCELEROMETER or not row.kind.startswith("scale factor") or not sigma:
            return row
        left = math.sqrt(max(1.0 - (share / sigma) ** 2, 0.0))
        other = None if row.other is None else row.other.times(left, row.other.unit)
        # Only sigma matters here; a scaled value would be wrong, so that it is left away.
        shown = Measure(row.shown.value, left * row.shown.sigma, row.shown.unit)
        return replace(row, shown=shown, other=other)

    return [reduced(row) for row in rows]


def weakest(rows: list[ParameterRow], groups: tuple[str, ...]) -> ParameterRow | None:
    """Return the parameter of the groups that adds most to the error, or None if there is none.

    Bias over gravity, relative scale factor and angle are all errors over 1 g; a gyro's bias is left
    out, because holds tell it at any time.
    """
    errors = [(_relative_sigma(row), row) for row in rows if row.group in groups]
    known = [(error, row) for error, row in errors if error is not None]
    return max(known, key=lambda item: item[0])[1] if known else None


def _relative_sigma(row: ParameterRow) -> float | None:
    """Return sigma in units of what is measured: of 1 g, of the scale factor, or in radians."""
    if row.kind == "bias":
        if row.group != ACCELEROMETER or row.other is None:
            return None
        return row.other.sigma * {"mg": 1e-3, "µg": 1e-6}.get(row.other.unit, math.nan)
    if row.kind == "scale factor":
        return row.shown.sigma / abs(row.shown.value)
    factor = {"%": 1e-2, "ppm": 1e-6, "mrad": 1e-3, "µrad": 1e-6}.get(row.shown.unit)
    return None if factor is None else factor * row.shown.sigma


def _uncertainty(row: ParameterRow) -> str:
    """Return a row's standard uncertainty, in the unit that people compare."""
    measure = row.other if row.other is not None and row.kind in ("bias", "scale factor") else row.shown
    return f"{with_uncertainty(math.nan, measure.sigma)} {measure.unit}"


def _poses(rows: list[ParameterRow], up_b: Vectors) -> list[str]:
    row = weakest(rows, (ACCELEROMETER,))
    if row is None:
        return []
    units = up_b / np.linalg.norm(up_b, axis=1, keepdims=True)
    seen = norm_rows(units)
    first, second = most_telling_poses(seen.T @ seen, 2)
    words = _placed(first)
    if _placed(second) != words:
        words += f", then with {_placed(second)}"
    return [
        (
            f"Hold the unit with {words}: these poses add most. Least known is the accelerometers' {row.label} "
            f"({_uncertainty(row)})."
        )
    ]


def _placed(up: Vector) -> str:
    words = describe_direction(up).replace("-", "−")
    return words if words.endswith(("x up", "y up", "z up")) and len(words) == 5 else f"the {words}"


def _turns(subject: Subject, up_b: Vectors) -> list[str]:
    row = weakest(subject.rows, (GYRO, BETWEEN))
    if row is None:
        if subject.recording.angular_rate is None:
            return []
        return [
            (
                "The gyro's scale factors and axes are not known: turn the unit between the holds about all three "
                "axes, by 90° and more, and calibrate with the hand-held procedure."
            )
        ]
    sentence = f"The least known gyro parameter is the {row.label} ({_uncertainty(row)})."
    angles = _turned_about_horizontal(subject, up_b)
    if angles is None:
        return [sentence]
    least = int(np.argmin(angles))
    shown = ", ".join(f"{axis} {angle:.0f}°" for axis, angle in zip("xyz", np.degrees(angles), strict=True))
    sentence += (
        " Gravity shows a turn about an axis only as far as the axis is horizontal; so counted, the turns "
        f"add up to {shown}."
    )
    if angles[least] < _MUCH_LESS * np.max(angles):
        axis = "xyz"[least]
        return [f"{sentence} Add turns of 90° and more about {axis} while {axis} is horizontal, both ways."]
    return [f"{sentence} No axis lacks turns; more turns of 90° to 180° about all of them would help evenly."]


def _turned_about_horizontal(subject: Subject, up_b: Vectors) -> Vector | None:
    """Return (3,) rad turned about each axis, counted as far as the axis was horizontal; None without gyro."""
    gyro, recording = subject.calibration.gyroscope, subject.recording
    if recording.angular_rate is None or gyro is None or gyro.matrix is None:
        return None
    total = np.zeros(3)
    inverse = np.linalg.inv(np.array(gyro.matrix, dtype=float))
    units = up_b / np.linalg.norm(up_b, axis=1, keepdims=True)
    for turn in subject.timeline.turns:
        if not turn.usable:
            continue
        rates = recording.angular_rate[turn.start : turn.stop]
        angle = inverse @ (rates.sum(axis=0) - len(rates) * np.array(gyro.bias)) / recording.rate
        vertical = 0.5 * (units[turn.before] ** 2 + units[turn.after] ** 2)
        total += np.abs(angle) * np.sqrt(np.maximum(1.0 - vertical, 0.0))
    return total if np.any(total) else None


def _gravity(calibration: Calibration) -> list[str]:
    # Only turns tell the Earth rate from the gyros' own errors.
    if calibration.site.latitude_deg is None and calibration.quality.turns:
        return [
            (
                "With `--site LATITUDE,HEIGHT` instead of `--gravity` the Earth's rotation is known too, which helps "
                "the gyros' biases and g-sensitivity."
            )
        ]
    return []


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
