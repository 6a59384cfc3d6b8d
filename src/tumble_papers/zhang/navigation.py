"""Figures 5 to 10 of Zhang et al. (2010): two tests of free inertial navigation on a turntable.

The unit stays where it is and is turned; whatever position moves is error. Printed are how long the tests took
(8,700 and 8,400 s), that rotations were frequent in the first, and that there were three, about one axis, in the
second. The rest is assumed: ten minutes of rest to align, quarter turns of twelve seconds, in the first test every
hundred seconds twice about x, twice about y, twice about z, and so on, in the second every 2,100 s about the
vertical; the centre of rotation in the unit; the height known, as nothing keeps it in free navigation.

The paper's recordings are not public. Simulated units with the parameters of table 6 are calibrated on simulated
tables by the traditional method, by the paper's and by tumble's joint estimator, and navigated with what each found.

The joint estimator on Zhang's simulated table: nine dwells and twelve rotations, settings of tables 3 and 4.

Five samples a second stand for a hundred: white noise of the same density, and a rate that is constant in between,
so that nothing is lost but time. Each dwell is a recording of its own, and each axis with its two rotations:
nobody carries the attitude from one to the next. Before, between and after the rotations the table rests for less
than a second, which tells little by itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, lru_cache, partial

import numpy as np
from scipy.spatial.transform import Rotation

from tumble.arrays import AnyArray, Matrix, Series, Table, Vector, Vectors
from tumble.attitude import matrices_from_rotation_vectors, rotation_between
from tumble.calibration import (
    LEAST_WOBBLE,
    PLAIN,
    HoldsAndTurns,
    Observed,
    TableRotation,
    imu_unknowns,
    observe,
    start_adjustment,
    table_rotation,
    unknowns_of,
)
from tumble.counting import counted, part
from tumble.earth import EARTH_RATE, Site
from tumble.estimation import solve
from tumble.navigation import InertialSamples, NavigationState, align_coarse, navigate, position_differences
from tumble.reproduction import Curve, Plot, Row
from tumble.sensor import ImuModel, inverse, lower_factor, matrix_from_shin
from tumble.simulation import Motion
from tumble.units import STANDARD_GRAVITY
from tumble_papers.study import Found, Study, generator, judge, zhang
from tumble_papers.zhang.turntable import (
    GRAVITY,
    LATITUDE,
    Setting,
    Unit,
    calibrate_in_laboratory,
    evaluate,
    simulate,
    table_setting,
    unit_from,
)

ALIGNED, TURN, QUARTER = 600.0, 12.0, 0.5 * np.pi  # s, s, rad
EVERY = {"I": 100.0, "II": 2100.0}  # s from one turn to the next
DURATION = {"I": 8700.0, "II": 8400.0}  # s
RATE = 10.0  # Hz: a degree and a half a sample at the fastest
# s after which the height is put back to what is known.
HEIGHT_HELD = 30.0
SITE = Site.from_latitude(float(LATITUDE), 0.0)
PLACE = (float(LATITUDE), 0.0, 0.0)
# First attitude: level, x to the north-east, so that no axis points along the Earth's rate.
FIRST = Rotation.from_euler("ZYX", [0.25 * np.pi, 0.0, 0.0])


@dataclass(frozen=True)
class TrueTest:
    """What a perfect unit measures in a test.

    Attributes
    ----------
    motion : of the table.
    edges : (samples + 1,) s.
    force, rate : (samples, 3) means over each interval in the accelerometers' frame p.
    """

    motion: Motion
    edges: Series
    force: Vectors
    rate: Vectors


def _table_motion(name: str) -> Motion:
    """Return how the table turns."""
    end = DURATION[name]
    starts = np.arange(max(ALIGNED, EVERY[name]), end - TURN - 1.0, EVERY[name])
    axes = (
        np.eye(3)[np.arange(len(starts)) // 2 % 3]
        if name == "I"
        else np.tile([0.0, 0.0, 1.0], (len(starts), 1))
    )
    rotations = [FIRST]
    for axis in axes:
        rotations.append(rotations[-1] * Rotation.from_rotvec(QUARTER * axis))
    edges = np.concatenate([[0.0 - TURN], starts, [end]])
    holds = np.diff(edges) - TURN
    return Motion.between_poses(Rotation.concatenate(rotations), holds, np.full(len(starts), TURN))


@cache
def true_test(name: str) -> TrueTest:
    """Return what a perfect unit measures, by Gauss-Legendre integrals over each sample.

    Parameters
    ----------
    name : "I" or "II".
    """
    motion = _table_motion(name)
    edges = np.arange(round(DURATION[name] * RATE) + 1) / RATE
    at, weight = np.polynomial.legendre.leggauss(3)
    middle = 0.5 * (edges[1:] + edges[:-1])
    time = (middle[:, None] + 0.5 / RATE * at).ravel()
    force, rate = (
        np.einsum("k,ikj->ij", 0.5 * weight, signal.reshape(-1, len(at), 3))
        for signal in (motion.specific_force_b(time, SITE), motion.angular_rate_ib_b(time, SITE))
    )
    return TrueTest(motion, edges, force, rate)


def measured(
    true: TrueTest, unit: Unit, setting: Setting, rng: np.random.Generator | None
) -> InertialSamples:
    """Return raw samples of a unit, in counts.

    Parameters
    ----------
    true : the test.
    unit : that is on the table.
    setting : its noise.
    rng : source of the noise; None for none.
    """
    force, rate = unit.model.distort(true.force, true.rate)
    if rng is not None:
        scale = np.sqrt(RATE)
        by_force = setting.force_noise * scale * np.linalg.norm(unit.force_matrix, axis=1)
        by_rate = setting.rate_noise * scale * np.linalg.norm(unit.rate_matrix, axis=1)
        force = force + by_force * rng.standard_normal(force.shape)
        rate = rate + by_rate * rng.standard_normal(rate.shape)
    zero = np.zeros((1, 3))
    return InertialSamples(true.edges, np.vstack([zero, force]), np.vstack([zero, rate]), means=True)


def navigate_test(raw: InertialSamples, model: ImuModel) -> tuple[Series, Vectors]:
    """Align with the model at rest and navigate; return times since then (s) and (instants, 3) errors, m.

    Parameters
    ----------
    raw : samples.
    model : with which they are corrected, for the alignment too.
    """
    force, rate = model.correct(raw.specific_force_b, raw.angular_rate_ib_b)
    samples = replace(raw, specific_force_b=force, angular_rate_ib_b=rate)
    rest = samples.between(float(raw.time[0]), ALIGNED)
    found = align_coarse(rest, PLACE[0], accelerometer_sigma=1e-4, gyroscope_sigma=1e-8)
    state = NavigationState(ALIGNED, *PLACE, np.zeros(3), found.C_nb)
    first, step = round(ALIGNED * RATE), round(HEIGHT_HELD * RATE)
    times: list[float] = []
    places: list[tuple[float, float]] = []
    for begin in range(first, len(samples) - 1, step):
        rows = slice(begin, min(begin + step, len(samples) - 1) + 1)
        part = InertialSamples(samples.time[rows], force[rows], rate[rows], means=True)
        end = navigate(part, state, every=step).state(-1)
        velocity: Vector = end.velocity_n * np.array([1.0, 1.0, 0.0])
        state = replace(end, height=PLACE[2], velocity_n=velocity)
        times.append(end.time - ALIGNED)
        places.append((end.latitude, end.longitude))
    latitude, longitude = np.array(places).T.copy()
    here = tuple(np.full(len(times), value) for value in PLACE)
    errors = position_differences((latitude, longitude, here[2]), (here[0], here[1], here[2]))
    return np.array(times), errors


TRADITIONAL, PROPOSED, JOINT, TRUE = "traditional", "proposed", "joint estimator", "true parameters"
PRINTED = "table 6's traditional column, on the unit of the proposed one"
_NAMES = {TRADITIONAL: "traditional", PROPOSED: "proposed", JOINT: "joint", TRUE: "true", PRINTED: "table 6"}
# Fewer units than this are no range.
RANGE = 10
# The share of units in which what is said to be better has to be so.
MOST = 0.9
# s over which a picture of measurements shows mean, lowest and highest.
_BLOCK = 15.0
_SHARES = (0.05, 0.95)


@dataclass(frozen=True)
class NavigatedUnits:
    """Horizontal errors of position of many units in one test.

    Attributes
    ----------
    time : (instants,) s since the alignment.
    errors : method -> (units, instants) m.
    """

    time: Series
    errors: dict[str, Table]

    def rms(self, method: str) -> Series:
        """Return (units,) the root of the mean square over a test, m."""
        return np.asarray(np.sqrt(np.mean(self.errors[method] ** 2, axis=1)))


@lru_cache(maxsize=4)
def calibrate_units(units: int, seed: int) -> dict[str, list[Unit]]:
    """Return method -> the units that it finds, each on simulated recordings of its own table work.

    Parameters
    ----------
    units : how many times the unit is calibrated.
    seed : of all random numbers.
    """
    setting = table_setting("6")
    ours, theirs = generator(seed, 7).spawn(2)
    plan = true_plan(setting)
    return {
        TRADITIONAL: calibrate_in_laboratory(setting, units, theirs).each(),
        PROPOSED: evaluate(simulate(setting, units, ours, sampled=False)).units.each(),
        JOINT: [estimate_run(plan, np.random.default_rng([seed, k])) for k in counted(range(units), units)],
        TRUE: [setting.unit] * units,
        PRINTED: [unit_from("6", "traditional")] * units,
    }


@lru_cache(maxsize=4)
def run_test(name: str, units: int, seed: int) -> NavigatedUnits:
    """Navigate a test with what each method found; the noise of the test is the same for all.

    Parameters
    ----------
    name : "I" or "II".
    units, seed : as for `calibrate_units`.
    """
    setting, true = table_setting("6"), true_test(name)
    with part(0.0, 0.3):
        found = calibrate_units(units, seed)
    errors: dict[str, list[Series]] = {method: [] for method in found}
    time = np.zeros(0)
    with part(0.3, 1.0):
        for unit in counted(range(units), units):
            rng = np.random.default_rng([seed, ("I", "II").index(name), unit])
            raw = measured(true, setting.unit, setting, rng)
            for method, units_found in found.items():
                time, off = navigate_test(raw, units_found[unit].model)
                errors[method].append(np.hypot(off[:, 0], off[:, 1]))
    return NavigatedUnits(time, {method: np.array(rows) for method, rows in errors.items()})


def _positions(test: str, repetitions: int, seed: int) -> Found:
    """Make figure 7 (test I) or 10 (test II) anew: errors of position with the parameters of each method."""
    runs = run_test(test, repetitions, seed)
    rows = [_method_row(runs, method) for method in runs.errors] + _claim_rows(runs)
    curves = tuple(
        Curve(
            _NAMES[method],
            runs.time[1::2],
            np.median(errors, axis=0)[1::2],
            *(np.quantile(errors, share, axis=0)[1::2] for share in _SHARES),
        )
        for method, errors in runs.errors.items()
    )
    time, error = "time since the alignment / s", "horizontal error of position / m"
    plot = Plot("positions", f"Navigation test {test}", time, error, curves, line="median")
    return Found(rows, [plot], said={"most": 100 * MOST, "enough": RANGE}, few=repetitions < RANGE)


def _method_row(runs: NavigatedUnits, method: str) -> Row:
    rms, errors = runs.rms(method), runs.errors[method]
    told = np.median(rms), *np.quantile(rms, _SHARES), np.median(errors[:, -1]), np.median(errors.max(axis=1))
    return Row(f"{method}: horizontal, rms over the test", "m", (None, *(float(of) for of in told)))


def _claim_rows(runs: NavigatedUnits) -> list[Row]:
    said = str(zhang()["claims"]["navigation"])
    pairs = (
        (TRADITIONAL, PROPOSED, said),
        (PRINTED, TRUE, said),
        (PROPOSED, JOINT, None),
        (TRADITIONAL, JOINT, None),
    )
    return [_ratio_row(runs, worse, better, words) for worse, better, words in pairs]


def _ratio_row(runs: NavigatedUnits, worse: str, better: str, said: str | None) -> Row:
    ratio: Series = runs.rms(worse) / runs.rms(better)
    share = float(np.mean(ratio > 1.0))
    cells = (said, float(np.median(ratio)), *(float(np.quantile(ratio, q)) for q in _SHARES), None, None)
    verdict: tuple[str, ...] = ()
    if said is not None:
        few = f"fewer than {RANGE} units have no range" if ratio.size < RANGE else None
        verdict = judge(share >= MOST, f"it is better in {100 * share:.0f} % of our units", few)
    return Row(f"rms of {worse} over that of {better}", "", cells, *verdict)


def _measurements(test: str, sensor: str, repetitions: int, seed: int) -> Found:
    """Make figure 5, 6, 8 or 9 anew: what the accelerometers or gyros of one unit measure, corrected by the truth."""
    printed, setting, true = zhang()["navigation_tests"][test], table_setting("6"), true_test(test)
    raw = measured(true, setting.unit, setting, np.random.default_rng([seed, 0, 0]))
    force, rate = setting.unit.model.correct(raw.specific_force_b, raw.angular_rate_ib_b)
    gyro = sensor == "gyro"
    signal = rate[1:] * 180.0 / np.pi if gyro else force[1:] / STANDARD_GRAVITY
    unit = "°/s" if gyro else "g"
    rows = [
        Row("duration", "s", (float(printed["seconds"]), DURATION[test])),
        Row("rotations", "", (printed["rotations"], float(len(true.motion.turn_duration)))),
        *(
            Row(f"{axis}: lowest to highest", unit, (None, f"{column.min():.3f} to {column.max():.3f}"))
            for axis, column in zip("xyz", signal.T, strict=True)
        ),
    ]
    title = f"Navigation test {test}: {_MEASURED[sensor]}"
    return Found(rows, [_measurements_plot(title, unit, true.edges, signal)])


_MEASURED = {"accelerometer": "specific forces", "gyro": "angular rates"}


def _measurements_plot(title: str, unit: str, edges: Series, signal: AnyArray) -> Plot:
    samples = round(_BLOCK * (len(edges) - 1) / (edges[-1] - edges[0]))
    count = len(signal) // samples
    blocks = signal[: count * samples].reshape(count, samples, 3)
    time = edges[: count * samples : samples] + 0.5 * _BLOCK
    curves = tuple(
        Curve(axis, time, blocks[..., k].mean(axis=1), blocks[..., k].min(axis=1), blocks[..., k].max(axis=1))
        for k, axis in enumerate("xyz")
    )
    label = f"measured / ({unit})" if "/" in unit else f"measured / {unit}"
    line = f"mean of {_BLOCK:g} s"
    return Plot("signals", title, "time / s", label, curves, linear=True, line=line, band="all samples")


STEP = 0.2  # s: at 2 degrees a step the Earth rate goes round finely enough for an axis that is exact
REST = 2  # samples before and after a rotation
# Windows of three seconds: 30 degrees, of which the mean has lost 1 % and the model says so.
WINDOW = 0.55  # rad
EXACT_AXIS = 1e-7  # rad
NORTH, UP = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True)
class Piece:
    """One dwell, or an axis turned about both ways.

    Attributes
    ----------
    C_start : (3, 3) attitude C_wb at its first sample.
    axis_b : (3,) unit vector; zero of a dwell.
    speed : (samples,) rad/s that the table is told.
    """

    C_start: Matrix
    axis_b: Vector
    speed: Series

    def motion(self, speed: Series, earth_w: Vector, lever: Vector) -> tuple[Vectors, Vectors]:
        """Return specific force and rate of every sample of a table that really turns at `speed`."""
        angle = np.concatenate([[0.0], np.cumsum(0.5 * STEP * (speed[1:] + speed[:-1]))])
        turned = matrices_from_rotation_vectors(angle[:, None] * self.axis_b)
        backward = np.swapaxes(self.C_start @ turned, 1, 2)
        centripetal = self.axis_b * float(self.axis_b @ lever) - lever
        force = backward @ (GRAVITY * UP) + (speed**2)[:, None] * centripetal
        return force, backward @ earth_w + speed[:, None] * self.axis_b


@dataclass(frozen=True)
class TruePlan:
    """What does not change from run to run.

    Attributes
    ----------
    setting : what is simulated.
    pieces : dwells first, then the rotations, both ways about each axis in turn.
    site : gravity and latitude.
    truth : all of the unit's unknowns.
    """

    setting: Setting
    pieces: tuple[Piece, ...]
    site: Site
    truth: Series


def true_plan(setting: Setting) -> TruePlan:
    """Return the true motion of a study.

    Parameters
    ----------
    setting : see `table_setting`.
    """
    still = np.zeros(round(setting.dwell / STEP))
    pieces = [Piece(rotation_between(up, UP), np.zeros(3), still) for up in setting.up]
    rest, turn = np.zeros(REST), np.full(round(setting.duration / STEP), setting.rate)
    speed = np.concatenate([rest, turn, rest, -turn, rest])
    pieces += [Piece(rotation_between(axis, NORTH), axis, speed) for axis in setting.axes]
    site = Site(GRAVITY, 0.0, setting.latitude)
    return TruePlan(setting, tuple(pieces), site, unknowns_of(setting.unit.model))


def _simulated_data(plan: TruePlan, rng: np.random.Generator) -> Observed:
    """Return one run's observations."""
    setting, unit = plan.setting, plan.setting.unit
    raw_force: list[AnyArray] = []
    raw_rate: list[AnyArray] = []
    holds: list[tuple[int, int]] = []
    turns: list[tuple[int, int, float]] = []
    at, ratio = 0, np.sqrt(STEP * setting.sampling)
    earth = EARTH_RATE * np.array([np.cos(setting.latitude), 0.0, -np.sin(setting.latitude)])
    for piece in plan.pieces:
        turning = piece.speed != 0.0
        # The table turns by what it is told and its error.
        errors = rng.normal(0.0, setting.angle_error, 2) / abs(setting.angle)
        share = np.asarray(np.where(piece.speed > 0.0, errors[0], errors[1]), dtype=np.float64)
        force, rate = piece.motion(piece.speed * (1.0 + share), earth, np.array(setting.lever_arm))
        sigma = np.where(turning[:, None], setting.sigma_turning[:3], setting.sigma[:3]) / ratio
        samples = len(rate)
        noise = rng.standard_normal((samples, 6))
        force, rate = unit.model.distort(force, rate)
        raw_force.append(force + sigma * noise[:, :3])
        raw_rate.append(rate + setting.sigma[3:] / ratio * noise[:, 3:])
        if np.any(turning):
            whole = (samples - 3 * REST) // 2
            first = [at, at + REST + whole, at + 2 * (REST + whole)]
            turns += [(len(holds), first[0], setting.rate), (len(holds) + 1, first[1], -setting.rate)]
            holds += [(start, start + REST) for start in first]
        else:
            holds.append((at, at + samples))
        at += samples
    base = _base(plan, np.concatenate(raw_force), np.concatenate(raw_rate), holds, turns)
    spins = [_spin(plan, base, hold, start, speed) for hold, start, speed in turns]
    return observe(base, imu_unknowns(plan.truth), spins)


def _base(
    plan: TruePlan,
    raw_force: Vectors,
    raw_rate: Vectors,
    holds: list[tuple[int, int]],
    turns: list[tuple[int, int, float]],
) -> HoldsAndTurns:
    setting = plan.setting
    ratio = STEP * setting.sampling
    count = np.array([b - a for a, b in holds], dtype=float)
    force_variance, rate_variance = setting.sigma[:3] ** 2 / ratio, setting.sigma[3:] ** 2 / ratio
    edge = [max(1, (b - a) // 2) if b - a <= 2 * REST else REST for a, b in holds]
    start, stop = np.full(len(holds), -1), np.full(len(holds), -1)
    for hold, _, _ in turns:
        start[hold], stop[hold] = holds[hold][1] - 1, holds[hold + 1][0] + 1
    means = [np.array([signal[a:b].mean(axis=0) for a, b in holds]) for signal in (raw_force, raw_rate)]
    return HoldsAndTurns(
        time=STEP * np.arange(len(raw_force), dtype=np.float64),
        raw_force=raw_force,
        raw_rate=raw_rate,
        force_mean=means[0],
        force_covariance=(force_variance / count[:, None])[:, :, None] * np.eye(3),
        rate_mean=means[1],
        rate_covariance=(rate_variance / count[:, None])[:, :, None] * np.eye(3),
        hold_samples=count,
        head=np.array([(a, a + n) for (a, _), n in zip(holds, edge, strict=True)]),
        tail=np.array([(b - n, b) for (_, b), n in zip(holds, edge, strict=True)]),
        turn_start=start,
        turn_stop=stop,
        force_sample_variance=force_variance,
        rate_random_walk=rate_variance * STEP,
        force_floor=np.zeros(3),
        rate_floor=np.zeros(3),
    )


def _spin(plan: TruePlan, base: HoldsAndTurns, hold: int, start: int, speed: float) -> TableRotation:
    setting = plan.setting
    samples = round(setting.duration / STEP)
    spin = table_rotation(
        base,
        hold,
        start + REST,
        start + REST + samples,
        np.array([speed, 0.0, 0.0]),
        angle=float(np.sign(speed)) * setting.angle,
        angle_sigma=setting.angle_error,
        largest_angle=WINDOW,
        longest=100.0,
    )
    turning = setting.sigma_turning[:3] ** 2 / (STEP * setting.sampling)
    count = spin.windows[:, 1] - spin.windows[:, 0]
    return replace(spin, force_covariance=np.diag(turning)[None] / count[:, None, None])


def estimate_run(plan: TruePlan, rng: np.random.Generator) -> Unit:
    """Simulate one run and return the unit that is found.

    Parameters
    ----------
    plan, rng : the true motion, and the noise.
    """
    data = _simulated_data(plan, rng)
    # A start as the paper's estimator gives it: off by ten times its own errors.
    start = plan.truth.copy()
    start[PLAIN] *= 1.0 + 1e-4 * rng.standard_normal(PLAIN.size)
    task = start_adjustment(data, imu_unknowns(start), plan.site)
    # The simulated table rests without swaying, and its axis does not wobble.
    task.noise.factors["axis"] = dict.fromkeys(data.rotations, (EXACT_AXIS / LEAST_WOBBLE) ** 2)
    solve(task)
    plain = task.unknowns.values[PLAIN]
    force, gyro = np.real(matrix_from_shin(plain[3:6], plain[6:9])), plain[9:18].reshape(3, 3)
    own = np.real(lower_factor(gyro))
    return Unit(force, plain[0:3], own, plain[18:21], inverse(own) @ gyro)


NAVIGATION = tuple(
    study
    for test, entry in zhang()["navigation_tests"].items()
    for study in (
        *(
            Study(f"zhang-figure-{f}", partial(_measurements, test, of))
            for of, f in entry["measurements"].items()
        ),
        Study(f"zhang-figure-{entry['positions']}", partial(_positions, test)),
    )
)
"""Figures 5 to 10."""
