"""A recording corrected by parts of a calibration, and what a filter is told of the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tumble.arrays import Matrix, Series, Table, Vector
from tumble.document import Calibration
from tumble.earth import EARTH_RATE
from tumble.errors import CalibrationFileError, UsageError
from tumble.navigation import InertialSamples, SensorState, covariance_from_calibration
from tumble.recording import Recording
from tumble.recording.formats.frames import Frame
from tumble.records import dataclass
from tumble.sensor import ImuModel, Triad
from tumble.units import angular_rate_factor, specific_force_factor
from tumble.workflows.corrected.corrections import needs_temperature
from tumble.workflows.verification.expected_norms import corrected_whole

UNCALIBRATED = "uncalibrated"
AT_REST = "gyro bias from the rest before"
ACCELEROMETERS = "accelerometers only"
GYRO_BIASES = "gyro biases only"
WHOLE = "all"


@dataclass(frozen=True, slots=True)
class CorrectedBy:
    """The samples as a part of a calibration makes them.

    Attributes
    ----------
    part : name of the part.
    samples : in SI.
    model : whose parameters the part knows; a triad that it does not know is None.
    known : names of the parameters of the calibration's covariance that were used.
    rest_sigma : (3,) rad/s, of a gyro bias that a rest told; None where none did.
    """

    part: str
    samples: InertialSamples
    model: ImuModel
    known: tuple[str, ...]
    rest_sigma: Vector | None = None


def without_rest_rate(part: CorrectedBy, first: float, last: float) -> CorrectedBy:
    """Return uncalibrated samples less the gyros' mean in a rest: what anybody can do without a calibration.

    Parameters
    ----------
    part : uncalibrated.
    first, last : s of the rest. The Earth's rotation stays in that mean, and is in its uncertainty.
    """
    samples = part.samples
    still = samples.between(max(first, float(samples.time[0])), last)
    noise = scatter(still.angular_rate_ib_b, samples.interval) / np.sqrt(last - first)
    quiet = replace(
        samples, angular_rate_ib_b=samples.angular_rate_ib_b - still.angular_rate_ib_b.mean(axis=0)
    )
    return CorrectedBy(AT_REST, quiet, part.model, (), np.hypot(noise, EARTH_RATE))


def corrected_by_parts(
    document: Calibration,
    recording: Recording,
    files: Sequence[Path | Frame],
    *,
    temperature: float | None = None,
) -> tuple[list[CorrectedBy], list[str]]:
    """Return the samples uncalibrated, by the accelerometers, by the gyros' biases alone, and by all.

    What is not calibrated has the axes of b to the nearest right angles, its unit's scale and no bias. Of counts the
    scale is the calibration's own mean: then only differences between axes are uncalibrated, and it is said.

    Parameters
    ----------
    document : with the accelerometers' matrix.
    recording : in the calibration's raw units.
    files : it was read from.
    temperature : as for `tumble.workflows.apply.apply`.

    Raises
    ------
    CalibrationFileError
        If the calibration is not of both triads.
    UsageError
        If the recording lacks a triad.
    ThermalSpanError
        If the temperature leaves the calibrated span.
    """
    full = in_b(document)
    model = document.model
    assert model.accelerometer is not None
    assert document.gyroscope is not None
    force, rate = recording.specific_force, recording.angular_rate
    if force is None or rate is None:
        raise UsageError("The recording lacks a triad: navigation takes accelerometers and gyros.")
    plain_force, force_words = _nominal(
        model.accelerometer.matrix, document.raw_units.specific_force, "accelerometers"
    )
    rate_matrix = (model.gyroscope or model.accelerometer).matrix
    if model.gyroscope is None and angular_rate_factor(document.raw_units.angular_rate) is None:
        raise CalibrationFileError(
            "The calibration knows the gyros' bias in counts and no scale: navigation takes the scale too. Calibrate "
            "the gyros by turns, or declare the units when you calibrate."
        )
    plain_rate, rate_words = _nominal(rate_matrix, document.raw_units.angular_rate, "gyros")
    by_bias = Triad(plain_rate.matrix, np.array(document.gyroscope.bias, dtype=float))
    names = tuple(document.covariance_parameters)
    of_force = tuple(name for name in names if name.startswith("accelerometer."))
    of_bias = tuple(name for name in names if name.startswith("gyroscope.bias"))
    remarks = [words for words in (force_words, rate_words) if words]
    if model.gyroscope is None:
        remarks.append(
            "Of the gyros the calibration knows the bias alone: their axes and scale are nominal in every variant."
        )
    wholes = full.correct(force, rate)
    if needs_temperature(document):
        corrected, words = corrected_whole(document, recording, files, temperature)
        remarks += words
        assert corrected.specific_force is not None
        seen = corrected.angular_rate
        wholes = (corrected.specific_force, wholes[1] if seen is None else seen)
    raw_force, raw_rate = plain_force.correct(force), plain_rate.correct(rate)

    def samples(f: np.ndarray, w: np.ndarray) -> InertialSamples:
        return InertialSamples(recording.time, np.ascontiguousarray(f), np.ascontiguousarray(w))

    return [
        CorrectedBy(UNCALIBRATED, samples(raw_force, raw_rate), ImuModel(plain_force, plain_rate), ()),
        CorrectedBy(
            ACCELEROMETERS, samples(wholes[0], raw_rate), ImuModel(full.accelerometer, plain_rate), of_force
        ),
        CorrectedBy(
            GYRO_BIASES, samples(raw_force, by_bias.correct(rate)), ImuModel(plain_force, by_bias), of_bias
        ),
        CorrectedBy(WHOLE, samples(*wholes), full, names),
    ], remarks


def start_covariance(
    part: CorrectedBy, states: Sequence[SensorState], document: Calibration, turn_on: tuple[float, float]
) -> Table:
    """Return a filter's covariance of its sensor states at the start, for samples corrected by a part.

    Parameters
    ----------
    part : of the calibration.
    states : of the filter, whose own sigmas are the data sheet's.
    document : with the covariance.
    turn_on : m/s² and rad/s, how far biases may have moved since the calibration, one sigma.
    """
    at = [i for i, name in enumerate(document.covariance_parameters) if name in part.known]
    known = document.covariance_matrix[np.ix_(at, at)]
    since = np.zeros((len(states), len(states)))
    result = covariance_from_calibration(
        states, part.model, [document.covariance_parameters[i] for i in at], known
    )
    for row, state in enumerate(states):
        calibrated = any(name.startswith(f"{state.kind}.bias") for name in part.known)
        if state.column < 0 and state.decay == 0.0 and calibrated:
            since[row, row] = turn_on[0 if state.kind == "accelerometer" else 1] ** 2
        if (
            part.rest_sigma is not None
            and state.kind == "gyroscope"
            and state.column < 0
            and state.decay == 0.0
        ):
            result[row, :] = result[:, row] = 0.0
            result[row, row] = float(part.rest_sigma[state.row]) ** 2
    return result + since


def in_b(document: Calibration) -> ImuModel:
    """Return the model that a prediction starts from, with nominal gyro axes where only their bias is known.

    Raises
    ------
    CalibrationFileError
        If the accelerometers or the gyros are not calibrated.
    """
    model = document.model
    if model.accelerometer is None or document.gyroscope is None:
        raise CalibrationFileError(
            "Navigation takes accelerometers and gyros, and the calibration has not both: calibrate both triads "
            "(hand-held, multi-position, modified-multi-position, turntable)."
        )
    if model.gyroscope is not None:
        return model
    plain, _ = _nominal(model.accelerometer.matrix, document.raw_units.angular_rate, "gyros")
    return replace(model, gyroscope=Triad(plain.matrix, np.array(document.gyroscope.bias, dtype=float)))


def _nominal(matrix: Matrix, unit: str, kind: str) -> tuple[Triad, str]:
    """The triad of an ideal unit: right angles nearest to a matrix's, and the unit's scale."""
    factor = specific_force_factor(unit) if kind == "accelerometers" else angular_rate_factor(unit)
    rows = matrix / np.sqrt((matrix**2).sum(axis=1, keepdims=True))
    axes: Matrix = np.zeros((3, 3))
    taken: list[int] = []
    for row in np.argsort(-np.abs(rows).max(axis=1)):
        free = np.abs(rows[row]).copy()
        free[taken] = -1.0
        column = int(np.argmax(free))
        taken.append(column)
        axes[row, column] = np.sign(rows[row, column]) or 1.0
    if factor is not None:
        return Triad(axes / factor, np.zeros(3)), ""
    scale = float(np.abs(np.linalg.det(matrix))) ** (1.0 / 3.0)
    words = (
        f"The raw {kind} are counts: uncalibrated they have the calibration's mean scale, so that only differences "
        "between the axes count as uncalibrated, and no bias is known."
    )
    return Triad(scale * axes, np.zeros(3)), words


def scatter(signal: np.ndarray, interval: float) -> Series:
    """Return the density of white noise (u·√s, an axis each) that samples show from one to the next.

    Parameters
    ----------
    signal : (samples, 3) u; vibration counts, slow motion hardly.
    interval : s.
    """
    steps = np.abs(np.diff(signal, axis=0))
    return 1.4826 * np.median(steps, axis=0) / np.sqrt(2.0) * np.sqrt(interval)
