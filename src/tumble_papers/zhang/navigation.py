"""Figures 5 to 10 of Zhang et al. (2010): two navigation tests on a turntable, by parameters of three methods.

The paper's recordings are not public. Simulated units with the parameters of table 6 are calibrated on simulated
tables by the traditional method, by the paper's and by tumble's joint estimator, and navigated with what each found.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from tumble.arrays import AnyArray, Series, Table
from tumble.counting import counted, part
from tumble.reproduction.outcome import INSIDE, OUTSIDE, UNJUDGED, Curve, Outcome, Plot, Row
from tumble.units import STANDARD_GRAVITY
from tumble_papers.published import zhang
from tumble_papers.zhang.joint_turntable import estimate_run, true_plan
from tumble_papers.zhang.laboratory import calibrate_in_laboratory, paper_setting, paper_unit
from tumble_papers.zhang.turntable_evaluation import evaluate, unit_parameters
from tumble_papers.zhang.turntable_navigation import (
    DURATION,
    measured,
    model_of,
    navigate_test,
    true_test,
)
from tumble_papers.zhang.turntable_simulation import simulate

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
