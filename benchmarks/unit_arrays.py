"""Units that are tumbled together, fixed to one another: do the intervals hold, and what do common poses gain?

    python benchmarks/array.py --runs 15 --units 4
    python benchmarks/array.py --runs 10 --units 2 --grade tactical

Every run draws units of the grade, fixes them to one another at angles of some tens of degrees, tumbles them by hand
through 26 poses, and calibrates them each by itself and all together, each as a user gets it. Printed, per group of
parameters: root mean square of error over stated sigma (z) and the share inside the stated 95 % of the array's
estimates, their rms error and their stated sigma over those of the units alone, with the 95 % interval of a bootstrap
over runs; and the same of the mountings. Every third run one unit slips by 0.3° half way: how often is that said?
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from unittest.mock import patch

import numpy as np
from scipy.spatial.transform import Rotation
from uncertainty import GROUPS, true_values

from tumble.calibration import Estimate, calibrate_hand_held
from tumble.calibration.arrays.adjustment import solve_array
from tumble.calibration.arrays.estimate import ArrayEstimate, array_estimate
from tumble.calibration.joint import calibrate_joint
from tumble.calibration.outcome.estimate import JointOutcome
from tumble.earth import Site
from tumble.errors import TumbleError
from tumble.recording import Recording
from tumble.segmentation import find_timeline, observe_holds
from tumble.sensor import ImuModel, change_frame
from tumble.simulation import Motion, find_grade, poses_26, recordings, simulate_recording
from tumble.simulation.noise import simulate_wander

SITE = replace(Site.from_latitude(math.radians(48.0), 300.0), gravity_sigma=0.0)
RATE, HOLD, POSES = 50.0, 4.0, 26
SLIP = math.radians(0.3)
PLAIN = GROUPS[:-1]


@dataclass
class Run:
    """All units of one array: errors and sigmas by unit and parameter, alone and together."""

    failure: str = ""
    errors: list[dict[str, tuple[float, float]]] = field(default_factory=list)
    sigmas: list[dict[str, tuple[float, float]]] = field(default_factory=list)
    factor: float = 1.96
    mounting_z: list[float] = field(default_factory=list)
    rigid: bool = True
    slipped: bool = False
    seconds: float = 0.0


def play(rng: np.random.Generator, grade_name: str, units: int, slips: bool):
    """Return recordings, the true models with their biases' means, and the mountings against the first."""
    grade = find_grade(grade_name)
    headings = Rotation.from_rotvec(np.outer(rng.uniform(0.0, 6.28, POSES), [0.0, 0.0, 1.0]))
    attitudes = headings * poses_26()[rng.permutation(26)[:POSES]]
    mountings = [
        Rotation.identity(),
        *(Rotation.from_rotvec(rng.normal(0.0, 0.3, 3)) for _ in range(units - 1)),
    ]
    made: list[tuple[Recording, ImuModel]] = []
    for number, mounting in enumerate(mountings):
        own = [mounting] * POSES
        if slips and number == units - 1:
            slipped = Rotation.from_rotvec([SLIP, 0.0, 0.0]) * mounting
            own = [mounting] * (POSES // 2) + [slipped] * (POSES - POSES // 2)
        motion = Motion.between_poses(
            attitudes * Rotation.concatenate(own), np.full(POSES, HOLD), np.full(POSES - 1, 2.0)
        )
        made.append(_record(motion, grade.simulate_model(rng), grade, rng))
    return made, mountings


def _record(motion, model, grade, rng) -> tuple[Recording, ImuModel]:
    wanders: list[np.ndarray] = []

    def kept(*arguments):
        wanders.append(simulate_wander(*arguments))
        return wanders[-1]

    with patch.object(recordings, "simulate_wander", kept):
        recording, _ = simulate_recording(motion, RATE, rng, site=SITE, grade=grade, distort=model.distort)
    force = replace(model.accelerometer, bias=model.accelerometer.bias + wanders[0].mean(axis=0))
    gyro = replace(model.gyroscope, bias=model.gyroscope.bias + wanders[1].mean(axis=0))
    return recording, replace(model, accelerometer=force, gyroscope=gyro)


def settle(made: list[Recording]) -> list[tuple[Estimate, JointOutcome]]:
    """Return each unit by itself, over the holds that all share."""
    spans = [[(r.time[h.start], r.time[h.stop - 1]) for h in find_timeline(r).holds] for r in made]
    common = [
        (max(s[k][0] for s in spans), min(s[k][1] for s in spans)) for k in range(min(len(s) for s in spans))
    ]
    settled = []
    for recording in made:
        timeline = find_timeline(recording, intervals=common)
        means = observe_holds(recording, timeline)
        start = calibrate_hand_held(recording, timeline, means, SITE)
        kept: list[JointOutcome] = []
        settled.append((calibrate_joint(recording, timeline, means, SITE, start, keep=kept.append), kept[0]))
    return settled


def run(seed: int, grade: str, units: int) -> Run:
    rng = np.random.default_rng([15, seed])
    slips = seed % 3 == 2
    made, mountings = play(rng, grade, units, slips)
    try:
        settled = settle([recording for recording, _ in made])
        started = time.process_time()
        solution = solve_array([str(k) for k in range(units)], [kept for _, kept in settled])
        array = array_estimate(solution, [estimate for estimate, _ in settled], SITE)
    except TumbleError as error:
        return Run(failure=f"{type(error).__name__}: {error}")
    done = Run(seconds=time.process_time() - started, rigid=array.is_rigid, slipped=slips)
    done.factor = array.estimates[0].coverage_factor
    for (alone, _), estimate, (_, model) in zip(settled, array.estimates, made, strict=True):
        truth = true_values(model, estimate)
        before = {p.name: p for p in alone.parameters}
        named = [p for p in estimate.parameters if p.name in before and p.name.startswith(PLAIN)]
        done.errors.append(
            {p.name: (before[p.name].value - truth[p.name], p.value - truth[p.name]) for p in named}
        )
        done.sigmas.append(
            {p.name: (before[p.name].standard_uncertainty, p.standard_uncertainty) for p in named}
        )
    done.mounting_z = _mounting_z(array, [model for _, model in made], mountings)
    return done


def _mounting_z(array: ArrayEstimate, models: list[ImuModel], mountings: list[Rotation]) -> list[float]:
    """Errors of the mountings over their sigmas; a unit's axes b lie in its case by its own accelerometers."""
    own = [
        np.linalg.inv(m.accelerometer.matrix) @ change_frame(m, "accelerometer-x").accelerometer.matrix
        for m in models
    ]
    z: list[float] = []
    for k in range(1, len(models)):
        true = own[0].T @ mountings[k].as_matrix() @ own[k]
        error = Rotation.from_matrix(array.units[k].C_1b @ true.T).as_rotvec()
        z += (error / array.units[k].sigma).tolist()
    return z


def interval(values: Callable[[np.ndarray], float], runs: int) -> str:
    """Return a statistic of all runs with the 95 % interval of 1000 bootstrap draws of runs."""
    rng = np.random.default_rng(0)
    low, high = np.quantile([values(rng.integers(0, runs, runs)) for _ in range(1000)], (0.025, 0.975))
    return f"{values(np.arange(runs)):6.2f} [{low:.2f}, {high:.2f}]"


def row(good: list[Run], starts: tuple[str, ...], label: str) -> None:
    errors = [np.array([e[n] for e in r.errors for n in e if n.startswith(starts)]) for r in good]
    sigmas = [np.array([s[n] for s in r.sigmas for n in s if n.startswith(starts)]) for r in good]

    def every(parts: list[np.ndarray], d: np.ndarray, column: int) -> np.ndarray:
        return np.concatenate([parts[k][:, column] for k in d])

    def rms_z(d: np.ndarray) -> float:
        return float(np.sqrt(np.mean((every(errors, d, 1) / every(sigmas, d, 1)) ** 2)))

    def inside(d: np.ndarray) -> float:
        return 100.0 * float(np.mean(np.abs(every(errors, d, 1)) <= good[0].factor * every(sigmas, d, 1)))

    def nearer(d: np.ndarray) -> float:
        return float(np.sqrt(np.mean(every(errors, d, 1) ** 2) / np.mean(every(errors, d, 0) ** 2)))

    def stated(d: np.ndarray) -> float:
        return float(np.exp(np.mean(np.log(every(sigmas, d, 1) / every(sigmas, d, 0)))))

    cells = [interval(of, len(good)) for of in (rms_z, inside, nearer, stated)]
    print(f"  {label:33s}" + "".join(f"{cell:>26s}" for cell in cells))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--units", type=int, default=4)
    parser.add_argument("--grade", default="consumer-mems")
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    runs = [run(seed, asked.grade, asked.units) for seed in range(asked.seed, asked.seed + asked.runs)]
    for number, r in enumerate(runs):
        if r.failure:
            print(f"  run {asked.seed + number}: {r.failure}")
    good = [r for r in runs if not r.failure and not r.slipped]
    slipped = [r for r in runs if not r.failure and r.slipped]
    print(f"{asked.units} {asked.grade} units tumbled together, {len(good)} runs in which none slips")
    heads = ("rms z", "inside 95 %", "rms error / alone", "stated / alone")
    print(f"  {'group':33s}" + "".join(f"{head:>26s}" for head in heads))
    for group in PLAIN:
        row(good, (group,), group)
    row(good, PLAIN, "all of these")
    z = [np.array(r.mounting_z) for r in good]

    def mounting_z(d: np.ndarray) -> float:
        return float(np.sqrt(np.mean(np.concatenate([z[k] for k in d]) ** 2)))

    def mounting_inside(d: np.ndarray) -> float:
        return 100.0 * float(np.mean(np.abs(np.concatenate([z[k] for k in d])) <= 1.96))

    print(
        f"  mountings: rms z {interval(mounting_z, len(good))}, inside 95 % {interval(mounting_inside, len(good))}"
    )
    print(
        f"  said not to be fixed to one another: {sum(not r.rigid for r in good)} of {len(good)} runs; ",
        end="",
    )
    print(f"where one slips by 0.3°: {sum(not r.rigid for r in slipped)} of {len(slipped)}")
    print(
        f"  all together: {np.mean([r.seconds for r in good]):.2f} s of processor time after each by itself"
    )


if __name__ == "__main__":
    main()
