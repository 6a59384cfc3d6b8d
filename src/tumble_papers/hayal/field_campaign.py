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
from functools import lru_cache, partial
from typing import Any

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
from tumble.reproduction import Curve, Marks, Plot, Row, Value
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
from tumble_papers.study import Found, Study, hayal, judge

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


TABLES = {"5.5": "HG1700", "5.6": "HG1900"}
# Fewer campaigns than this are no range.
RANGE = 4
NOT_IN_THESIS = "3.9, plain sigmas"


def scenario_positions(table: str, repetitions: int, seed: int) -> Campaigns:
    """Return what table 5.5 or 5.6 is made of.

    Parameters
    ----------
    table : its number.
    repetitions, seed : how many campaigns, from what.
    """
    return run_campaigns(TABLES[table], EVERY_SCENARIO, OUTAGES[:1], (GAPS,), repetitions, seed)


def sub_scenario_positions(imu: str, repetitions: int, seed: int, *, wandering: bool) -> Campaigns:
    """Return what table 5.7 is made of.

    Parameters
    ----------
    imu : "HG1700" or "HG1900".
    repetitions, seed : how many campaigns, from what.
    wandering : whether biases walk, to the sheet's in-run stability in an hour.
    """
    cases = (*SUB_SCENARIOS.values(), UNSCALED)
    return run_campaigns(imu, cases, OUTAGES, (GAPS, SLIDING), repetitions, seed, wandering=wandering)


def _scenario_table(table: str, repetitions: int, seed: int) -> Found:
    """Make table 5.5 or 5.6 anew: positions after outages of 2 s, scenarios 1 to 4 with 1, 3 and 5 minutes."""
    printed, imu = hayal()["position_tables"][table], TABLES[table]
    found = scenario_positions(table, repetitions, seed)
    first = printed["original"]
    rows = [_original_row("original", imu, first, found, 0)]
    for entry in printed["rows"]:
        for minutes, cell in entry["minutes"].items():
            case = Case(entry["scenario"], int(minutes), entry["gyro_parameters"])
            rows.append(_row(case.words, cell, first, found, case, 0))
    return _found(rows, repetitions, notes=_failures(found))


def _sub_scenario_table(repetitions: int, seed: int, *, wandering: bool) -> Found:
    """Make table 5.7 anew: outages of 2 to 60 s, with no calibration and with three parts of scenario 3's.

    With biases that walk, to the sheet's in-run stability in an hour, the filter knows it.
    """
    rows: list[Row] = []
    notes = [f"{NOT_IN_THESIS}: not in the thesis; as the noise has them, not scaled by sigma0."]
    if wandering:
        notes.append(
            "Biases walk from the first pose on, by the sheet's in-run stability in an hour (its "
            "time is assumed), and the filter knows it. What the poses say of a bias is then old on "
            "the cart, and its sigma too small."
        )
    for imu in IMUS:
        found = sub_scenario_positions(imu, repetitions, seed, wandering=wandering)
        for at, duration in enumerate(OUTAGES):
            first, *cells = printed_outages(imu)[f"{duration:g}"]
            label = f"{imu}, {duration:g} s"
            rows.append(_original_row(f"{label}, original", imu, first, found, at, duration))
            cases = [*list(SUB_SCENARIOS.items())[1:], (NOT_IN_THESIS, UNSCALED)]
            for cell, (name, case) in zip([*cells, None], cases, strict=True):
                rows.append(_row(f"{label}, {name}", cell, first, found, case, at))
        notes += _failures(found, f"{imu}, ")
    return _found(rows, repetitions, notes=notes)


def _found(rows: list[Row], campaigns: int, plots: Sequence[Plot] = (), notes: Sequence[str] = ()) -> Found:
    north, _, down = (100.0 * FIX_SIGMAS).tolist()
    said = {"north": north, "down": down, "enough": RANGE}
    return Found(rows, [*plots], [*notes], said, few=campaigns < RANGE)


def _failures(found: Campaigns, where: str = "") -> list[str]:
    words: list[str] = []
    for case, positions in found.items():
        parts: list[str] = []
        if positions.unsolved:
            parts.append(f"the adjustment did not settle in {positions.unsolved}")
        if positions.lost:
            parts.append(f"the filter was lost for good in {positions.lost}")
        if parts and case.scaled:
            words.append(f"{case.words}: {', '.join(parts)}")
    return [f"{where}campaigns left out: {'; '.join(words)}."] if words else []


def _original_row(
    label: str, imu: str, cell: dict[str, float], found: Campaigns, at: int, duration: float = 2.0
) -> Row:
    """Return the row without calibration, judged by its sigma."""
    ours = found[ORIGINAL]
    cells: list[Value] = [cell["mean"], cell["sigma"], None]
    ratio, fits = np.inf, False
    for protocol, all_sigmas in ours.sigmas.items():
        sigmas = all_sigmas[:, at]
        cells += [float(np.mean(ours.means[protocol][:, at]))] if protocol == GAPS else []
        cells += [float(pooled(sigmas[:, None])[0]), None, f"{sigmas.min():.3g} to {sigmas.max():.3g} m"]
        fits |= bool(sigmas.min() <= cell["sigma"] <= sigmas.max())
        ratio = min(ratio, cell["sigma"] / float(sigmas.max()))
    needed = 2.0 * cell["sigma"] / duration**2
    reason = (
        f"{ratio:.2g} times the worst of ours; from a known start it takes {needed:.2g} m/s² all the time, "
        f"{needed / find_grade(imu.lower()).accelerometer.bias:.2g} times the sheet's bias"
    )
    return Row(label, "m", tuple(cells), *judge(fits, reason, _too_few(len(ours.sigmas[GAPS]))))


def _row(
    label: str,
    cell: dict[str, float] | None,
    original: dict[str, float],
    found: Campaigns,
    case: Case,
    at: int,
) -> Row:
    """Return the row of a calibration, judged by what it makes better or worse of the original."""
    ours, before = found[case], found[ORIGINAL]
    said = None if cell is None else 100.0 * (1.0 - cell["sigma"] / original["sigma"])
    cells: list[Value] = [None, None, None] if cell is None else [cell["mean"], cell["sigma"], said]
    fits, ranges, column = False, list[str](), slice(at, at + 1)
    for protocol, sigmas in ours.sigmas.items():
        whole, each = improvements(before.sigmas[protocol][:, column], sigmas[:, column])
        there: AnyArray = each[np.isfinite(each)]
        ranges.append(f"{there.min():.3g} to {there.max():.3g} %" if there.size else "none")
        if protocol == GAPS:
            mean = ours.means[protocol][:, at]
            cells.append(float(np.nanmean(mean)) if np.isfinite(mean).any() else None)
        cells += [float(pooled(sigmas[:, column])[0]), float(whole[0]) if there.size else None, ranges[-1]]
        fits |= said is not None and bool(there.size) and bool(there.min() <= said <= there.max())
    if said is None:
        return Row(label, "m", tuple(cells))
    reason = f"{'better' if said >= 0.0 else 'worse'} by {abs(said):.3g} %, ours by {' or '.join(ranges)}"
    if case.gyro == 9 and said > 0.0:
        reason += "; nine gyro parameters are off by percents here, and that is no gain"
    return Row(label, "m", tuple(cells), *judge(fits, reason, _too_few(len(before.sigmas[GAPS]))))


def _too_few(campaigns: int) -> str | None:
    return f"fewer than {RANGE} campaigns have no range" if campaigns < RANGE else None


def printed_outages(imu: str) -> dict[str, list[dict[str, Any]]]:
    """Return table 5.7's cells of a unit: length of the outage -> original, 3.0, 3.3, 3.9.

    Parameters
    ----------
    imu : "HG1700" or "HG1900".
    """
    return hayal()["position_tables"]["5.7"]["outages"][imu]


_MINUTES = np.array(MINUTES, dtype=float)
_LENGTHS = np.array(OUTAGES)
_GYROS = (3, 9)


def _scenario_figure(figure: str, repetitions: int, seed: int) -> Found:
    """Make figure 5.5 (HG1700) or 5.6 (HG1900) anew: scenarios 1 to 4 after outages of 2 s."""
    found = scenario_positions(figure, repetitions, seed)
    printed = hayal()["position_tables"][figure]["rows"]
    sigmas = [[row["minutes"][str(m)]["sigma"] for m in MINUTES] for row in printed]
    said = {
        gyro: np.array([s for s, row in zip(sigmas, printed, strict=True) if row["gyro_parameters"] == gyro])
        for gyro in _GYROS
    }
    ours = {gyro: _by_scenario(found, gyro) for gyro in _GYROS}
    rows = [_spread_row(gyro, said[gyro], ours[gyro]) for gyro in _GYROS]
    rows.append(_nine_row(said, ours))
    plots = [_scenario_plot(figure, gyro, said[gyro], ours[gyro]) for gyro in _GYROS]
    return _found(rows, repetitions, plots)


def _by_scenario(found: Campaigns, gyro: int) -> AnyArray:
    """Return (campaigns, scenarios, minutes) m."""
    sigmas = [[found[Case(s, m, gyro)].sigmas[GAPS][:, 0] for m in MINUTES] for s in SCENARIOS]
    return np.moveaxis(np.array(sigmas), -1, 0)


def _spread_row(gyro: int, said: AnyArray, ours: AnyArray) -> Row:
    flat = ours.reshape(len(ours), -1)
    apart: Series = np.nanmax(flat, axis=1) / np.nanmin(flat, axis=1)
    label = f"gyros {gyro} par.: largest σ over the smallest, all scenarios and minutes"
    words = "the thesis' scenarios lie {} apart than ours"
    return _figure_row(label, float(said.max() / said.min()), apart, words, ("farther", "less far"))


def _nine_row(said: dict[int, AnyArray], ours: dict[int, AnyArray]) -> Row:
    """In how many of the twelve cells nine gyro parameters give the better position."""
    better = np.sum(np.where(np.isfinite(ours[9]), ours[9], np.inf) < ours[3], axis=(1, 2)).astype(float)
    label = "cells of 12 in which nine gyro parameters are better than three"
    return _figure_row(label, float(np.sum(said[9] < said[3])), better, "{} than in ours", ("more", "fewer"))


def _figure_row(
    label: str, said: float, ours: Series, words: str, either: tuple[str, str], campaigns: int | None = None
) -> Row:
    """The thesis' number beside ours, of which a campaign may have several."""
    cells = (said, float(np.median(ours)), float(ours.min()), float(ours.max()))
    why = words.format(either[0] if said > cells[3] else either[1])
    few = _too_few(len(ours) if campaigns is None else campaigns)
    return Row(label, "", cells, *judge(cells[2] <= said <= cells[3], why, few))


def _curve(name: str, x: Series, sigmas: AnyArray) -> Curve:
    """The median with the lowest and the highest of the campaigns: a few that are lost make every mean."""
    there = np.isfinite(sigmas).any(axis=0)
    middle, low, high = (
        np.where(there, function(np.where(there, sigmas, 1.0), axis=0), np.nan)
        for function in (np.nanmedian, np.nanmin, np.nanmax)
    )
    return Curve(name, x, np.asarray(middle), np.asarray(low), np.asarray(high))


def _scenario_plot(figure: str, gyro: int, said: AnyArray, ours: AnyArray) -> Plot:
    curves = tuple(_curve(f"sc. {s}", _MINUTES, ours[:, k]) for k, s in enumerate(SCENARIOS))
    marks = Marks(f"thesis, table {figure}", np.tile(_MINUTES, len(said)), said.ravel())
    title = f"{TABLES[figure]}, 2 s, gyros {gyro} par."
    return _plot(f"gyros-{gyro}", title, "minutes of each pose", curves, marks)


def _plot(name: str, title: str, x_label: str, curves: tuple[Curve, ...], marks: Marks) -> Plot:
    y_label = "σ of the position / m"
    return Plot(name, title, x_label, y_label, curves, marks, line="median", band="all campaigns")


def _outage_figure(imu: str, repetitions: int, seed: int) -> Found:
    """Make figure 5.7 (HG1700) or 5.8 (HG1900) anew: parts of scenario 3 after outages of 2 to 60 s."""
    found = sub_scenario_positions(imu, repetitions, seed, wandering=False)
    printed = printed_outages(imu)
    said = np.array([[cell["sigma"] for cell in printed[f"{length:g}"]] for length in OUTAGES])
    rows = [
        _growth_row(name, at, said[:, k], found[case])
        for k, (name, case) in enumerate(SUB_SCENARIOS.items())
        for at in range(len(OUTAGES) - 1)
    ]
    plots = [_outage_plot(imu, protocol, said, found) for protocol in (GAPS, SLIDING)]
    return _found(rows, repetitions, plots)


def _growth_row(name: str, at: int, said: Series, ours: Positions) -> Row:
    ratio = np.log(_LENGTHS[at + 1] / _LENGTHS[at])
    exponents = [
        np.log(ours.sigmas[protocol][:, at + 1] / ours.sigmas[protocol][:, at]) / ratio
        for protocol in (GAPS, SLIDING)
    ]
    both = np.concatenate(exponents)
    growth = float(np.log(said[at + 1] / said[at]) / ratio)
    label = f"{name}: exponent from {_LENGTHS[at]:g} to {_LENGTHS[at + 1]:g} s"
    whole = np.isfinite(np.stack(exponents)).any(axis=0)
    ours_told, count = both[np.isfinite(both)], int(whole.sum())
    return _figure_row(label, growth, ours_told, "it grows {} than ours", ("faster", "more slowly"), count)


def _outage_plot(imu: str, protocol: str, said: AnyArray, found: Campaigns) -> Plot:
    curves = tuple(
        _curve(name, _LENGTHS, found[case].sigmas[protocol]) for name, case in SUB_SCENARIOS.items()
    )
    words = "gaps with one position between" if protocol == GAPS else "each outage by itself"
    marks = Marks("thesis, table 5.7", np.repeat(_LENGTHS, said.shape[1]), said.ravel())
    return _plot(protocol, f"{imu}, {words}", "outage / s", curves, marks)


POSITIONS = (
    *(Study(f"hayal-{t}", partial(_scenario_table, t)) for t in TABLES),
    Study("hayal-5.7", partial(_sub_scenario_table, wandering=False)),
    Study("hayal-5.7-wandering", partial(_sub_scenario_table, wandering=True)),
    *(Study(f"hayal-figure-{f}", partial(_scenario_figure, f)) for f in TABLES),
    Study("hayal-figure-5.7", partial(_outage_figure, "HG1700")),
    Study("hayal-figure-5.8", partial(_outage_figure, "HG1900")),
)
"""Tables 5.5 to 5.7, as the thesis has them and with biases that wander, and figures 5.5 to 5.8."""
