"""Judging a calibration on other recordings, by hold norms and turn angles and what is expected of them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from tumble.arrays import Series, Square, Table, Vectors
from tumble.calibration import (
    distinct_poses,
    gather,
    hold_norm_errors,
    hold_norm_variances,
    score_turns,
    triad_errors,
)
from tumble.counting import part
from tumble.document import Calibration, read_calibration
from tumble.earth import Site
from tumble.errors import CalibrationFileError, RecordingError
from tumble.parameters import two_digits
from tumble.recording import (
    Frame,
    Recording,
    TemperatureColumn,
    find_steps_of_two,
    read_recordings,
    recording_inputs,
)
from tumble.records import dataclass
from tumble.segmentation import Timeline, find_timeline, observe_holds, read_intervals
from tumble.sensor import ImuModel, Triad
from tumble.workflows.apply import corrected_block, in_calibration_units, raw_factors
from tumble.workflows.corrected import (
    about_temperature,
    check_column,
    check_temperature,
    corrections_of,
    recorded_span,
    refuse_twice,
)
from tumble.workflows.given import given_site
from tumble.workflows.request import VerifyRequest, asked, silent


@dataclass(frozen=True)
class HoldConditions:
    """What each hold was at: the sensor's temperature (°C), its rate (K/s) and hysteresis state, (holds,)."""

    temperature: Series
    rate: Series
    hysteresis: Series


def corrected_whole(
    document: Calibration,
    scaled: Recording,
    files: Sequence[Path | Frame],
    temperature: float | None,
) -> tuple[Recording, list[str]]:
    """Return the recording corrected sample by sample, and remarks.

    Parameters
    ----------
    scaled : in the calibration's raw units.
    temperature : °C of all of it, instead of a column.

    Raises
    ------
    UsageError, RecordingError
        If there is no temperature, or it is not in degrees Celsius.
    ThermalSpanError
        If it leaves the calibrated span.
    """
    told: list[str] = []
    check_temperature(document, scaled, files, temperature, "refuse")
    if document.thermal is not None and temperature is None and scaled.temperature is not None:
        column = TemperatureColumn()
        column.add(scaled.time, scaled.temperature)
        told = check_column(column)
    corrector = document.corrector()
    corrected = corrected_block(corrector, scaled, temperature)
    return corrected, [*told, *about_temperature(document, corrector, recorded_span(scaled, temperature))]


def conditions(
    document: Calibration, recording: Recording, timeline: Timeline, temperature: float | None
) -> HoldConditions | None:
    """Return the mean conditions of each hold, None for a calibration without a thermal model."""
    thermal = document.thermal_model
    if thermal is None:
        return None
    celsius = recording.temperature if temperature is None else np.full(len(recording), temperature)
    assert celsius is not None
    path = thermal.path(recording.time, celsius)
    holds = [slice(hold.start, hold.stop) for hold in timeline.holds]

    def means(series: Series) -> Series:
        return np.array([float(series[hold].mean()) for hold in holds])

    return HoldConditions(means(path.temperature), means(path.rate), means(path.hysteresis))


def norm_covariance(
    document: Calibration, force: Vectors, noise: Series, place: Site, at: HoldConditions | None
) -> Square:
    """Return (holds, holds) the norms' covariance: calibration and gravity are common, hold noise and wander not.

    Gravity's uncertainty is in the calibration's. It cancels where the same gravity is taken for both.

    Parameters
    ----------
    force : (holds, 3) corrected means, m/s².
    noise : (holds,) (m/s²)², from `hold_norm_variances`.
    at : conditions of the holds, for a thermal calibration.
    """
    thermal_names = [] if document.thermal is None else document.thermal.covariance_parameters
    joint = any("[" in name and name.count(".") < 2 for name in thermal_names)
    covariance = np.diag(noise)
    own = document.site.gravity_standard_uncertainty
    same_gravity = abs(place.gravity - document.site.gravity) <= 1e-9
    if not joint:
        by_parameter = _by_parameter(document, document.covariance_parameters, force, at)
        covariance += by_parameter @ document.covariance_matrix @ by_parameter.T
        if same_gravity:
            # the scale factors went with this gravity, and so do the norms
            covariance -= min(own**2, float(np.min(np.diag(covariance) - noise)))
    if document.thermal is not None:
        by_parameter = _by_parameter(document, thermal_names, force, at)
        thermal_covariance = np.array(document.thermal.covariance, dtype=float)
        if thermal_covariance.size:
            covariance += by_parameter @ thermal_covariance @ by_parameter.T
    covariance += force_wander(document) ** 2 * np.eye(len(noise))
    if not same_gravity:
        covariance += place.gravity_sigma**2
    return covariance


def force_wander(document: Calibration) -> float:
    """How far accelerometer biases moved from hold to hold in the calibration, m/s²; of turn-ons, the mean."""
    parts = document.quality.variance_components.items()
    found = sum(value**2 for name, value in parts if name.startswith("accelerometer"))
    return float(np.sqrt(found / (1 if document.turn_ons is None else len(document.turn_ons.recordings))))


_OF_TEMPERATURE = re.compile(r"\.(temperature|rate|hysteresis)\[(?:(\d+),(?=\d))?")
"""What follows a parameter's name in that of its coefficient: of which quantity it is, and which function of it."""


def _by_parameter(
    document: Calibration, names: Sequence[str], force: Vectors, at: HoldConditions | None
) -> Table:
    """Return (holds, parameters) derivatives of the norm; of what is not the accelerometer's they are zero.

    A coefficient of temperature moves the norm as its parameter does at the hold, times its function there.
    """
    thermal = document.thermal_model
    of_what = [_OF_TEMPERATURE.sub("[", name) for name in names]
    rows: list[Series] = []
    for k, one in enumerate(force):
        model = document.model if thermal is None or at is None else thermal.at(float(at.temperature[k]))
        rows.append(
            one / np.linalg.norm(one) @ triad_errors("accelerometer", model.accelerometer, of_what, one)
        )
    table = np.array(rows)
    if thermal is not None and at is not None:
        functions = thermal.basis.values(at.temperature)
        for column, found in enumerate(map(_OF_TEMPERATURE.search, names)):
            if found is not None:
                kind, number = found.groups()
                table[:, column] *= functions[:, int(number)] if kind == "temperature" else getattr(at, kind)
    return table


# Residuals of as small a probability contradict the calibration: four sigmas of a single normal one,
BY_CHANCE = 6.3e-5
# where they are also beyond the expanded uncertainty (k = 2) that users rely on.
EXPANDED = 2.0
# A unit keeps its bias within this from one power cycle to the next (consumer data sheets).
TURN_ON_FORCE_BIAS = 0.05  # m/s²
# Fewer different poses than this leave too much of the accelerometers untouched to judge them.
SMALLEST_POSES = 3
# Turns are off by more than this only with a gyro that is not, or no longer, calibrated.
LARGEST_TURN_ANGLE = np.radians(1.0)


UNITS = {"hold_norm_error": "m/s²", "turn_angle": "rad", "turn_size": "rad"}


@dataclass
class Verification:
    """Scores of a calibration on other data.

    Attributes
    ----------
    fit : whether the calibration serves this recording; `reasons` say why, in sentences.
    hold_norm_error : (holds,) corrected norm minus gravity, m/s².
    hold_norm_standard_uncertainty : (holds,) from the calibration's covariance, the hold's noise, and gravity, m/s².
    turn_angle : (holds,) rad, gravity carried over the turn after each hold against gravity seen; nan
        where there is no turn to score.
    turn_size : (holds,) rad, how far each turn went.
    gyro_bias_change_raw : (3,) the gyro's mean output at rest minus the calibration's bias.
    norm_freedom : as how many independent norms they count, since the calibration's errors are common to all.
    remarks : of the recording.
    """

    recording: str
    fit: bool
    reasons: list[str]
    hold_norm_error: Series
    hold_norm_standard_uncertainty: Series
    turn_angle: Series
    turn_size: Series
    gyro_bias_change_raw: Series
    norm_freedom: float
    remarks: list[str]

    @property
    def document(self) -> dict[str, Any]:
        """What is said of the recording, as plain data; numbers in arrays."""
        told = asdict(self)
        del told["norm_freedom"], told["remarks"]
        return {**told, "units": UNITS}

    @property
    def rms_norm(self) -> float:
        """Root mean square of `hold_norm_error`, m/s²."""
        return float(np.sqrt(np.mean(self.hold_norm_error**2)))

    @property
    def rms_angle(self) -> float:
        """Root mean square of the scored turns, rad; nan without turns."""
        scored = self.turn_angle[np.isfinite(self.turn_angle)]
        return float(np.sqrt(np.mean(scored**2))) if scored.size else float("nan")


@asked(VerifyRequest)
def verify(request: VerifyRequest) -> list[Verification]:
    """Judge a calibration by the holds and turns of each recording.

    Raises
    ------
    CalibrationFileError, RecordingError, SegmentationError, UsageError
        If an input is wrong or the recordings hold nothing to judge by.
    ThermalSpanError
        If the temperature leaves the calibrated span.
    """
    say, calibration, temperature = request.progress or silent, request.calibration, request.temperature
    document = calibration if isinstance(calibration, Calibration) else read_calibration(calibration)
    if document.accelerometer is None or document.accelerometer.matrix is None:
        raise CalibrationFileError(
            "The calibration is of the gyro alone: holds and turns are judged against gravity, which takes the "
            "accelerometers' calibration too; calibrate both triads (hand-held, modified-multi-position)."
        )
    place = given_site(request.site) or _site_of(document)
    files = recording_inputs(request.paths)
    for file in files:
        refuse_twice(document, corrections_of([file], request.topics))
    say("reading")
    results: list[Verification] = []
    recordings = read_recordings(request.paths, **request.how())
    for number, recording in enumerate(recordings):
        own_files = [files[number]] if len(recordings) == len(files) else files
        scaled = in_calibration_units(recording, raw_factors(document, recording))
        model = document.model
        corrected, words = corrected_whole(document, scaled, own_files, temperature)
        if document.thermal is not None:
            ideal = Triad(np.eye(3), np.zeros(3))
            scaled, model = corrected, ImuModel(ideal, None if corrected.angular_rate is None else ideal)
        say("finding holds and turns")
        given = None if request.intervals is None else read_intervals(Path(request.intervals))
        with part(0.0, 0.3):
            timeline = find_timeline(scaled, intervals=given)
        with part(0.3, 1.0):
            result = _verification(document, model, place, scaled, timeline, temperature)
        steps = find_steps_of_two(corrected)
        result.fit = result.fit and not steps
        result.reasons = [*steps, *result.reasons, *words]
        results.append(result)
    return results


def _verification(
    document: Calibration,
    model: ImuModel,
    place: Site,
    recording: Recording,
    timeline: Timeline,
    temperature: float | None,
) -> Verification:
    """What holds and turns of one recording, in the calibration's units, say of it."""
    means = observe_holds(recording, timeline)
    if means.specific_force is None or means.specific_force_covariance is None:
        raise RecordingError("The recording has no accelerometer: there is nothing to verify by.")
    assert model.accelerometer is not None
    norms = hold_norm_errors(model, means.specific_force, place.gravity)
    noise = hold_norm_variances(model.accelerometer, means.specific_force, means.specific_force_covariance)
    force = model.accelerometer.correct(means.specific_force)
    expected = norm_covariance(
        document, force, noise, place, conditions(document, recording, timeline, temperature)
    )
    sigmas, none = np.sqrt(np.diag(expected)), np.full(norms.size, np.nan)
    angles, sizes, change = none, none.copy(), np.full(3, np.nan)
    if model.gyroscope is not None and recording.angular_rate is not None:
        scores = score_turns(model, gather(recording, timeline, means))
        angles, sizes = scores.angle, scores.size
        assert means.angular_rate is not None
        resting = means.angular_rate
        if model.g_sensitivity is not None:
            resting = resting - force @ model.g_sensitivity.T
        change = np.median(resting, axis=0) - model.gyroscope.bias
    freedom = float(norms.size**2 / np.sum((expected / np.outer(sigmas, sigmas)) ** 2))
    names, remarks = [source.name for source in recording.sources], [one.text for one in recording.remarks]
    result = Verification(", ".join(names), True, [], norms, sigmas, angles, sizes, change, freedom, remarks)
    _judge(result, document, len(distinct_poses(force)), made_from(document, recording))
    return result


def made_from(document: Calibration, recording: Recording) -> bool:
    """Return whether a calibration was made from a recording.

    Parameters
    ----------
    document, recording : as read.
    """
    hashes = {name.sha256 for name in document.recordings}
    return any(source.sha256 in hashes for source in recording.sources)


def _site_of(document: Calibration) -> Site:
    block = document.site
    return Site(
        gravity=block.gravity,
        gravity_sigma=block.gravity_standard_uncertainty,
        latitude=None if block.latitude_deg is None else float(np.radians(block.latitude_deg)),
        source="the calibration's own site",
    )


def _judge(result: Verification, document: Calibration, poses: int, own_recording: bool) -> None:
    """Fill `fit` and `reasons`."""
    few = (
        f"{poses} different pose{'s' if poses != 1 else ''} cannot show whether the calibration serves: "
        f"give a recording with at least {SMALLEST_POSES}, better nine."
    )
    against = [
        few if poses < SMALLEST_POSES else "",
        _against_norms(result, stated=bool(document.covariance_parameters)),
        _against_turns(result, document),
    ]
    result.fit = not any(against)
    own = "This is the recording that the calibration was made from: it shows nothing new."
    words = [_words_on_norms(result), _words_on_turns(result, document)]
    result.reasons = [*filter(None, against), *([own] if own_recording else []), *words]


def _against_norms(result: Verification, *, stated: bool) -> str:
    from scipy.special import gammainccinv

    excess = float(np.sqrt(np.mean((result.hold_norm_error / result.hold_norm_standard_uncertainty) ** 2)))
    # a mean of squares that are correlated is spread as one of fewer that are not (Satterthwaite)
    half = 0.5 * result.norm_freedom
    largest = float(np.sqrt(gammainccinv(half, BY_CHANCE) / half))
    if result.rms_norm > TURN_ON_FORCE_BIAS:
        return (
            f"The specific force at rest is off gravity by {two_digits(1e3 * result.rms_norm)} mm/s² rms: this is "
            "another unit, another place (--gravity), or the unit has changed."
        )
    if excess <= max(largest, EXPANDED):
        return ""
    if not stated:
        return (
            f"The residuals of the holds are {excess:.1f} times what the noise alone explains, and the calibration "
            "states no uncertainties that could explain more: calibrate the unit with `tumble calibrate`."
        )
    return (
        f"The residuals of the holds are {excess:.1f} times what the calibration's own uncertainty and the noise "
        "explain. The biases have moved (new power cycle, other temperature), or this is another unit. Calibrate again."
    )


def _against_turns(result: Verification, document: Calibration) -> str:
    angle, own = result.rms_angle, document.quality.rms_turn_angle
    # A changed bias turns into angle with time; a factor of five is beyond any turn-on change that leaves
    # the calibration of use.
    limit = LARGEST_TURN_ANGLE if own is None else max(5.0 * own, LARGEST_TURN_ANGLE)
    if not np.isfinite(angle) or angle <= limit:
        return ""
    off = f"Over turns the gyro is off by {two_digits(np.degrees(angle))}° rms"
    if own is None:
        return f"{off}: the calibration knows only its bias, or nothing of turns."
    return (
        f"{off}, against {two_digits(np.degrees(own))}° when it was calibrated: its bias or scale has changed, "
        "or the columns differ."
    )


def _words_on_norms(result: Verification) -> str:
    expected = float(np.sqrt(np.mean(result.hold_norm_standard_uncertainty**2)))
    largest = float(np.max(np.abs(result.hold_norm_error)))
    return (
        f"Holds: {result.hold_norm_error.size}; the corrected specific force is off gravity by "
        f"{two_digits(1e3 * result.rms_norm)} mm/s² rms (largest {two_digits(1e3 * largest)}); the calibration's "
        f"uncertainty and the noise explain {two_digits(1e3 * expected)} mm/s²."
    )


def _words_on_turns(result: Verification, document: Calibration) -> str:
    scored = result.turn_angle[np.isfinite(result.turn_angle)]
    if not scored.size:
        return "No turn could be scored: the gyro is not verified."
    own = document.quality.rms_turn_angle
    compared = (
        "" if own is None else f"; on the calibration's own recording it was {two_digits(np.degrees(own))}°"
    )
    return (
        f"Turns: {scored.size}; gravity carried by the corrected gyro is off by "
        f"{two_digits(np.degrees(result.rms_angle))}° rms (largest {two_digits(np.degrees(scored.max()))}°){compared}."
    )
