"""Do the joint estimate's coverage factors and predictions hold? Simulated hand-held recordings, truth known.

    python benchmarks/joint_uncertainty.py --runs 100 --grade consumer-mems

Every run draws a unit of the grade and plays the named protocol. Printed by group of parameters: root mean square of
error over stated standard uncertainty, and the share inside k standard uncertainties with each parameter's own k;
then the same of what `tumble predict` says: the actual error of position after 60 s at rest in the 26 poses, and of
attitude after a turn of 90 degrees, over the predicted standard uncertainty. Brackets are 95 % bootstrap intervals
over the runs. A bias is compared with its mean over the session, as the truth has it.
"""

from __future__ import annotations

import argparse
import os
from collections import defaultdict

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from tumble.attitude.directions import twenty_six_directions
from tumble.calibration import calibrate_hand_held
from tumble.calibration.canonical import named_values
from tumble.calibration.equations.imu_unknowns import unknowns_of
from tumble.calibration.evidence import Budget
from tumble.calibration.free_inertial import CalibratedUnit
from tumble.calibration.joint import calibrate_joint
from tumble.earth import Site
from tumble.errors import TumbleError
from tumble.protocol import named_protocol
from tumble.segmentation import find_timeline, observe_holds
from tumble.sensor import change_frame
from tumble.simulation import find_grade, simulate_protocol
from tumble.units import angular_rate_factor, specific_force_factor

SITE = Site.from_latitude(np.radians(48.0), 300.0)


def group_of(name: str) -> str:
    """The group of a parameter: its name without the axis."""
    if name.startswith("g-sensitivity"):
        return "g-sensitivity"
    return name.rpartition(" ")[0]


def one_run(seed: int, grade: str, rate: float):
    """Return errors, sigmas, factors and names of the parameters, and predicted against actual errors."""
    recording, truth = simulate_protocol(
        named_protocol("hand-held"), rate, np.random.default_rng(seed), site=SITE, grade=find_grade(grade)
    )
    timeline = find_timeline(recording)
    means = observe_holds(recording, timeline)
    start = calibrate_hand_held(recording, timeline, means, SITE)
    estimate = calibrate_joint(recording, timeline, means, SITE, start)
    budget = estimate.shown(Budget)
    assert budget is not None
    told = budget.statement
    assert told is not None
    model = change_frame(truth.model, "accelerometer-x")
    # A session's biases are what they were on average, wander included.
    model.accelerometer.bias[:] = model.accelerometer.bias + np.mean(truth.force_wander, axis=0)
    model.gyroscope.bias[:] = model.gyroscope.bias + np.mean(truth.rate_wander, axis=0)
    kept = frozenset(term.name for term in estimate.terms if term.kept)
    values = np.concatenate([unknowns_of(model), np.zeros(3)])
    units = recording.specific_force_unit, recording.angular_rate_unit
    true, _ = named_values(
        values,
        np.zeros((36, 36)),
        terms=kept,
        gyro="full",
        units=units,
        factors=(specific_force_factor(units[0]), angular_rate_factor(units[1])),
    )
    error = np.array([p.value - t.value for p, t in zip(estimate.parameters, true, strict=True)])
    sigma = np.array([p.standard_uncertainty for p in estimate.parameters])
    unit = CalibratedUnit(estimate.model, tuple(estimate.names), estimate.covariance, SITE.gravity)
    return (
        [p.name for p in estimate.parameters],
        error / sigma,
        told.coverage_factors,
        predicted(unit, canonical(model, estimate.names) - canonical(estimate.model, estimate.names)),
    )


def canonical(model, names) -> np.ndarray:
    """The canonical parameters of a model, in order."""
    arrays = {
        "accelerometer.matrix": model.accelerometer.matrix,
        "accelerometer.bias": model.accelerometer.bias,
        "accelerometer.quadratic": _or_zeros(model.accelerometer.quadratic, (3,)),
        "gyroscope.matrix": model.gyroscope.matrix,
        "gyroscope.bias": model.gyroscope.bias,
        "gyroscope.g_sensitivity": _or_zeros(model.g_sensitivity, (3, 3)),
    }
    made = []
    for name in names:
        entry, _, rest = name.partition("[")
        made.append(arrays[entry][tuple(int(i) for i in rest.rstrip("]").split(","))])
    return np.array(made)


def _or_zeros(value, shape):
    return np.zeros(shape) if value is None else value


def predicted(unit: CalibratedUnit, off: np.ndarray) -> list[float]:
    """Return actual over predicted error: rms position over the poses, and attitude after a turn about each axis."""
    alone = CalibratedUnit(unit.model, unit.names, np.outer(off, off), unit.gravity)
    ups = twenty_six_directions()
    both = [
        np.sqrt(np.mean([u.position_error(60.0, up).across(up) ** 2 for up in ups])) for u in (alone, unit)
    ]
    made = [float(both[0] / both[1])]
    for axis in np.eye(3):
        turned = [
            np.trace(u.attitude_error(axis, np.pi / 2.0, 3.0, np.roll(axis, 1)).covariance)
            for u in (alone, unit)
        ]
        made.append(float(np.sqrt(turned[0] / turned[1])))
    return made


def interval(values: np.ndarray, rng: np.random.Generator) -> tuple[float, float]:
    """Bootstrap interval over the runs of the root mean square of (runs, parameters)."""
    draws = rng.integers(0, len(values), (1000, len(values)))
    rms = np.sqrt(np.mean(values[draws] ** 2, axis=(1, 2)))
    return float(np.quantile(rms, 0.025)), float(np.quantile(rms, 0.975))


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--grade", default="consumer-mems")
    parser.add_argument("--rate", type=float, default=50.0)
    parser.add_argument("--seed", type=int, default=1)
    told = parser.parse_args()
    errors, inside = defaultdict(list), defaultdict(list)
    ratios: list[list[float]] = []
    failures = 0
    for seed in range(told.seed, told.seed + told.runs):
        try:
            names, z, factors, ratio = one_run(seed, told.grade, told.rate)
        except TumbleError as error:
            failures += 1
            print(f"run {seed}: {error}")
            continue
        ratios.append(ratio)
        for group in dict.fromkeys(map(group_of, names)):
            at = [i for i, name in enumerate(names) if group_of(name) == group]
            errors[group].append(z[at])
            inside[group].append(np.abs(z[at]) <= factors[at])
    rng = np.random.default_rng(0)
    print(f"{told.grade}, {told.runs} runs, {failures} failed")
    for group, values in errors.items():
        whole = np.array(values)
        low, high = interval(whole, rng)
        print(
            f"{group:35s} rms {np.sqrt(np.mean(whole**2)):.2f} [{low:.2f}, {high:.2f}]  "
            f"inside {100.0 * np.mean(inside[group]):.1f} %  ({len(values)} runs)"
        )
    shown = np.array(ratios)
    for name, column in (("position after 60 s", shown[:, :1]), ("attitude after 90°", shown[:, 1:])):
        low, high = interval(column, rng)
        print(
            f"{name:35s} rms {np.sqrt(np.mean(column**2)):.2f} [{low:.2f}, {high:.2f}] of what is predicted"
        )


if __name__ == "__main__":
    main()
