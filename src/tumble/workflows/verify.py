"""Judging a calibration on recordings that it has not seen: hold norms and turn angles."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tumble.arrays import Series
from tumble.calibration import Calibration, read_calibration
from tumble.calibration.gathering import gather
from tumble.calibration.scores import hold_norm_errors, score_turns
from tumble.earth import Site
from tumble.errors import RecordingError
from tumble.recording import read_recordings
from tumble.segmentation import find_timeline, observe_holds, read_intervals
from tumble.workflows.apply import in_calibration_units, raw_factors

# Normalised residuals beyond this contradict the calibration: one in 15,000 by chance.
LARGEST_NORMALISED = 4.0
# A unit keeps its bias within this from one power cycle to the next (consumer data sheets).
TURN_ON_FORCE_BIAS = 0.05  # m/s²
TURN_ON_RATE_BIAS = 0.005  # rad/s


@dataclass(slots=True)
class Verification:
    """Scores of a calibration on other data.

    Attributes
    ----------
    norms : (holds,) corrected norm minus gravity, m/s².
    norm_sigmas : (holds,) from the calibration's covariance, the hold's noise, and gravity, m/s².
    angles : (holds,) rad, gravity carried over the turn after each hold against gravity seen; nan
        where there is no turn to score.
    sizes : (holds,) rad, how far each turn went.
    rate_biases : (3,) raw, the gyro's mean output at rest minus the calibration's bias.
    fit : whether the calibration serves this recording; `reasons` say why, in sentences.
    """

    recording: str
    norms: Series
    norm_sigmas: Series
    angles: Series
    sizes: Series
    durations: Series
    rate_bias_change: Series
    fit: bool
    reasons: list[str] = field(default_factory=list[str])
    remarks: list[str] = field(default_factory=list[str])

    @property
    def rms_norm(self) -> float:
        """Root mean square of `norms`, m/s²."""
        return float(np.sqrt(np.mean(self.norms**2)))

    @property
    def rms_angle(self) -> float:
        """Root mean square of the scored `angles`, rad; nan without turns."""
        scored = self.angles[np.isfinite(self.angles)]
        return float(np.sqrt(np.mean(scored**2))) if scored.size else float("nan")


def verify(
    calibration: str | os.PathLike[str] | Calibration,
    paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    *,
    site: Site | None = None,
    columns: str | None = None,
    units: str | None = None,
    rate: float | None = None,
    intervals: str | os.PathLike[str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> list[Verification]:
    """Judge a calibration by the holds and turns of each recording.

    Parameters
    ----------
    calibration : a ``calibration.json``, its folder, or a `Calibration`.
    paths, columns, units, rate : recordings, as for `tumble.read_recording`.
    site : where they were made; by default the calibration's own site.
    intervals : file of the holds, instead of finding them.

    Raises
    ------
    CalibrationFileError, RecordingError, SegmentationError, UsageError
        If an input is wrong or the recordings hold nothing to judge by.
    """
    say = progress or _silent
    document = calibration if isinstance(calibration, Calibration) else read_calibration(calibration)
    place = site or _site_of(document)
    say("reading")
    results: list[Verification] = []
    for recording in read_recordings(paths, columns=columns, units=units, rate=rate):
        scaled = in_calibration_units(recording, raw_factors(document, recording))
        say("finding holds and turns")
        given = None if intervals is None else read_intervals(Path(intervals))
        timeline = find_timeline(scaled, intervals=given)
        means = observe_holds(scaled, timeline)
        if means.specific_force is None or means.specific_force_covariance is None:
            raise RecordingError("The recording has no accelerometer: there is nothing to verify by.")
        model = document.model
        norms = hold_norm_errors(model, means.specific_force, place.gravity)
        sigmas = _norm_sigmas(document, means.specific_force, means.specific_force_covariance, place)
        none = np.full(norms.size, np.nan)
        angles, sizes, durations, change = none, none.copy(), none.copy(), np.full(3, np.nan)
        if model.gyroscope is not None and scaled.angular_rate is not None:
            scores = score_turns(model, gather(scaled, timeline, means))
            angles, sizes, durations = scores.angle, scores.size, scores.duration
            assert means.angular_rate is not None
            resting = means.angular_rate
            if model.g_sensitivity is not None and model.accelerometer is not None:
                resting = resting - model.accelerometer.correct(means.specific_force) @ model.g_sensitivity.T
            change = np.median(resting, axis=0) - model.gyroscope.bias
        result = Verification(
            recording=", ".join(source.name for source in recording.sources),
            norms=norms,
            norm_sigmas=sigmas,
            angles=angles,
            sizes=sizes,
            durations=durations,
            rate_bias_change=change,
            fit=True,
            remarks=[remark.text for remark in recording.remarks],
        )
        _judge(result, document)
        results.append(result)
    return results


def _site_of(document: Calibration) -> Site:
    block = document.site
    return Site(
        gravity=block.gravity,
        gravity_sigma=block.gravity_standard_uncertainty,
        latitude=None if block.latitude_deg is None else float(np.radians(block.latitude_deg)),
        source="the calibration's own site",
    )


def _norm_sigmas(document: Calibration, means: np.ndarray, noise: np.ndarray, place: Site) -> Series:
    """Return each norm's sigma: calibration, hold noise and wandering bias; gravity's is common.

    The norm's derivative by matrix entry (i, j) is -w_i f_j and by bias -w_i, with w = inv(M)' f / |f|.
    """
    model = document.model
    assert model.accelerometer is not None
    force = model.accelerometer.correct(means)
    unit = force / np.linalg.norm(force, axis=1, keepdims=True)
    weight = unit @ np.linalg.inv(model.accelerometer.matrix)
    names = document.covariance_parameters
    by_parameter = np.zeros((means.shape[0], len(names)))
    for index, name in enumerate(names):
        if name.startswith("accelerometer.matrix"):
            i, j = (int(digit) for digit in name[name.index("[") + 1 : -1].split(","))
            by_parameter[:, index] = -weight[:, i] * force[:, j]
        elif name.startswith("accelerometer.bias"):
            by_parameter[:, index] = -weight[:, int(name[-2])]
    variance = np.einsum("kp,pq,kq->k", by_parameter, document.covariance_matrix, by_parameter)
    variance += np.einsum("ka,kab,kb->k", weight, noise, weight)
    for name, value in document.quality.variance_components.items():
        if name.startswith("accelerometer"):
            variance += value**2
    # The same gravity in calibration and verification cancels; another site's does not.
    own = document.site.gravity_standard_uncertainty
    if abs(place.gravity - document.site.gravity) > 1e-9:
        variance += own**2 + place.gravity_sigma**2
    return np.sqrt(variance)


def _judge(result: Verification, document: Calibration) -> None:
    """Fill `fit` and `reasons`."""
    against: list[str] = []
    normalised = result.norms / result.norm_sigmas
    rms, expected = result.rms_norm, float(np.sqrt(np.mean(result.norm_sigmas**2)))
    chi = float(np.sqrt(np.mean(normalised**2)))
    words = (
        f"{result.norms.size} holds: the corrected specific force is off gravity by {1e3 * rms:.2g} mm/s² rms "
        f"(largest {1e3 * np.max(np.abs(result.norms)):.2g}); the calibration's uncertainty and the noise "
        f"explain {1e3 * expected:.2g} mm/s²."
    )
    if rms > TURN_ON_FORCE_BIAS:
        against.append(
            f"The specific force at rest is off gravity by {1e3 * rms:.3g} mm/s² rms: this is another unit, "
            "another place (--gravity), or the unit has changed."
        )
    elif chi > LARGEST_NORMALISED:
        against.append(
            f"The residuals of the holds are {chi:.1f} times what the calibration's own uncertainty and the "
            "noise explain: the biases have moved (new power cycle, other temperature), or this is another unit; "
            "calibrate again."
        )
    angle = result.rms_angle
    turns = int(np.count_nonzero(np.isfinite(result.angles)))
    turn_words = "No turn could be scored: the gyro is not verified."
    if turns:
        turn_words = (
            f"{turns} turns: gravity carried by the corrected gyro is off by {np.degrees(angle):.2g}° rms "
            f"(largest {np.degrees(np.nanmax(result.angles)):.2g}°)"
        )
        own = document.quality.rms_turn_angle
        if own is not None:
            turn_words += f"; on the calibration's own recording it was {np.degrees(own):.2g}°"
            # A changed bias turns into angle with time; a factor of five is beyond any turn-on change
            # that leaves the calibration of use.
            if angle > max(5.0 * own, np.radians(1.0)):
                against.append(
                    f"Over turns the gyro is off by {np.degrees(angle):.2g}° rms, against {np.degrees(own):.2g}° when "
                    "it was calibrated: its bias or scale has changed, or the columns differ."
                )
        turn_words += "."
    result.fit = not against
    result.reasons = [*against, words, turn_words]


def _silent(_: str) -> None:
    """Tell nobody."""
