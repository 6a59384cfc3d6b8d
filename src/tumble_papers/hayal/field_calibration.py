"""A simulated unit of the field campaign, its 26 poses, and what tumble's multi-position procedure makes of them.

The unit is drawn from its data sheet in the form that the thesis (Hayal 2010) gives it: bias, scale factors and
non-orthogonality of each triad. The rotation between the triads, linearity and g-sensitivity are left out, as in
the thesis' model. It is recorded in its poses, the holds are found in the recording, cut to their first minutes and
averaged, and their norms adjusted: nothing is taken from the truth.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tumble.arrays import Matrices, Series, Vector, Vectors
from tumble.calibration.equations.triad_unknowns import BIAS, COUNT, SCALE, rough_triad, triad_from_unknowns
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ConvergenceError, ObservabilityError, SegmentationError
from tumble.estimation import Adjustment, snoop_groups
from tumble.estimation.balance import noise_ratio
from tumble.recording.recording import Recording
from tumble.segmentation import HoldMeans, Timeline, find_timeline, observe_holds
from tumble.sensor import ImuModel, Triad
from tumble.sensor.conventions.shin import matrix_from_shin
from tumble.simulation import Grade, find_grade
from tumble.simulation.field_campaign import POSES, WARM_UP, pose_motion, warming
from tumble.simulation.grades import TriadGrade
from tumble.simulation.recordings import simulate_recording
from tumble_papers.hayal.norm import adjust_norm
from tumble_papers.hayal.thesis_simulation import GRAVITY, LATITUDE

SITE = Site(GRAVITY, 0.0, LATITUDE)
RATE = 10.0  # Hz, of the recording of the poses: nothing is lost in means of minutes
TRIADS = ("accelerometer", "gyro")
# s in which a wandering bias has spread to the sheet's in-run stability; no sheet says it.
STABILITY_TIME = 3600.0
# Steps by which a variance of the norms settles, to a share that no number of attitudes can tell; residuals this likely
# by chance ask for none.
STEPS, SETTLED, CHANCE = 8, 0.03, 0.025


@dataclass(frozen=True, slots=True)
class FieldUnit:
    """A unit of the campaign.

    Attributes
    ----------
    grade : its data sheet, with the random walk of its biases, where they wander.
    model : what it really does when the poses begin, but for what is left of the warming.
    left : (2, 3) m/s² and rad/s, how far each bias still was from where it comes to when it was switched on.
    """

    grade: Grade
    model: ImuModel
    left: Vectors


@dataclass(frozen=True, slots=True)
class TriadResult:
    """What an adjustment says of a triad.

    Attributes
    ----------
    triad : to correct with.
    sigmas : (9,) of bias, scale factors, angles yz, zx, zy: sigma0 times the root of the cofactor (3.36); zero of
        what was not estimated.
    plain_sigmas : (9,) of the noise alone, not scaled by sigma0 but where the residuals ask for it.
    sigma0 : of unit weight.
    """

    triad: Triad
    sigmas: Series
    plain_sigmas: Series
    sigma0: float


def sheet_sigmas(spread: TriadGrade) -> Series:
    """Return (9,) sigmas of bias, scale factors and non-orthogonalities by a data sheet.

    Parameters
    ----------
    spread : of a triad.
    """
    # The angle between two axes: each misalignment is about one direction.
    return np.repeat([spread.bias, spread.scale_factor, np.sqrt(2.0) * spread.misalignment], 3)


def draw_unit(imu: str, rng: np.random.Generator, *, wandering: bool) -> FieldUnit:
    """Draw a unit from its data sheet.

    Parameters
    ----------
    imu : "HG1700" or "HG1900".
    rng : source of all numbers.
    wandering : whether its biases walk, to the sheet's in-run stability in an hour; else they stay.
    """
    grade = find_grade(imu.lower())
    if wandering:
        grade = grade.with_wandering_biases(STABILITY_TIME)
    triads = [_drawn(spread, rng) for spread in (grade.accelerometer, grade.gyroscope)]
    sizes = [grade.accelerometer.bias_stability, grade.gyroscope.bias_stability]
    return FieldUnit(
        grade, ImuModel(triads[0], triads[1]), np.array(sizes)[:, None] * rng.standard_normal((2, 3))
    )


def _drawn(spread: TriadGrade, rng: np.random.Generator) -> Triad:
    errors = sheet_sigmas(spread) * rng.standard_normal(9)
    return Triad(np.real(matrix_from_shin(1.0 + errors[3:6], errors[6:9])), errors[:3])


def record_poses(unit: FieldUnit, rng: np.random.Generator) -> tuple[Recording, Vectors]:
    """Record the 26 poses after the warm-up; return the recording and (2, 3) how far the biases have wandered.

    Parameters
    ----------
    unit : what is recorded.
    rng : source of poses and noise.
    """
    recording, truth = simulate_recording(
        pose_motion(rng), RATE, rng, site=SITE, grade=unit.grade, distort=unit.model.distort
    )
    assert recording.specific_force is not None
    assert recording.angular_rate is not None
    cold = warming(WARM_UP + recording.time, 1.0)[:, None]
    recording = replace(
        recording,
        specific_force=recording.specific_force + cold * unit.left[0],
        angular_rate=recording.angular_rate + cold * unit.left[1],
    )
    return recording, np.vstack([truth.force_wander[-1], truth.rate_wander[-1]])


def average_poses(recording: Recording, minutes: tuple[int, ...]) -> dict[int, HoldMeans]:
    """Return the means of the first minutes of each hold, by how many.

    Parameters
    ----------
    recording : of the poses.
    minutes : how many to take.

    Raises
    ------
    SegmentationError
        If there are not 26 holds in it.
    """
    timeline = find_timeline(recording)
    if len(timeline.holds) != POSES:
        raise SegmentationError(f"{len(timeline.holds)} holds were found in a recording of {POSES} poses.")
    return {count: observe_holds(recording, _first_minutes(timeline, count)) for count in minutes}


def _first_minutes(timeline: Timeline, minutes: int) -> Timeline:
    samples = round(60.0 * minutes * RATE)
    holds = tuple(replace(hold, stop=min(hold.stop, hold.start + samples)) for hold in timeline.holds)
    return replace(timeline, holds=holds)


def calibrate_triad(means: HoldMeans, which: slice, triad: str, unknowns: int) -> TriadResult | None:
    """Return what the norms of some poses tell of a triad, or None where the adjustment does not settle.

    Parameters
    ----------
    means : of all poses.
    which : of them are used.
    triad : of `TRIADS`.
    unknowns : 3 (bias) or 9.
    """
    force = triad == "accelerometer"
    observed = means.specific_force if force else means.angular_rate
    covariance = means.specific_force_covariance if force else means.angular_rate_covariance
    assert observed is not None
    assert covariance is not None
    observed, covariance = observed[which], covariance[which]
    start = rough_triad(observed, SITE.gravity) if force else _rate_start(observed)
    reference = SITE.gravity if force else EARTH_RATE
    try:
        values, adjustment, alone = _adjusted(observed, covariance, reference, start, unknowns)
    except (ConvergenceError, ObservabilityError):
        return None
    plain = np.zeros(9)
    plain[:unknowns] = np.sqrt(np.diag(adjustment.cofactor))
    return TriadResult(triad_from_unknowns(values), adjustment.sigma0 * plain, plain, alone)


def _adjusted(
    observed: Vectors, covariance: Matrices, reference: float, start: Series, unknowns: int
) -> tuple[Series, Adjustment, float]:
    """Adjust with as much variance of the norms as residuals ask for; unknowns, adjustment, sigma0 without it."""
    from scipy.special import chdtrc

    values = start

    def solve(extra: float, *, once: bool) -> Adjustment:
        nonlocal values
        values, adjustment = adjust_norm(
            observed, covariance, reference, values, unknowns, extra_variance=extra, once=once
        )
        return adjustment

    alone = solve(0.0, once=False).sigma0
    extra, adjustment = 0.0, solve(0.0, once=False)
    for _ in range(STEPS):
        total = observed.shape[0] / float(np.sum(1.0 / adjustment.linearisation.covariance))
        wanted = max(0.0, extra + (_residual_ratio(adjustment) - 1.0) * total)
        if abs(wanted - extra) <= SETTLED * total:
            break
        extra = wanted
        adjustment = solve(extra, once=True)
    if extra > 0.0:
        plain = solve(0.0, once=True)
        # One degree of freedom tells nothing of the noise.
        checks = plain.redundancy
        if checks < 2 or float(chdtrc(checks, checks * _residual_ratio(plain))) > CHANCE:
            extra = 0.0
    adjustment = solve(extra, once=False)
    return values, adjustment, alone


def _residual_ratio(adjustment: Adjustment) -> float:
    """Return how many times as large as its noise the mean square of the residuals is."""
    return noise_ratio(snoop_groups(adjustment, slice(0, 1)), robust=False)


def _rate_start(observed: Vectors) -> Vector:
    start = np.zeros(COUNT)
    start[BIAS], start[SCALE] = observed.mean(axis=0), 1.0
    return start
