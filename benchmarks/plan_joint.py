"""Is the plan of a whole protocol worth what it foretells? The joint estimator on simulated recordings, beside it.

    python benchmarks/plan_joint.py --hand-held 40 --turntable 12

Each run draws a unit of the grade, plays the protocol with it sample by sample (placement and turns by hand, table
errors, noise, flicker, converter), finds the holds, calibrates as `tumble calibrate --procedure joint` does, and
compares with the unit's truth; biases with their mean over the holds of that session. The rms errors are set beside
what `tumble plan` foretells, with an interval for their chance (chi-square with three numbers a run for a group of
three, all groups together 1 % false alarms).
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from tumble.calibration import calibrate_hand_held
from tumble.calibration.canonical import named_parameters
from tumble.calibration.joint import calibrate_joint, unknowns_of
from tumble.calibration.turntable import calibrate_turntable
from tumble.design.joint_information import GROUPS
from tumble.design.joint_plan import PlanTask, plan_protocol
from tumble.earth import Site
from tumble.errors import TumbleError
from tumble.protocol import named_protocol
from tumble.segmentation import find_timeline, observe_holds
from tumble.segmentation.matching import match_protocol, observe_matched_spins
from tumble.segmentation.rotations import observe_rotations
from tumble.simulation import find_grade, simulate_protocol

FALSE_ALARM = 0.01
SITE = replace(Site.from_latitude(0.8), gravity_sigma=0.0)
RATE = 100.0
PRACTICAL = {
    "accelerometer bias": (1e6 / 9.80665, "µg"),
    "accelerometer scale": (1e6, "ppm"),
    "accelerometer misalignment": (648000.0 / np.pi, "″"),
    "gyro bias": (648000.0 / np.pi, "°/h"),
    "gyro scale": (1e6, "ppm"),
    "gyro misalignment": (648000.0 / np.pi, "″"),
    "rotation between the triads": (648000.0 / np.pi, "″"),
}
_, NAMED = named_parameters(
    terms=frozenset({"g_sensitivity"}), gyro="full", units=("m/s²", "rad/s"), factors=(1.0, 1.0)
)


def named_of(model) -> np.ndarray:
    """The 30 parameters of a model, in the frame of its x accelerometer."""
    return np.real(NAMED(np.concatenate([unknowns_of(model), np.zeros(3)])))


def errors_of(name: str, grade_name: str, seed: int) -> np.ndarray | None:
    """Estimate less truth, of 30 parameters; None if the recording could not be calibrated."""
    grade, protocol = find_grade(grade_name), named_protocol(name)
    recording, truth = simulate_protocol(
        protocol, RATE, np.random.default_rng([seed, 7]), site=SITE, grade=grade
    )
    protocol = replace(protocol, steps=truth.steps)
    timeline = find_timeline(recording)
    means = observe_holds(recording, timeline)
    try:
        if name.startswith("turntable"):
            matching = match_protocol(protocol, recording, timeline, means)
            spins = observe_matched_spins(protocol, recording, timeline, matching)
            rotations = observe_rotations(protocol, recording, timeline, matching, means, spins)
            start = calibrate_turntable(recording, timeline, means, rotations, matching, protocol, SITE)
            estimate = calibrate_joint(recording, timeline, means, SITE, start, rotations=rotations)
        else:
            start = calibrate_hand_held(recording, timeline, means, SITE)
            estimate = calibrate_joint(recording, timeline, means, SITE, start)
    except TumbleError as error:
        print(f"  run {seed}: {error}", flush=True)
        return None
    assert truth.model is not None
    off = named_of(estimate.model) - named_of(truth.model)
    weights = np.diff(truth.hold_edges, axis=1)[:, 0]
    off[0:3] -= np.average(truth.force_wander, axis=0, weights=weights)
    off[9:12] -= np.average(truth.rate_wander, axis=0, weights=weights)
    return off


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hand-held", type=int, default=40)
    parser.add_argument("--turntable", type=int, default=12)
    parser.add_argument("--case", help="only this one, such as hand-held,tactical")
    asked = parser.parse_args()
    cases = [
        ("hand-held", "consumer-mems", asked.hand_held),
        ("hand-held", "tactical", asked.hand_held),
        ("turntable-9", "consumer-mems", asked.turntable),
        ("turntable-9", "tactical", asked.turntable),
    ]
    level = FALSE_ALARM / (len(PRACTICAL) * len(cases))
    print("| plan | parameters | predicted | simulated | ratio | limits | inside |")
    print("|---|---|---:|---:|---:|---|---|")
    for name, grade, runs in cases:
        if runs == 0 or (asked.case and asked.case != f"{name},{grade}"):
            continue
        plan = plan_protocol(PlanTask.of_grade(named_protocol(name), find_grade(grade), SITE))
        drawn = [errors_of(name, grade, seed) for seed in range(runs)]
        kept = np.array([one for one in drawn if one is not None])
        for group, (factor, unit) in PRACTICAL.items():
            part = GROUPS[group]
            degrees = kept[:, part].size
            simulated = float(np.sqrt(np.mean(kept[:, part] ** 2)))
            foretold = float(np.sqrt(np.mean(plan.sigmas[part] ** 2)))
            low, high = (np.sqrt(chi2.ppf(q, degrees) / degrees) for q in (level / 2.0, 1.0 - level / 2.0))
            ratio = simulated / foretold
            print(
                f"| {name}, {grade}, {len(kept)} runs | {group}, {unit} | {factor * foretold:.3g} | "
                f"{factor * simulated:.3g} | {ratio:.2f} | {low:.2f} to {high:.2f} | "
                f"{'yes' if low <= ratio <= high else 'no'} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
