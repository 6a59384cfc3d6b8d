"""The filter that judges drives and predicts: its states, its noise, and why its innovations are not as expected.

Noise is that of a data sheet, a document or the drive. Innovations differ at rest and in motion, by positions and
by vibration.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence

import numpy as np

from tumble.arrays import Series, Vectors, block_means
from tumble.errors import RecordingError
from tumble.navigation import Drive, FilterRun, FilterSetup, TriadSpread, plan_filter, position_differences
from tumble.navigation.time_alignment import track_velocities
from tumble.noise.terms import NoiseModel
from tumble.simulation.grades import Grade, TriadGrade
from tumble.workflows.verification.calibration_parts import CorrectedBy, scatter

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
    from tumble.workflows.given.noise_models import read_noise_models, triad_models

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
