"""Figures 5 to 10 of Zhang et al. (2010): two tests of free inertial navigation on a turntable.

The unit stays where it is and is turned; whatever position moves is error. Printed are how long the tests took
(8,700 and 8,400 s), that rotations were frequent in the first, and that there were three, about one axis, in the
second. The rest is assumed: ten minutes of rest to align, quarter turns of twelve seconds, in the first test every
hundred seconds twice about x, twice about y, twice about z, and so on, in the second every 2,100 s about the
vertical; the centre of rotation in the unit; the height known, as nothing keeps it in free navigation.

The paper's recordings are not public. Simulated units with the parameters of table 6 are calibrated on simulated
tables by the traditional method, by the paper's and by tumble's joint estimator, and navigated with what each found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

from tumble.arrays import AnyArray, Matrix, Series, Table, Vector, Vectors
from tumble.counting import counted, part
from tumble.earth import Site
from tumble.navigation import (
    InertialSamples,
    NavigationState,
    align_coarse,
    navigate,
    position_differences,
)
from tumble.reproduction.outcome import INSIDE, OUTSIDE, UNJUDGED, Curve, Outcome, Plot, Row
from tumble.sensor import ImuModel, Triad
from tumble.sensor.conventions.zhang import inter_triad_rotation, matrix_from_zhang
from tumble.simulation.motion import Motion
from tumble.units import STANDARD_GRAVITY
from tumble_papers.published import zhang
from tumble_papers.zhang.joint_turntable import estimate_run, true_plan
from tumble_papers.zhang.turntable import (
    LATITUDE,
    Setting,
    Unit,
    calibrate_in_laboratory,
    evaluate,
    paper_setting,
    paper_unit,
    simulate,
    unit_parameters,
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


@dataclass(frozen=True, slots=True)
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
    force = true.force @ unit.force_matrix.T + unit.force_bias
    rate = true.rate @ (unit.rate_matrix @ unit.rotation).T + unit.rate_bias
    if rng is not None:
        scale = np.sqrt(RATE)
        by_force = setting.force_noise * scale * np.linalg.norm(unit.force_matrix, axis=1)
        by_rate = setting.rate_noise * scale * np.linalg.norm(unit.rate_matrix, axis=1)
        force = force + by_force * rng.standard_normal(force.shape)
        rate = rate + by_rate * rng.standard_normal(rate.shape)
    zero = np.zeros((1, 3))
    return InertialSamples(true.edges, np.vstack([zero, force]), np.vstack([zero, rate]), means=True)


def model_of(parameters: Series) -> ImuModel:
    """Return the model that 21 parameters in the paper's order stand for, in the frame p.

    Parameters
    ----------
    parameters : (21,) scales in counts, the rest SI, as `turntable.paper_parameters` has them.
    """
    force: Matrix = np.real(matrix_from_zhang(parameters[0:3], parameters[3:6]))
    rate: Matrix = np.real(matrix_from_zhang(parameters[9:12], parameters[12:15]))
    turned = rate @ inter_triad_rotation(parameters[18:21])
    return ImuModel(
        Triad(force, parameters[0:3] * parameters[6:9]), Triad(turned, parameters[9:12] * parameters[15:18])
    )


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


SOURCE = "Zhang et al. 2010, section 5.2; the paper's recordings are not public, ours are simulated"
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


@dataclass(frozen=True, slots=True)
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
def calibrate_units(units: int, seed: int) -> dict[str, AnyArray]:
    """Return method -> (units, 21) parameters that it finds, each on simulated recordings of its own table work.

    Parameters
    ----------
    units : how many times the unit is calibrated.
    seed : of all random numbers.
    """
    setting = paper_setting()
    ours, theirs = np.random.Generator(np.random.SFC64([seed, 7])).spawn(2)
    plan = true_plan(setting)
    joint = [estimate_run(plan, np.random.default_rng([seed, unit])) for unit in counted(range(units), units)]
    return {
        TRADITIONAL: calibrate_in_laboratory(setting, units, theirs).parameters(),
        PROPOSED: evaluate(simulate(setting, units, ours, sampled=False)).parameters(),
        JOINT: np.array(joint),
        TRUE: np.tile(unit_parameters(setting.unit), (units, 1)),
        PRINTED: np.tile(unit_parameters(paper_unit("traditional")), (units, 1)),
    }


@lru_cache(maxsize=4)
def run_test(name: str, units: int, seed: int) -> NavigatedUnits:
    """Navigate a test with what each method found; the noise of the test is the same for all.

    Parameters
    ----------
    name : "I" or "II".
    units, seed : as for `calibrate_units`.
    """
    setting, true = paper_setting(), true_test(name)
    with part(0.0, 0.3):
        found = calibrate_units(units, seed)
    errors: dict[str, list[Series]] = {method: [] for method in found}
    time = np.zeros(0)
    with part(0.3, 1.0):
        for unit in counted(range(units), units):
            rng = np.random.default_rng([seed, ("I", "II").index(name), unit])
            raw = measured(true, setting.unit, setting, rng)
            for method, parameters in found.items():
                time, off = navigate_test(raw, model_of(parameters[unit]))
                errors[method].append(np.hypot(off[:, 0], off[:, 1]))
    return NavigatedUnits(time, {method: np.array(rows) for method, rows in errors.items()})


def which_test(figure: str) -> tuple[str, str]:
    """Return the test that a figure is of, and what it shows: "accelerometer", "gyro" or "positions".

    Parameters
    ----------
    figure : "5" to "10".

    Raises
    ------
    KeyError
        If it is of no test.
    """
    for name, entry in zhang()["navigation_tests"].items():
        shown = {
            **{which: sensor for sensor, which in entry["measurements"].items()},
            entry["positions"]: "positions",
        }
        if figure in shown:
            return name, shown[figure]
    raise KeyError(figure)


def reproduce_positions(figure: str, repetitions: int, seed: int) -> Outcome:
    """Make figure 7 (test I) or 10 (test II) anew: errors of position with the parameters of each method.

    Parameters
    ----------
    figure : "7" or "10".
    repetitions : how many times the unit is calibrated and navigated.
    seed : of all random numbers.
    """
    name, _ = which_test(figure)
    runs = run_test(name, repetitions, seed)
    rows = [_method_row(runs, method) for method in runs.errors]
    rows += _claim_rows(runs)
    return Outcome(
        f"zhang-figure-{figure}",
        f"Figure {figure}: errors of position in navigation test {name}",
        SOURCE,
        ("paper", "median", "5 %", "95 %", "at the end: median", "largest: median"),
        rows,
        _criterion(repetitions),
        [_positions_plot(name, runs)],
        [_ASSUMED, _JOINT],
        repetitions,
        seed,
    )


def _criterion(units: int) -> str:
    if units < RANGE:
        return f"judged from {RANGE} units on"
    return f"inside: the ratio is above one in at least {100 * MOST:g} % of the units, as the paper's conclusion has it"


_ASSUMED = (
    "Assumed: ten minutes of rest in which each method aligns itself, and a known height. Quarter "
    "turns take 12 s, in test I every 100 s twice about x, y and z in turn, in test II every 35 "
    "minutes about the vertical. The paper prints pictures without numbers."
)
_JOINT = (
    "The joint estimator has the paper's data: nine attitudes and six axes. The traditional method has 24 attitudes "
    "and three axes. True parameters: what white noise alone does."
)


def _method_row(runs: NavigatedUnits, method: str) -> Row:
    rms, errors = runs.rms(method), runs.errors[method]
    low, high = (float(np.quantile(rms, share)) for share in _SHARES)
    cells = (
        None,
        float(np.median(rms)),
        low,
        high,
        float(np.median(errors[:, -1])),
        float(np.median(errors.max(axis=1))),
    )
    return Row(f"{method}: horizontal, rms over the test", "m", cells)


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
    cells = (
        said,
        float(np.median(ratio)),
        *(float(np.quantile(ratio, q)) for q in _SHARES),
        None,
        None,
    )
    label = f"rms of {worse} over that of {better}"
    if said is None:
        return Row(label, "", cells)
    if ratio.size < RANGE:
        return Row(label, "", cells, UNJUDGED, f"fewer than {RANGE} units have no range")
    if share >= MOST:
        return Row(label, "", cells, INSIDE)
    return Row(label, "", cells, OUTSIDE, f"it is better in {100 * share:.0f} % of our units")


def _positions_plot(name: str, runs: NavigatedUnits) -> Plot:
    curves = tuple(
        Curve(
            _NAMES[method],
            runs.time[1::2],
            np.median(errors, axis=0)[1::2],
            np.quantile(errors, _SHARES[0], axis=0)[1::2],
            np.quantile(errors, _SHARES[1], axis=0)[1::2],
        )
        for method, errors in runs.errors.items()
    )
    return Plot(
        "positions",
        f"Navigation test {name}",
        "time since the alignment / s",
        "horizontal error of position / m",
        curves,
        line="median",
    )


def reproduce_measurements(figure: str, repetitions: int, seed: int) -> Outcome:
    """Make figure 5, 6, 8 or 9 anew: what the accelerometers or gyros measure in a test, corrected by the truth.

    Parameters
    ----------
    figure : "5" or "6" of test I, "8" or "9" of test II.
    repetitions : not used: one unit is shown.
    seed : of all random numbers.
    """
    name, shown = which_test(figure)
    printed, setting, true = zhang()["navigation_tests"][name], paper_setting(), true_test(name)
    raw = measured(true, setting.unit, setting, np.random.default_rng([seed, 0, 0]))
    corrected = model_of(unit_parameters(setting.unit)).correct(raw.specific_force_b, raw.angular_rate_ib_b)
    gyro = shown == "gyro"
    signal = corrected[1][1:] * 180.0 / np.pi if gyro else corrected[0][1:] / STANDARD_GRAVITY
    unit = "°/s" if gyro else "g"
    turns = len(true.motion.turn_duration)
    rows = [
        Row("duration", "s", (float(printed["seconds"]), DURATION[name])),
        Row("rotations", "", (printed["rotations"], float(turns))),
        *(
            Row(f"{axis}: lowest to highest", unit, (None, f"{column.min():.3f} to {column.max():.3f}"))
            for axis, column in zip("xyz", signal.T, strict=True)
        ),
    ]
    what = "angular rates" if gyro else "specific forces"
    return Outcome(
        f"zhang-figure-{figure}",
        f"Figure {figure}: {what} in navigation test {name}",
        SOURCE,
        ("paper", "ours"),
        rows,
        plots=[_measurements_plot(f"Navigation test {name}: {what}", unit, true.edges, signal)],
        notes=[_ASSUMED],
        repetitions=1,
        seed=seed,
    )


def _measurements_plot(title: str, unit: str, edges: Series, signal: AnyArray) -> Plot:
    samples = round(_BLOCK * (len(edges) - 1) / (edges[-1] - edges[0]))
    count = len(signal) // samples
    blocks = signal[: count * samples].reshape(count, samples, 3)
    time = edges[: count * samples : samples] + 0.5 * _BLOCK
    curves = tuple(
        Curve(axis, time, blocks[..., k].mean(axis=1), blocks[..., k].min(axis=1), blocks[..., k].max(axis=1))
        for k, axis in enumerate("xyz")
    )
    return Plot(
        "signals",
        title,
        "time / s",
        f"measured / ({unit})" if "/" in unit else f"measured / {unit}",
        curves,
        linear=True,
        line=f"mean of {_BLOCK:g} s",
        band="all samples",
    )
