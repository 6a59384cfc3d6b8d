"""Are a lag between the triads and lever arms found on a table where they are, and only there?

    python benchmarks/joint_table_terms.py --grade tactical --runs 40
    python benchmarks/joint_table_terms.py --grade tactical --runs 40 --has --table

Every run draws a unit of the grade, turns it once about each edge between two axes at 60°/s, this way and that way
in turn, finds the segments, and calibrates jointly from rough values. Without `--has` its accelerometers are at one
place and on time: printed is what is kept all the same. With it each has lever arms of 8 mm, one sigma, and the
accelerometers are a sample late: printed is rms of error over stated sigma, and the share inside the stated 95 %.
`--table` gives the table ripple, wobble and shaking.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import math
import time
from collections import Counter
from dataclasses import replace

import numpy as np

from tumble.calibration import Estimate
from tumble.calibration.joint import calibrate_joint
from tumble.calibration.terms.lever_arms import PAIRS
from tumble.calibration.terms.time_lag import LAG_NAME
from tumble.earth import Site
from tumble.errors import TumbleError
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep, Step, TurnStep
from tumble.segmentation import find_timeline, observe_holds
from tumble.segmentation.matching import match_protocol, observe_matched_spins
from tumble.segmentation.rotations import observe_rotations
from tumble.sensor import change_frame
from tumble.simulation import TableErrors, find_grade, simulate_protocol

SITE = replace(Site.from_latitude(math.radians(48.0), 300.0), gravity_sigma=0.0)
RATE, SPEED, SIGMA = 50.0, math.radians(60.0), math.radians(2.0 / 3600.0)
AXES = ((1, 1, 0), (1, 0, 1), (0, 1, 1), (1, -1, 0), (1, 0, -1), (0, 1, -1))
UNIT, ARM = np.array([0.05, -0.03, 0.02]), 0.008  # m
TABLE = TableErrors(ripple=1e-4, wobble=math.radians(2.0 / 3600.0), shake=2e-3, ramp_spread=0.05)


def protocol() -> Protocol:
    steps: list[Step] = []
    for number, axis in enumerate(AXES):
        u = np.array(axis) / math.sqrt(2.0)
        pose = Pose(_up(u), None, 0.09)
        sign = 1.0 if number % 2 == 0 else -1.0
        turned = sign * 2.0 * math.pi
        duration = abs(turned) / SPEED - 1.0
        steps += [TurnStep(2.0)] if steps else []
        steps += [
            HoldStep(5.0, pose),
            SpinStep(duration, sign * SPEED, u, ramp=1.0, angle=turned, angle_sigma=SIGMA),
            HoldStep(5.0, pose),
        ]
    return Protocol("edges", "turntable", tuple(steps), site=SITE)


def _up(axis: np.ndarray) -> np.ndarray:
    """The unit's axis that lies across the edge."""
    return np.eye(3)[int(np.argmin(np.abs(axis)))]


def calibrate(seed: int, grade: str, has: bool, table: bool) -> tuple[Estimate, np.ndarray, float]:
    """Return the estimate, the true lever arms (3, 3) counted as the estimator does, and the true lag."""
    rng = np.random.default_rng([2000, seed])
    arms = ARM * rng.standard_normal((3, 3)) if has else np.zeros((3, 3))
    asked = protocol()
    recording, truth = simulate_protocol(
        asked,
        RATE,
        rng,
        site=SITE,
        grade=find_grade(grade),
        lever_arm_b=UNIT + arms,
        table=TABLE if table else None,
    )
    if has:
        force = recording.specific_force.copy()
        force[1:] = force[:-1].copy()
        recording = replace(recording, specific_force=force)
    timeline = find_timeline(recording)
    means = observe_holds(recording, timeline)
    matching = match_protocol(asked, recording, timeline, means)
    spins = observe_matched_spins(asked, recording, timeline, matching)
    rotations = observe_rotations(asked, recording, timeline, matching, means, spins)
    estimate = calibrate_joint(recording, timeline, means, SITE, rotations=rotations)
    # The simulated unit's own axes to those of the estimate.
    own = change_frame(truth.model, "accelerometer-x").accelerometer.matrix
    C = np.linalg.solve(own, truth.model.accelerometer.matrix)
    arms = arms @ C.T
    return estimate, arms - np.diag(arms), 1.0 / RATE if has else 0.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--grade", default="tactical")
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--has", action="store_true", help="the unit has lever arms and a lag")
    parser.add_argument("--table", action="store_true", help="the table ripples, wobbles and shakes")
    asked = parser.parse_args()
    kept: Counter[str] = Counter()
    errors: dict[str, list[tuple[float, float, float]]] = {"lag": [], "lever arms": []}
    wrong = failed = 0
    started = time.process_time()
    for seed in range(asked.seed, asked.seed + asked.runs):
        try:
            estimate, arms, lag = calibrate(seed, asked.grade, asked.has, asked.table)
        except TumbleError as error:
            print(f"  run {seed}: {type(error).__name__}: {error}")
            failed += 1
            continue
        found = {term.name for term in estimate.terms if term.kept}
        kept.update(found)
        wrong += bool(found - {"g_sensitivity"} - ({"time_lag", "lever_arms"} if asked.has else set()))
        true = {f"accelerometer lever arm {'xyz'[i]}{'xyz'[j]}": arms[i, j] for i, j in PAIRS}
        for p in estimate.parameters:
            factor = estimate.coverage_factor
            if p.name == LAG_NAME:
                errors["lag"].append((p.value - lag, p.standard_uncertainty, factor))
            elif p.name in true:
                errors["lever arms"].append((p.value - true[p.name], p.standard_uncertainty, factor))
    good = asked.runs - failed
    print(
        f"{asked.grade}, {good} good runs of {asked.runs}, {(time.process_time() - started) / asked.runs:.1f} s each"
    )
    print(f"  kept: {', '.join(f'{name} {count}' for name, count in sorted(kept.items())) or 'none'}")
    print(f"  a term that is not there kept in {wrong} of {good} runs (g-sensitivity apart)")
    for name, told in errors.items():
        if asked.has and told:
            e, s, k = np.array(told).T
            unit = "ms" if name == "lag" else "mm"
            print(
                f"  {name}: rms error {1e3 * math.sqrt(np.mean(e**2)):.3g} {unit}, rms z "
                f"{math.sqrt(np.mean((e / s) ** 2)):.2f}, largest |z| {np.max(np.abs(e / s)):.1f}, "
                f"{100.0 * np.mean(np.abs(e) <= k * s):.1f} % inside 95 % ({len(told)})"
            )


if __name__ == "__main__":
    main()
