"""Several recordings of one unit in one adjustment: do the intervals hold, and what is gained?

    python benchmarks/turn_ons.py --runs 30
    python benchmarks/turn_ons.py --runs 10 --seed 100 --others
    python benchmarks/turn_ons.py --real

Every run draws a unit of the grade, switches it on a few times (its biases move each time by a tenth of the grade's
spread), tumbles it by hand each time, and calibrates all recordings together, each as a user gets it: segments found,
outliers left out, optional terms tried. Printed, per group of parameters: root mean square of error over stated sigma
(z), the share inside the stated 95 %, stated sigma over that of a single recording, all with the 95 % interval of a
bootstrap over runs. Biases are judged at the next turn-on, which takes no part. Then how often a stable parameter was
said to change though none does, how often a scale factor was that does change (by --change, one recording of them), and
whether a recording of another unit of the grade was refused. With --real: a recording of a real unit (Xsens MTi) cut
into two, and two recordings of two real units (MPU-9150).
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
from uncertainty import GROUPS, true_values, without_wander

from tumble.calibration import Estimate, calibrate_hand_held
from tumble.calibration.joint import calibrate_joint
from tumble.calibration.outcome.estimate import JointOutcome
from tumble.calibration.turn_ons.estimate import SeveralEstimate, several_estimate
from tumble.calibration.turn_ons.outcome import adjust_several
from tumble.earth import Site
from tumble.errors import ObservabilityError, TumbleError, UsageError
from tumble.protocol import named_protocol
from tumble.recording import Recording, read_recording
from tumble.segmentation import find_timeline, observe_holds
from tumble.sensor import ImuModel
from tumble.simulation import Grade, find_grade, recordings, simulate_protocol
from tumble.simulation.noise import simulate_wander

SITE = replace(Site.from_latitude(math.radians(48.0), 300.0), gravity_sigma=0.0)
HERE = Path(__file__).resolve().parents[1]
DATA, REFERENCE = HERE / "src" / "tumble" / "data", HERE / "tests" / "reference"
MOVES = 0.1  # of the grade's spread of biases, from one turn-on to the next
STABLE = tuple(group for group in GROUPS[:-1] if "bias" not in group)
BIASES = tuple(group for group in GROUPS if "bias" in group)


@dataclass
class Run:
    """One unit: errors, stated sigmas, factors, and sigmas of its first recording alone, by parameter."""

    failure: str = ""
    errors: dict[str, float] = field(default_factory=dict)
    sigmas: dict[str, float] = field(default_factory=dict)
    factors: dict[str, float] = field(default_factory=dict)
    alone: dict[str, float] = field(default_factory=dict)
    changing: int = 0
    optional_changing: int = 0
    probability: float = 1.0
    found_change: bool = False
    refused: bool = False
    kept: tuple[str, ...] = ()
    seconds: float = 0.0


def switched_on(model: ImuModel, grade: Grade, rng: np.random.Generator) -> ImuModel:
    force = model.accelerometer.bias + rng.normal(0.0, MOVES * grade.accelerometer.bias, 3)
    rate = model.gyroscope.bias + rng.normal(0.0, MOVES * grade.gyroscope.bias, 3)
    return replace(
        model,
        accelerometer=replace(model.accelerometer, bias=force),
        gyroscope=replace(model.gyroscope, bias=rate),
    )


def record(model: ImuModel, grade: Grade, rng: np.random.Generator) -> tuple[Recording, ImuModel]:
    """Return a recording and the model with the biases that it had on average."""
    wanders: list[np.ndarray] = []

    def kept(*arguments):
        wanders.append(simulate_wander(*arguments))
        return wanders[-1]

    protocol = replace(named_protocol("hand-held"), site=SITE)
    with patch.object(recordings, "simulate_wander", kept):
        made, truth = simulate_protocol(protocol, 50.0, rng, site=SITE, grade=grade, model=model)
    true = truth.model
    force = replace(true.accelerometer, bias=true.accelerometer.bias + wanders[0].mean(axis=0))
    gyro = replace(true.gyroscope, bias=true.gyroscope.bias + wanders[1].mean(axis=0))
    return made, replace(true, accelerometer=force, gyroscope=gyro)


def settle(recording: Recording) -> tuple[Estimate, JointOutcome]:
    timeline = find_timeline(recording)
    means = observe_holds(recording, timeline)
    kept: list[JointOutcome] = []
    try:
        start = calibrate_hand_held(recording, timeline, means, SITE)
    except ObservabilityError:
        start = None
    return calibrate_joint(recording, timeline, means, SITE, start, keep=kept.append), kept[0]


def together(settled: list[tuple[Estimate, JointOutcome]]) -> SeveralEstimate:
    names = [f"recording {k + 1}" for k in range(len(settled))]
    outcome = adjust_several(names, [kept for _, kept in settled])
    return several_estimate(outcome, [estimate for estimate, _ in settled], SITE)


def run(seed: int, grade_name: str, turn_ons: int, change: float, white: bool, others: bool) -> Run:
    rng = np.random.default_rng([14, seed])
    grade = find_grade(grade_name)
    if white:
        grade = replace(
            grade,
            accelerometer=without_wander(grade.accelerometer),
            gyroscope=without_wander(grade.gyroscope),
        )
    unit = grade.simulate_model(rng)
    try:
        settled = [settle(record(switched_on(unit, grade, rng), grade, rng)[0]) for _ in range(turn_ons)]
        following = record(switched_on(unit, grade, rng), grade, rng)[1]
        started = time.process_time()
        several = together(settled)
    except TumbleError as error:
        return Run(failure=f"{type(error).__name__}: {error}")
    done = Run(seconds=time.process_time() - started)
    truth = true_values(following, several.estimate)
    for parameter, factor in zip(several.estimate.parameters, several.coverage_factors, strict=True):
        name = parameter.name
        done.errors[name] = parameter.value - truth.get(name, 0.0)
        done.sigmas[name], done.factors[name] = parameter.standard_uncertainty, factor
    done.alone = {p.name: p.standard_uncertainty for p in settled[0][0].parameters}
    changing = [agreement.is_optional for agreement in several.turn_ons.changing]
    done.changing, done.optional_changing = changing.count(False), changing.count(True)
    done.probability = several.turn_ons.probability
    done.kept = tuple(term.name for term in several.estimate.terms if term.kept)
    if others:
        _with_change(done, settled, unit, grade, rng, change)
    return done


def _with_change(
    done: Run,
    settled: list[tuple[Estimate, JointOutcome]],
    unit: ImuModel,
    grade: Grade,
    rng: np.random.Generator,
    change: float,
) -> None:
    """Replace the last recording by one of the unit with another scale factor, and by one of another unit."""
    scale = np.diag([1.0, 1.0 + change, 1.0])
    moved = replace(unit, gyroscope=replace(unit.gyroscope, matrix=scale @ unit.gyroscope.matrix))
    changed = settle(record(switched_on(moved, grade, rng), grade, rng)[0])
    found = [a.parameter for a in together([*settled[:-1], changed]).turn_ons.changing]
    done.found_change = "gyro scale factor error y" in found
    alien = settle(record(grade.simulate_model(rng), grade, rng)[0])
    try:
        together([*settled[:-1], alien])
    except UsageError as error:
        done.refused = f"recording {len(settled)}" in str(error)


def real() -> None:
    """Print what two halves of one recording say, and what two units' recordings do."""
    xsens = read_recording(
        [REFERENCE / "xsens_mti_hand" / f"xsens_{name}.txt.gz" for name in ("acc", "gyro")]
    )
    half = len(xsens) // 2
    told = together([settle(xsens.between(0, half)), settle(xsens.between(half, len(xsens)))]).turn_ons
    print("Xsens MTi, one recording cut into two:")
    for bias in told.biases:
        first, second = bias.values
        print(
            f"  {bias.parameter}: {first:.2f} and {second:.2f} {bias.unit}, scatter {bias.scatter:.2f}, by their "
            f"uncertainties {bias.measurement:.2f}, probability {bias.probability:.2f}"
        )
    print(
        f"  what is stable: chi-square {told.chi_square:.1f} of {told.degrees} degrees of freedom, probability "
        f"{told.probability:.2f}; said to change: {', '.join(a.parameter for a in told.changing) or 'nothing'}"
    )
    files = (DATA / "mpu9150-imu0.csv.gz", REFERENCE / "mpu9150" / "imu1.log.gz")
    units = [
        settle(read_recording(file, columns="ax,ay,az,gx,gy,gz", units="m/s^2,rad/s", rate=100.0))
        for file in files
    ]
    print("Two MPU-9150:")
    try:
        together(units)
        print("  taken for one unit")
    except UsageError as error:
        print(f"  {error}")


def interval(values: Callable[[np.ndarray], float], runs: int) -> str:
    """Return a statistic of all runs with the 95 % interval of 1000 bootstrap draws of runs."""
    rng = np.random.default_rng(0)
    low, high = np.quantile([values(rng.integers(0, runs, runs)) for _ in range(1000)], (0.025, 0.975))
    return f"{values(np.arange(runs)):6.2f} [{low:.2f}, {high:.2f}]"


def row(good: list[Run], starts: tuple[str, ...], label: str) -> None:
    names = [name for name in good[0].errors if name.startswith(starts)]
    z = np.array([[r.errors[n] / r.sigmas[n] for n in names] for r in good])
    inside = np.array([[abs(r.errors[n]) <= r.factors[n] * r.sigmas[n] for n in names] for r in good])
    ratio = np.array([[r.sigmas[n] / r.alone[n] for n in names] for r in good])
    print(
        f"  {label:33s}{interval(lambda d: float(np.sqrt(np.mean(z[d] ** 2))), len(good)):>22s}"
        f"{interval(lambda d: 100.0 * float(np.mean(inside[d])), len(good)):>26s}"
        f"{interval(lambda d: float(np.median(ratio[d])), len(good)):>22s}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=30)
    parser.add_argument("--turn-ons", type=int, default=3)
    parser.add_argument("--grade", default="consumer-mems")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--change", type=float, default=1e-3, help="relative, of a scale factor that is not stable"
    )
    parser.add_argument("--white", action="store_true", help="white noise only: no bias wanders")
    parser.add_argument(
        "--others", action="store_true", help="also with a changed unit, and with another one"
    )
    parser.add_argument("--real", action="store_true", help="recordings of real units")
    asked = parser.parse_args()
    if asked.real:
        real()
        return
    runs = [
        run(seed, asked.grade, asked.turn_ons, asked.change, asked.white, asked.others)
        for seed in range(asked.seed, asked.seed + asked.runs)
    ]
    good = [r for r in runs if not r.failure]
    for number, r in enumerate(runs):
        if r.failure:
            print(f"  run {asked.seed + number}: {r.failure}")
    white = ", white noise" if asked.white else ""
    print(f"{asked.turn_ons} recordings by hand of one {asked.grade} unit{white}, {len(good)} runs")
    print(f"  {'group':33s}{'rms z':>22s}{'inside 95 %':>26s}{'sigma / one alone':>22s}")
    for group in (*STABLE, *BIASES):
        row(good, (group,), group)
    row(good, STABLE, "all that is stable")
    print(
        f"  all together: {np.mean([r.seconds for r in good]):.1f} s of processor time after each by itself"
    )
    print(
        f"  a scale factor or angle said to change: {sum(r.changing > 0 for r in good)} runs, a g-sensitivity: "
        f"{sum(r.optional_changing > 0 for r in good)} runs; all of them together "
        f"improbable (1 %): {sum(r.probability < 0.01 for r in good)} runs"
    )
    for name in ("g_sensitivity", "quadratic", "accelerometer_asymmetry", "gyro_asymmetry"):
        print(f"  {name} kept: {sum(name in r.kept for r in good)} runs")
    if asked.others:
        print(
            f"  a gyro's scale factor changed by {1e6 * asked.change:.0f} ppm in one of them: said in "
            f"{sum(r.found_change for r in good)} runs"
        )
        print(f"  another unit of the grade: refused in {sum(r.refused for r in good)} runs")


if __name__ == "__main__":
    main()
