"""The strapdown rotation test's solution as an estimate: parameters, covariance, residuals, what was not told.

A sensor model mended by Savage's errors: what a pass of the strapdown rotation test changes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field

import numpy as np

from tumble.arrays import Series, Square, Table, Vector
from tumble.calibration.checks.latitude import latitude_shown
from tumble.calibration.checks.scores import holds_evidence
from tumble.calibration.closed_forms.rotation_sequences import SequenceModel
from tumble.calibration.closed_forms.sequence_inversion import SequenceSolution
from tumble.calibration.closed_forms.sequence_measurements import SequenceMeasurement
from tumble.calibration.estimate import (
    Described,
    Estimate,
    Figures,
    NamedValue,
    TermTest,
    correlation_matrix,
    coverage_factor,
    estimate_of,
    said_of,
)
from tumble.calibration.evidence import SequenceFit, Sequences
from tumble.calibration.strapdown.recorded_sequences import RecordedSequence
from tumble.calibration.strapdown.start_earth import SeenEarth, earth_as_sensitivity
from tumble.calibration.verdict import two_digits
from tumble.earth import Site
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.segmentation import HoldMeans
from tumble.sensor import ImuModel, Triad, change_frame
from tumble.sensor.conventions.savage import GROUPS, NAMES, OFF_DIAGONAL, PAIRS, SavageErrors
from tumble.units import angular_rate_factor, specific_force_factor


def apply_errors(model: ImuModel, errors: Series) -> ImuModel:
    """Return the model with the errors that the corrected output still has.

    What the model corrects is, by the errors, ``E true``: so the raw output is the model's of ``E true``. Matrices
    multiply; asymmetries, which act on each sensor's own input, add up to the first order, as the test finds
    them.

    Parameters
    ----------
    model : both triads.
    errors : (24,) as `savage.NAMES`, of the model's corrected output.
    """
    assert model.accelerometer is not None
    assert model.gyroscope is not None
    found = SavageErrors.from_vector(errors)
    extra = found.model()
    assert extra.accelerometer is not None
    assert extra.gyroscope is not None
    force, rate = model.accelerometer, model.gyroscope
    return ImuModel(
        Triad(
            np.asarray(force.matrix @ extra.accelerometer.matrix, dtype=np.float64),
            np.asarray(force.bias + force.matrix @ found.bias, dtype=np.float64),
            _sum(force.asymmetry, found.scale_asymmetry),
        ),
        Triad(
            np.asarray(rate.matrix @ extra.gyroscope.matrix, dtype=np.float64),
            rate.bias,
            _sum(rate.asymmetry, found.kappa_asymmetry),
        ),
        model.g_sensitivity,
    )


def _sum(one: Vector | None, other: Vector) -> Vector:
    return other if one is None else one + other


# What an error that no sequence determines is believed to be off from its rough value by.
UNTOLD = {"lambda_bias": 0.1}
UNTOLD_ELSE = 0.01
# How far gyros are believed to be from no asymmetry where the sequences do not tell it from the scale factor.
BELIEVED_ASYMMETRY = 1e-3
# A heading that the gyros contradict by more standard uncertainties than this, and by more than this, rad.
CONTRADICTION, SMALLEST_HEADING = 5.0, 0.01
# Gyros that know north worse than this, rad, are too noisy to see it.
SEEN_NORTH = 0.5
STEP = 0.1


@dataclass(slots=True)
class StrapdownOutcome:
    """What play-back ended with.

    Attributes
    ----------
    sequences, models, measurements : of each sequence.
    model : in the frame of play-back.
    solution : of the last pass.
    passes : (24,) what each pass changed.
    term : the test of the g-sensitivity.
    noise_angle : rad²/s.
    earth : what the gyros see of the Earth rate beyond what was told; None if nothing.
    words : sentences on sequences that took no part.
    """

    sequences: list[RecordedSequence]
    models: list[SequenceModel]
    measurements: list[SequenceMeasurement]
    model: ImuModel
    solution: SequenceSolution
    passes: list[Series]
    term: TermTest | None
    noise_angle: float
    earth: SeenEarth | None
    words: list[str] = field(default_factory=list[str])


def strapdown_estimate(
    recording: Recording, means: HoldMeans, site: Site, outcome: StrapdownOutcome
) -> Estimate:
    """Return the outcome as an estimate, in the frame ``mean-gyro``.

    Parameters
    ----------
    recording : for its units.
    means, site : of all holds; gravity.
    outcome : what play-back ended with.
    """
    model = change_frame(outcome.model, "mean-gyro")
    covariance = _covariance(outcome, site)
    names, canonical = _canonical(outcome)
    labels, units, named = _named(recording, outcome)
    spread, canonical_covariance = (
        _carried(named, outcome, covariance),
        _carried(canonical, outcome, covariance),
    )
    values = named(np.zeros(len(covariance)))
    solution = outcome.solution
    assert means.specific_force is not None
    assert model.accelerometer is not None
    sigma0 = float(np.sqrt(solution.square_sum / solution.degrees)) if solution.degrees else float("nan")
    parameters = [
        NamedValue(label, float(value), float(np.sqrt(max(variance, 0.0))), unit)
        for label, unit, value, variance in zip(labels, units, values, np.diag(spread), strict=True)
    ]
    assert means.specific_force_covariance is not None
    return estimate_of(
        "strapdown-rotation",
        Described(model, names, canonical_covariance, parameters, correlation_matrix(spread)),
        Figures(
            sigma0,
            min(sigma0, 1.0) if np.isfinite(sigma0) else sigma0,
            solution.degrees,
            coverage_factor(solution.degrees),
            float(np.max(np.abs(solution.residuals / solution.sigmas))),
            {},
        ),
        terms=[] if outcome.term is None else [outcome.term],
        said=said_of(
            remarks=_remarks(outcome, site),
            objections=_objections(outcome, site),
            not_determined=_not_determined(outcome),
        ),
        evidence=[
            holds_evidence(
                model.accelerometer, means.specific_force, means.specific_force_covariance, site.gravity
            ),
            Sequences(_fits(outcome), tuple(_groups(change) for change in outcome.passes)),
        ],
        frame="mean-gyro",
    )


def _covariance(outcome: StrapdownOutcome, site: Site) -> Square:
    """(36, 36) of Savage's errors, the gyros' biases (rad/s) and their g-sensitivity ((rad/s)/(m/s²))."""
    full = np.zeros((36, 36))
    full[:24, :24] = outcome.solution.covariance
    for name, at in GROUPS.items():
        for k in range(at.start, at.stop):
            if not outcome.solution.determined[k]:
                full[k, k] = UNTOLD.get(name, UNTOLD_ELSE) ** 2
    slope = np.zeros(36)
    slope[GROUPS["lambda_lin"]] = -1.0 / site.gravity
    full += np.outer(slope, slope) * site.gravity_sigma**2
    bias = np.array([m.gyro_bias for m in outcome.measurements])
    seconds = np.array([s.time_step * (s.start[1] - s.start[0]) for s in outcome.sequences])
    white = outcome.noise_angle / float(np.sum(seconds))
    scatter = np.var(bias, axis=0, ddof=1) / len(bias) if len(bias) > 3 else np.zeros(3)
    full[24:27, 24:27] = np.diag(np.maximum(scatter, white))
    # An Earth rate that is not known stands in the bias as it is.
    full[24:27, 24:27] += max(s.unknown_rate for s in outcome.sequences) ** 2 / 3.0 * np.eye(3)
    if outcome.term is not None and outcome.term.kept:
        # each element against two faces of gravity, over all rests
        full[27:, 27:] = np.eye(9) * np.mean(np.maximum(scatter, white)) / (site.gravity**2 / 3.0)
        unknown = max(s.unknown_rate for s in outcome.sequences)
        full[27:, 27:] += earth_as_sensitivity(unknown, site.gravity)
    return full


def _moved(outcome: StrapdownOutcome, change: Series) -> ImuModel:
    """The model with all errors changed, in the frame ``mean-gyro``."""
    model = apply_errors(outcome.model, change[:24])
    assert model.gyroscope is not None
    gyro = type(model.gyroscope)(
        model.gyroscope.matrix,
        model.gyroscope.bias + model.gyroscope.matrix @ change[24:27],
        model.gyroscope.asymmetry,
    )
    sensitivity = model.g_sensitivity
    if sensitivity is not None:
        sensitivity = sensitivity + model.gyroscope.matrix @ change[27:].reshape(3, 3)
    return change_frame(ImuModel(model.accelerometer, gyro, sensitivity), "mean-gyro")


Function = Callable[[Series], Series]


def _carried(function: Function, outcome: StrapdownOutcome, covariance: Square) -> Table:
    """Covariance of a function of the errors, by central differences."""
    sigma = np.sqrt(np.diag(covariance))
    columns: list[Series] = []
    for k, size in enumerate(sigma.tolist()):
        change = np.zeros(sigma.size)
        change[k] = STEP * size
        if size == 0.0:
            columns.append(np.zeros_like(function(change)))
            continue
        columns.append((function(change) - function(-change)) / (2.0 * change[k]))
    slope: Table = np.column_stack(columns)
    return slope @ covariance @ slope.T


def _has_sensitivity(outcome: StrapdownOutcome) -> bool:
    return outcome.model.g_sensitivity is not None


def _canonical(outcome: StrapdownOutcome) -> tuple[list[str], Function]:
    names: list[str] = []
    for triad in ("accelerometer", "gyroscope"):
        names += [f"{triad}.matrix[{i},{j}]" for i in range(3) for j in range(3)]
        names += [f"{triad}.bias[{i}]" for i in range(3)]
        names += [f"{triad}.asymmetry[{i}]" for i in range(3)]
    if _has_sensitivity(outcome):
        names += [f"gyroscope.g_sensitivity[{i},{j}]" for i in range(3) for j in range(3)]

    def evaluate(change: Series) -> Series:
        model = _moved(outcome, change)
        parts: list[Series] = []
        for triad in (model.accelerometer, model.gyroscope):
            assert triad is not None
            assert triad.asymmetry is not None
            parts += [triad.matrix.ravel(), triad.bias, triad.asymmetry]
        if model.g_sensitivity is not None:
            parts.append(model.g_sensitivity.ravel())
        return np.concatenate(parts)

    return names, evaluate


def _named(recording: Recording, outcome: StrapdownOutcome) -> tuple[list[str], list[str], Function]:
    """Labels, units and values in Savage's convention; scale factors of counts as they are."""
    factors = (
        specific_force_factor(recording.specific_force_unit),
        angular_rate_factor(recording.angular_rate_unit),
    )
    units = recording.specific_force_unit, recording.angular_rate_unit
    labels: list[str] = []
    of: list[str] = []

    def add(words: list[str], unit: str) -> None:
        labels.extend(words)
        of.extend([unit] * len(words))

    for short, factor, unit, si in (
        ("accelerometer", factors[0], units[0], "m/s²"),
        ("gyro", factors[1], units[1], "rad/s"),
    ):
        add([f"{short} bias {axis}" for axis in "xyz"], unit)
        kind = "scale factor error" if factor else "scale factor"
        add([f"{short} {kind} {axis}" for axis in "xyz"], "1" if factor else f"{unit}/({si})")
        if short == "gyro":
            add([f"gyro non-orthogonality {'xyz'[i]}{'xyz'[j]}" for i, j in PAIRS], "rad")
        else:
            add([f"accelerometer misalignment {'xyz'[i]}{'xyz'[j]}" for i, j in OFF_DIAGONAL], "rad")
        add([f"{short} asymmetry {axis}" for axis in "xyz"], "1")
    if _has_sensitivity(outcome):
        pairs = [(a, b) for a in "xyz" for b in "xyz"]
        add([f"g-sensitivity of gyro {a} to force {b}" for a, b in pairs], f"{units[1]}/(m/s²)")

    def evaluate(change: Series) -> Series:
        model = _moved(outcome, change)
        assert model.accelerometer is not None
        assert model.gyroscope is not None
        parts: list[Series] = []
        for triad, factor in ((model.accelerometer, factors[0]), (model.gyroscope, factors[1])):
            # Of counts each sensor's angle is against its own scale factor.
            scale = np.diag(triad.matrix).copy()
            size = 1.0 / factor if factor else scale
            parts += [triad.bias, scale * factor - 1.0 if factor else scale]
            angles = (triad.matrix.T / size).T
            if triad is model.gyroscope:
                parts.append(np.array([angles[i, j] + angles[j, i] for i, j in PAIRS]))
            else:
                parts.append(np.array([angles[i, j] for i, j in OFF_DIAGONAL]))
            assert triad.asymmetry is not None
            parts.append(triad.asymmetry)
        if model.g_sensitivity is not None:
            parts.append(model.g_sensitivity.ravel())
        return np.concatenate(parts)

    return labels, of, evaluate


def _fits(outcome: StrapdownOutcome) -> tuple[SequenceFit, ...]:
    return tuple(
        SequenceFit(
            sequence.name,
            tuple(sequence.rotations),
            tuple(residual.tolist()),
            tuple(sigma.tolist()),
            sequence.seconds,
        )
        for sequence, residual, sigma in zip(
            outcome.sequences, outcome.solution.residuals, outcome.solution.sigmas, strict=True
        )
    )


def _groups(change: Series) -> dict[str, float]:
    """Root mean square of what a pass changed, by group of errors."""
    return {name: float(np.sqrt(np.mean(change[at] ** 2))) for name, at in GROUPS.items()}


def _not_determined(outcome: StrapdownOutcome) -> list[str]:
    sentences: list[str] = []
    untold = [name for k, name in enumerate(NAMES) if not outcome.solution.determined[k]]
    if untold:
        sentences.append(
            f"The sequences that were found do not determine {', '.join(untold)} (Savage's names): "
            "rough values from the nominal attitudes stand for them, believed to 10 mrad, 1 % or 0.1 "
            "m/s²."
        )
    sigma = np.sqrt(np.diag(outcome.solution.covariance)[GROUPS["kappa_asym"]])
    believed = [axis for axis, spread in zip("xyz", sigma, strict=True) if spread > 0.5 * BELIEVED_ASYMMETRY]
    if believed:
        rows = {"x": "2 and 2a", "y": "1 and 1a", "z": "3 and 3a"}
        sentences.append(
            f"The scale factor asymmetry of gyro {', '.join(believed)} was not measured (it needs the "
            f"sequences {', '.join(rows[axis] for axis in believed)}): it is believed to be none to "
            f"{1e6 * BELIEVED_ASYMMETRY:.0f} ppm. The scale factor is as uncertain."
        )
    sentences.append(
        "Gravity of another site shows as equal scale factor errors of all accelerometers: nothing "
        "separates the two."
    )
    return sentences


def _objections(outcome: StrapdownOutcome, site: Site) -> list[str]:
    earth = outcome.earth
    if earth is None:
        return []
    against: list[str] = []
    if abs(earth.heading) > max(CONTRADICTION * earth.heading_sigma, SMALLEST_HEADING):
        against.append(
            f"The Earth rate that the gyros show at rest puts north {np.degrees(earth.heading):+.2f}° "
            f"± {np.degrees(earth.heading_sigma):.2g}° (clockwise) from where the protocol has it. "
            "Put right the heading of the fixture (`heading_deg` of the starts). Until then the "
            "Earth rate is taken out in the wrong direction."
        )
    if site.latitude is not None:
        elsewhere = latitude_shown(earth.sensitivity, np.eye(3), earth.covariance, site.latitude, 1.0)
        against += [] if elsewhere is None else [elsewhere]
    return against


def _remarks(outcome: StrapdownOutcome, site: Site) -> list[str]:
    remarks = list(outcome.words)
    unknown = max(s.unknown_rate for s in outcome.sequences)
    if unknown > 0.0:
        seconds = float(np.median([s.seconds for s in outcome.sequences]))
        what = "latitude" if site.latitude is None else "headings of the starts"
        remarks.append(
            f"Without the {what} the Earth rate cannot be taken out: over {two_digits(seconds)} s it turns the "
            f"computed frame by up to {two_digits(1e3 * unknown * seconds)} mrad, which stands in the "
            f"uncertainties. Give {'--site LATITUDE' if site.latitude is None else '`heading_deg` in the protocol'}."
        )
    elif (
        outcome.earth is not None
        and outcome.earth.heading_sigma < SEEN_NORTH
        and not _objections(outcome, site)
    ):
        remarks.append(
            f"The Earth rate that the gyros show at rest puts north {np.degrees(outcome.earth.heading):+.2g}° ± "
            f"{np.degrees(outcome.earth.heading_sigma):.2g}° from where the protocol has it."
        )
    changes = " → ".join(
        two_digits(1e6 * float(np.sqrt(np.mean(change[:9] ** 2)))) for change in outcome.passes
    )
    remarks.append(
        f"Played back {len(outcome.passes)} times; the gyros' errors changed by {changes} ppm or µrad rms."
    )
    seconds = float(np.median([s.seconds for s in outcome.sequences]))
    walk = float(np.sqrt(outcome.noise_angle * seconds))
    remarks.append(
        f"What limits: the gyros' walk of angle over a sequence of {two_digits(seconds)} s is "
        f"{two_digits(1e6 * walk)} µrad. From one sequence alone that is "
        f"{two_digits(1e6 * walk / (2.0 * np.pi))} ppm of a scale factor and "
        f"{two_digits(1e6 * walk / 2.0)} µrad of an accelerometer's misalignment. What the fixture is "
        "off by does not enter to first order."
    )
    return remarks
