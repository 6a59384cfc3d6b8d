"""A recording corrected by parts of a calibration, what a filter is told of the rest, and the filter itself.

It judges drives and predicts. Noise is that of a data sheet, a document or the drive. Innovations differ at rest and
in motion, by positions and by vibration.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tumble.arrays import Matrix, Series, Table, Vector, Vectors, block_means
from tumble.document import Calibration
from tumble.earth import EARTH_RATE
from tumble.errors import CalibrationFileError, RecordingError, UsageError
from tumble.navigation import (
    Drive,
    FilterRun,
    FilterSetup,
    InertialSamples,
    SensorState,
    TriadSpread,
    covariance_from_calibration,
    plan_filter,
    position_differences,
    track_velocities,
)
from tumble.noise import NoiseModel
from tumble.recording import Frame, Recording
from tumble.records import dataclass
from tumble.sensor import ImuModel, Triad
from tumble.simulation import Grade, TriadGrade
from tumble.units import angular_rate_factor, specific_force_factor
from tumble.workflows.verify import corrected_whole

UNCALIBRATED = "uncalibrated"
AT_REST = "gyro bias from the rest before"
ACCELEROMETERS = "accelerometers only"
GYRO_BIASES = "gyro biases only"
WHOLE = "all"


@dataclass(frozen=True)
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
    if document.thermal is not None or temperature is not None:
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


# Between these, in squared normalised innovations, nothing has to be explained.
_CONSISTENT = (0.7, 1.5)
_SLOW = 0.2  # m/s
_FEWEST = 10
# s over which vibration averages out.
_MEAN = 0.5


def about_innovations(drive: Drive, run: FilterRun) -> str:
    """Return why innovations are not of the size that a filter expects, with evidence from the drive, or "".

    Parameters
    ----------
    drive, run : of the calibrated samples.
    """
    distances: Series = run.distances[:, 0] / 3.0
    taken = np.isfinite(distances) & run.taken[:, 0]
    if not taken.any() or _CONSISTENT[0] <= float(np.mean(distances[taken])) <= _CONSISTENT[1]:
        return ""
    speed = np.interp(
        run.time[run.fix_events],
        drive.track.time,
        _speed(drive),
    )
    parts = [
        (name, taken & chosen) for name, chosen in (("at rest", speed < _SLOW), ("in motion", speed >= _SLOW))
    ]
    means = [
        f"{float(np.mean(distances[chosen])):.2f} {name}" for name, chosen in parts if chosen.sum() >= _FEWEST
    ]
    told = f"They are {' and '.join(means)}" if means else ""
    evidence = [words for words in (_positions_at_rest(drive), _vibration(drive)) if words]
    if float(np.mean(distances[taken])) > 1.0:
        ends = "errors of the sensors, or of the positions, are larger than was said"
    else:
        ends = "what the filter was given is too large, and its stated uncertainties are"
    return "; ".join([part for part in (told, *evidence) if part] + [ends]) + "."


def _speed(drive: Drive) -> Series:
    speed: Series = np.sqrt(np.nansum(track_velocities(drive.track)[:, :2] ** 2, axis=1))
    return speed


def _rest(drive: Drive) -> tuple[float, float]:
    """The longest rest, less half a second at either end."""
    speed = _speed(drive)
    time = drive.track.time
    slow = (speed < _SLOW) & (time >= drive.start.time)
    slow &= time < drive.samples.time[-1]
    edges = np.diff(np.concatenate([[0], slow.astype(int), [0]]))
    ends = zip(np.flatnonzero(edges == 1).tolist(), (np.flatnonzero(edges == -1) - 1).tolist(), strict=True)
    first, last = max(ends, key=lambda pair: float(time[pair[1]] - time[pair[0]]), default=(0, 0))
    return float(time[first]) + 0.5, float(time[last]) - 0.5


def _positions_at_rest(drive: Drive) -> str:
    """How positions at rest scatter from one to the next, against what is stated."""
    first, last = _rest(drive)
    still = drive.track.rows((drive.track.time >= first) & (drive.track.time <= last))
    if len(still) < _FEWEST:
        return ""
    north, east, down = (np.full(len(still), float(column[0])) for column in still.position)
    apart: Vectors = position_differences(still.position, (north, east, down))
    away = np.asarray(apart[:, :2], dtype=np.float64)
    scattered: Series = np.var(away, axis=0)
    found = float(np.sqrt(scattered.mean()))
    stated = float(np.sqrt(np.mean(np.diagonal(still.position_covariance_n, axis1=1, axis2=2)[:, :2])))
    centred = away - away.mean(axis=0)
    later = max(1, round(1.0 / max(still.interval, 1e-3)))
    alike = float(np.sum(centred[later:] * centred[:-later]) / max(float(np.sum(centred**2)), 1e-300))
    correlated = f", and correlate by {alike:.1f} a second later" if alike > 0.2 else ""
    return (
        f"positions at rest scatter by {1e3 * found:.0f} mm in plane where {1e3 * stated:.0f} mm are stated"
        f"{correlated}"
    )


def _vibration(drive: Drive) -> str:
    """By how much samples at rest scatter more than means over half a second would: vibration is no white noise."""
    try:
        still = drive.samples.between(*_rest(drive))
    except RecordingError:
        return ""
    many = max(1, round(_MEAN / still.interval))
    rows = len(still) // many
    if rows < _FEWEST:
        return ""
    ratios: list[float] = []
    for signal in (still.specific_force_b, still.angular_rate_ib_b):
        means = block_means(signal, many)
        slow = scatter(means, still.interval * many)
        ratios.append(float(np.max(scatter(signal, still.interval) / np.maximum(slow, 1e-12))))
    if max(ratios) < 2.0:
        return ""
    return (
        f"samples at rest scatter up to {ratios[0]:.1f} (specific force) and {ratios[1]:.1f} times "
        "(angular rate) as much as their half-second means suggest, so that vibration counts as "
        "white noise"
    )


# A minute shows a bias by its walk: K is the bias instability over the root of this, s.
_WANDER = 100.0


def drive_filter(
    part: CorrectedBy,
    grade: Grade,
    lever_arm_b: Series,
) -> tuple[FilterSetup, list[str]]:
    """Return the filter that all variants share, and words on it.

    Parameters
    ----------
    part : the samples by the whole calibration.
    grade : the data sheet.
    lever_arm_b : (3,) m.
    """
    interval, triads = part.samples.interval, (grade.accelerometer, grade.gyroscope)
    forces, rates = (
        walking([sheet_noise(triad)] * 3, scatter(signal, interval))
        for triad, signal in zip(
            triads, (part.samples.specific_force_b, part.samples.angular_rate_ib_b), strict=True
        )
    )
    sheet = [
        TriadSpread(t.bias, t.scale_factor, misalignment=float(np.hypot(t.misalignment, t.alignment)))
        for t in triads
    ]
    setup = plan_filter(forces, rates, accelerometer=sheet[0], gyroscope=sheet[1], lever_arm_b=lever_arm_b)
    words = [
        (
            f"One filter of {9 + len(setup.states)} states for all variants: the same clock, fixes at 1 Hz, lever "
            f"arm and noise. White noise and bias walks are the data sheet's ({grade.name}), white noise no less "
            "than the drive's own scatter "
            "from sample to sample."
        ),
        (
            "Sensor states start with the calibration's covariance where a variant uses it, and with the data sheet's "
            f"spread ({grade.name}) where not."
        ),
    ]
    return setup, words


def noise_of_document(noise: str | os.PathLike[str]) -> tuple[list[NoiseModel], list[NoiseModel]]:
    """Return the models of `noise.json` for each triad in SI.

    Parameters
    ----------
    noise : what `tumble noise` wrote.

    Raises
    ------
    UsageError
        If it is no such document, or of counts.
    """
    from tumble.workflows.noise import read_noise_models, triad_models

    models = read_noise_models(noise)
    triads = [triad_models(models, letter, si, 1.0, si) for letter, si in (("a", "m/s²"), ("g", "rad/s"))]
    return triads[0], triads[1]


def sheet_noise(triad: TriadGrade) -> NoiseModel:
    """Return the noise of a data sheet as a model.

    Parameters
    ----------
    triad : of the sheet.
    """
    own = triad.noise
    return NoiseModel(
        random_walk=own.random_walk,
        bias_instability=own.bias_instability,
        rate_random_walk=own.rate_random_walk,
    )


def walking(
    models: Sequence[NoiseModel], floors: Iterable[float] = (0.0, 0.0, 0.0)
) -> tuple[NoiseModel, NoiseModel, NoiseModel]:
    """Return white noise and bias walks of a triad: an instability walks as far in 100 s as it is.

    Parameters
    ----------
    models : of x, y and z.
    floors : u/√Hz, that the white noise is no less than.
    """
    x, y, z = (
        NoiseModel(
            random_walk=max(model.random_walk, float(floor)),
            rate_random_walk=max(model.rate_random_walk, model.bias_instability / float(np.sqrt(_WANDER))),
        )
        for model, floor in zip(models, floors, strict=True)
    )
    return x, y, z
