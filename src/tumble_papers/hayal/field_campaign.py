"""Many simulated field campaigns: each unit calibrated in every way of chapter 5, its cart navigated with each.

The unit is drawn from its data sheet in the form that the thesis (Hayal 2010) gives it: bias, scale factors and
non-orthogonality of each triad. The rotation between the triads, linearity and g-sensitivity are left out, as in
the thesis' model. It is recorded in its poses, the holds are found in the recording, cut to their first minutes and
averaged, and their norms adjusted: nothing is taken from the truth.

The cart is navigated with any calibration by the filter of 27 states, with outages.
Satellite positions come ten times a second, differential and with the ambiguities of the phases fixed, and the
unit's samples are increments over a 25th of a second, which lose nothing on a cart. The filter starts at rest from
an attitude that is known to a milliradian and half a degree of heading, the same for all calibrations, and fixes it
in the minute before the cart is pulled. Outages begin when it is: an outage's error is against the position that
the receiver had at its end.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

from tumble.arrays import AnyArray, Matrices, Matrix, Series, Vector, Vectors
from tumble.calibration import BIAS, COUNT, SCALE, rough_triad, triad_from_unknowns
from tumble.counting import counted
from tumble.earth import EARTH_RATE, Site, curvature_radii
from tumble.errors import ConvergenceError, ObservabilityError, SegmentationError
from tumble.estimation import Adjustment, noise_ratio, snoop_groups
from tumble.navigation import (
    Alignment,
    Drive,
    FilterSetup,
    GnssTrack,
    InertialSamples,
    NavigationState,
    TimeAlignment,
    TriadSpread,
    make_track,
    outages,
    plan_filter,
)
from tumble.noise import NoiseModel
from tumble.recording import Recording
from tumble.segmentation import HoldMeans, Timeline, find_timeline, observe_holds
from tumble.sensor import ImuModel, Triad, matrix_from_shin
from tumble.simulation import (
    CART,
    POSES,
    REST,
    WARM_UP,
    Grade,
    SplineTrajectory,
    TravelledStates,
    TriadGrade,
    cart_trajectory,
    find_grade,
    pose_motion,
    simulate_noise,
    simulate_recording,
    warming,
)
from tumble_papers.hayal.norm import adjust_norm
from tumble_papers.hayal.norm_batch import GRAVITY, LATITUDE
from tumble_papers.hayal.scenarios import IMUS, MINUTES, SCENARIOS, sheet_sigmas

SITE = Site(GRAVITY, 0.0, LATITUDE)
RATE = 10.0  # Hz, of the recording of the poses: nothing is lost in means of minutes
TRIADS = ("accelerometer", "gyro")
# s in which a wandering bias has spread to the sheet's in-run stability; no sheet says it.
STABILITY_TIME = 3600.0
# Steps by which a variance of the norms settles, to a share that no number of attitudes can tell; residuals this likely
# by chance ask for none.
STEPS, SETTLED, CHANCE = 8, 0.03, 0.025


@dataclass(frozen=True)
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


@dataclass(frozen=True)
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


CART_RATE, FIXES = 25.0, 10.0  # Hz
FIX_SIGMAS = np.array([0.01, 0.01, 0.02])  # m, north, east, down
START_SIGMAS = np.array([1e-3, 1e-3, np.radians(0.5)])  # rad
CARRIED = 900.0  # s from the last pose to the cart
EVERY = 10.0  # s between outages of which each is by itself
# Bias, scale factors, then yx, zx, zy of a lower triangle: the angles yz, zy and zx of the thesis.
_ORDER = (0, 1, 2, 3, 4, 5, 6, 8, 7)


@dataclass(frozen=True)
class CartDrive:
    """A recorded drive of the cart.

    Attributes
    ----------
    samples : raw.
    track : of the receiver.
    start : what the filter is told of it.
    grade : the unit's data sheet.
    """

    samples: InertialSamples
    track: GnssTrack
    start: NavigationState
    grade: Grade


@dataclass(frozen=True)
class Calibrated:
    """What a filter is told of the sensors: the thesis' initial states and their standard deviations.

    Attributes
    ----------
    model : with which the samples are corrected; what is left has zero for its initial states.
    sigmas : (18,) of the accelerometers' nine and the gyros' nine.
    """

    model: ImuModel
    sigmas: Series


def calibrated(
    grade: Grade, force: TriadResult | None, rate: TriadResult | None, *, scaled: bool = True
) -> Calibrated:
    """Return what the filter is told: of a calibration where there is one, of the data sheet else.

    Parameters
    ----------
    grade : the data sheet.
    force, rate : of either triad; what they did not estimate is nominal with the sheet's sigma.
    scaled : take the sigmas that are scaled by sigma0, as the thesis does.
    """
    triads: list[Triad] = []
    sigmas: list[Series] = []
    for found, spread in ((force, grade.accelerometer), (rate, grade.gyroscope)):
        own = sheet_sigmas(spread)
        if found is None:
            triads.append(Triad(np.eye(3), np.zeros(3)))
            sigmas.append(own)
            continue
        told = found.sigmas if scaled else found.plain_sigmas
        triads.append(found.triad)
        sigmas.append(np.where(told > 0.0, told, own))
    return Calibrated(ImuModel(triads[0], triads[1]), np.concatenate(sigmas))


def record_cart(unit: FieldUnit, wander: Vectors, rng: np.random.Generator) -> CartDrive:
    """Record the cart.

    Parameters
    ----------
    unit : on the cart.
    wander : (2, 3) how far its biases had wandered in the last pose.
    rng : source of the path's unevenness and of all noise.
    """
    trajectory = cart_trajectory(rng)
    edges = np.arange(round((REST + CART) * CART_RATE) + 1) / CART_RATE
    angle, velocity = trajectory.increments(edges, 2)
    force, rate = unit.model.distort(CART_RATE * velocity, CART_RATE * angle)
    spreads = (unit.grade.accelerometer, unit.grade.gyroscope)
    raw: list[Vectors] = []
    for k, (signal, spread) in enumerate(zip((force, rate), spreads, strict=True)):
        carried = spread.noise.rate_random_walk * np.sqrt(CARRIED) * rng.standard_normal(3)
        noise = simulate_noise(spread.noise, len(signal), CART_RATE, rng)
        raw.append(np.vstack([np.zeros((1, 3)), signal + noise + wander[k] + carried]))
    samples = InertialSamples(edges, raw[0], raw[1], means=True)
    track = _fixes(trajectory, rng)
    return CartDrive(samples, track, _start(trajectory, rng), unit.grade)


def _fixes(trajectory: SplineTrajectory, rng: np.random.Generator) -> GnssTrack:
    time = np.arange(1, round((REST + CART) * FIXES)) / FIXES
    true = trajectory.states(time)
    north, east, down = (FIX_SIGMAS * rng.standard_normal((len(time), 3))).T
    meridian, across = curvature_radii(true.latitude)
    longitude = true.longitude + east / ((across + true.height) * np.cos(true.latitude))
    position = (true.latitude + north / (meridian + true.height), longitude, true.height - down)
    return make_track(time, position, np.tile(FIX_SIGMAS, (len(time), 1)), name="cart")


def _start(trajectory: SplineTrajectory, rng: np.random.Generator) -> NavigationState:
    true: TravelledStates = trajectory.states(np.zeros(1))
    off = Rotation.from_rotvec(-START_SIGMAS * rng.standard_normal(3))
    C_nb: Matrix = (off * Rotation.from_quat(true.quaternion_nb[0])).as_matrix()
    at = (float(true.latitude[0]), float(true.longitude[0]), float(true.height[0]))
    return NavigationState(0.0, *at, np.zeros(3), C_nb)


def filter_setup(grade: Grade, sigmas: Series) -> FilterSetup:
    """Return the filter of 27 states: nine of navigation, bias, scale factor and non-orthogonality of each axis.

    Parameters
    ----------
    grade : whose random walks it is told; that of the biases is zero unless they wander.
    sigmas : (18,) of the sensor states at the start.
    """
    triads = (grade.accelerometer, grade.gyroscope)
    setup = plan_filter(
        *(
            NoiseModel(random_walk=t.noise.random_walk, rate_random_walk=t.noise.rate_random_walk)
            for t in triads
        ),
        accelerometer=_states(grade.accelerometer),
        gyroscope=_states(grade.gyroscope),
    )
    ordered = np.concatenate([sigmas[:9][list(_ORDER)], sigmas[9:][list(_ORDER)]])
    # There are no outliers among the fixes, and a filter that is off shall show it.
    return replace(setup.with_sensor_covariance(np.diag(ordered**2)), gate=0.0)


def _states(spread: TriadGrade) -> TriadSpread:
    bias, scale, angle = sheet_sigmas(spread)[::3]
    return TriadSpread(bias=bias, scale_factor=scale, non_orthogonality=angle)


def outage_errors(
    drive: CartDrive, told: Calibrated, durations: Sequence[float], *, gaps: bool
) -> list[Vectors] | None:
    """Return (outages, 3) m, north, east, down, of each length; None where the filter is lost for good.

    Parameters
    ----------
    drive : of the cart.
    told : what the filter is told of the sensors.
    durations : s without a fix.
    gaps : again and again with one fix between; else each by itself, every ten seconds.
    """
    raw = drive.samples
    force, rate = told.model.correct(raw.specific_force_b, raw.angular_rate_ib_b)
    samples = replace(raw, specific_force_b=force, angular_rate_ib_b=rate)
    alignment = Alignment(drive.start.C_nb, np.diag(START_SIGMAS**2), "a start that was given")
    ready = Drive(samples, drive.track, drive.start, alignment, _SAME_CLOCK)
    setup = filter_setup(drive.grade, told.sigmas)
    try:
        found = outages(
            ready, setup, durations, interval=1.0 / FIXES, every=EVERY, settle=REST, repeated=gaps
        )
    except ConvergenceError:
        return None
    return [errors.errors_n for errors in found]


_SAME_CLOCK = TimeAlignment(0.0, 0.0, 1.0, 0.0, REST + CART, "; one clock")


def position_sigma(errors_n: Vectors) -> float:
    """Return the thesis' standard deviation of a position error (5.3), m.

    Parameters
    ----------
    errors_n : (outages, 3) m.
    """
    return float(np.sqrt(np.sum(np.var(errors_n, axis=0))))


def mean_error(errors_n: Vectors) -> float:
    """Return the length of the mean position error, m.

    Parameters
    ----------
    errors_n : (outages, 3) m.
    """
    mean: Vector = np.mean(errors_n, axis=0)
    return float(np.linalg.norm(mean))


GAPS, SLIDING = "gaps", "sliding"
OUTAGES = (2.0, 10.0, 30.0, 60.0)


@dataclass(frozen=True)
class Case:
    """A way to start the filter.

    Attributes
    ----------
    scenario : of the poses; 0 for none, that is no calibration.
    minutes : of each pose.
    gyro : parameters of the gyros that are told: 0, 3 or 9. The accelerometers' are nine, but in scenario 0.
    scaled : whether the sigmas are scaled by sigma0, as the thesis does.
    """

    scenario: int = 0
    minutes: int = 3
    gyro: int = 0
    scaled: bool = True

    @property
    def words(self) -> str:
        """What tables call it."""
        return f"scenario {self.scenario}, gyros {self.gyro} par., {self.minutes} min"


ORIGINAL = Case()
EVERY_SCENARIO = (
    ORIGINAL,
    *(Case(scenario, minutes, gyro) for scenario in SCENARIOS for gyro in (3, 9) for minutes in MINUTES),
)
"""Of tables 5.5 and 5.6."""
SUB_SCENARIOS = {"original": ORIGINAL, "3.0": Case(3, 3, 0), "3.3": Case(3, 3, 3), "3.9": Case(3, 3, 9)}
"""Of table 5.7, by their names there."""
UNSCALED = Case(3, 3, 9, scaled=False)


@dataclass
class Positions:
    """Position errors of many campaigns with one case.

    Attributes
    ----------
    sigmas, means : protocol -> (campaigns, lengths) m: (5.3), and the length of the mean error; NaN where there is
        none.
    unsolved : campaigns in which the adjustment did not settle.
    lost : campaigns in which the filter was lost for good.
    """

    sigmas: dict[str, AnyArray] = field(default_factory=dict[str, AnyArray])
    means: dict[str, AnyArray] = field(default_factory=dict[str, AnyArray])
    unsolved: int = 0
    lost: int = 0


Campaigns = Mapping[Case, Positions]


@lru_cache(maxsize=8)
def run_campaigns(
    imu: str,
    cases: tuple[Case, ...],
    durations: tuple[float, ...],
    protocols: tuple[str, ...],
    campaigns: int,
    seed: int,
    *,
    wandering: bool = False,
) -> Campaigns:
    """Return the position errors of many units; those of the last calls are kept.

    Parameters
    ----------
    imu : of `IMUS`.
    cases : ways to start the filter.
    durations : s, of the outages.
    protocols : `GAPS` for repeated outages with one fix between, `SLIDING` for each by itself.
    campaigns : how many units; the first of many are those of few.
    seed : of all random numbers.
    wandering : whether biases walk.
    """
    found = {case: Positions() for case in cases}
    shape = (campaigns, len(durations))
    for positions in found.values():
        for protocol in protocols:
            positions.sigmas[protocol] = np.full(shape, np.nan)
            positions.means[protocol] = np.full(shape, np.nan)
    for campaign in counted(range(campaigns), campaigns):
        rng = np.random.default_rng([seed, IMUS.index(imu), campaign])
        unit = draw_unit(imu, rng, wandering=wandering)
        results, wander = _calibrations(unit, cases, rng)
        drive = record_cart(unit, wander, rng)
        for case, positions in found.items():
            _add(positions, campaign, drive, case, results, durations)
    return found


Results = dict[tuple[int, int, str, int], TriadResult | None]


def _calibrations(
    unit: FieldUnit, cases: Sequence[Case], rng: np.random.Generator
) -> tuple[Results, AnyArray]:
    """Record the poses and adjust what the cases ask for."""
    recording, wander = record_poses(unit, rng)
    wanted = {
        (case.scenario, case.minutes, triad, unknowns)
        for case in cases
        if case.scenario
        for triad, unknowns in (("accelerometer", 9), ("gyro", case.gyro))
        if unknowns
    }
    means = average_poses(recording, tuple(sorted({minutes for _, minutes, *_ in wanted})))
    return {key: calibrate_triad(means[key[1]], SCENARIOS[key[0]], key[2], key[3]) for key in wanted}, wander


def _add(
    positions: Positions,
    campaign: int,
    drive: CartDrive,
    case: Case,
    results: Results,
    durations: tuple[float, ...],
) -> None:
    force, rate = (
        results[case.scenario, case.minutes, triad, unknowns] if case.scenario and unknowns else None
        for triad, unknowns in (("accelerometer", 9), ("gyro", case.gyro))
    )
    if case.scenario and (force is None or (case.gyro and rate is None)):
        positions.unsolved += 1
        return
    told = calibrated(drive.grade, force, rate, scaled=case.scaled)
    for protocol, sigmas in positions.sigmas.items():
        errors = outage_errors(drive, told, durations, gaps=protocol == GAPS)
        if errors is None:
            positions.lost += 1
            return
        sigmas[campaign] = [position_sigma(e) for e in errors]
        positions.means[protocol][campaign] = [mean_error(e) for e in errors]


def pooled(values: AnyArray) -> Series:
    """Return (lengths,) the root of the mean square over the campaigns that have one, NaN where none has.

    Parameters
    ----------
    values : (campaigns, lengths).
    """
    there = np.isfinite(values)
    count = np.maximum(there.sum(axis=0), 1)
    mean: AnyArray = np.sum(np.where(there, values, 0.0) ** 2, axis=0) / count
    return np.asarray(np.where(there.any(axis=0), np.sqrt(mean), np.nan))


def improvements(before: AnyArray, after: AnyArray) -> tuple[Series, AnyArray]:
    """Return (lengths,) how much better in percent, pooled over the campaigns that have both, and (campaigns, lengths).

    Parameters
    ----------
    before, after : (campaigns, lengths) m.
    """
    both = np.isfinite(before) & np.isfinite(after)
    ratio = pooled(np.where(both, after, np.nan)) / pooled(np.where(both, before, np.nan))
    return np.asarray(100.0 * (1.0 - ratio)), np.asarray(100.0 * (1.0 - after / before))
