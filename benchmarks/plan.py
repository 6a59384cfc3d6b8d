"""Is a plan worth what it foretells? Plans simulated sample by sample and calibrated, beside their predictions.

    python benchmarks/plan.py poses --runs 100
    python benchmarks/plan.py protocol --hand-held 100 --turntable 40

`poses` are plans of poses alone; `protocol` those of whole protocols, see `plan_joint.py`. Each run of the former draws
a unit of the grade, plays the plan with it (placement by hand, noise, flicker, converter), finds the holds, calibrates,
and compares with the unit's truth; the bias with its mean over the session, which is what a calibration of that session
is to tell. The rms error over the runs, with an interval for its chance (chi-square, all parameters together 1 % false
alarms), is to hold the prediction.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from plan_joint import judge_protocols
from scipy.stats import chi2

from tumble.attitude.directions import twenty_six_directions
from tumble.design.candidates import sphere_grid
from tumble.design.pose_order import shortest_order
from tumble.design.pose_plan import (
    PosePlan,
    PoseTask,
    Reach,
    criterion_of,
    plan_of,
    plan_poses,
    scheme_directions,
)
from tumble.earth import Site
from tumble.protocol import HoldStep, Pose, Protocol, TurnStep
from tumble.segmentation import find_timeline, observe_holds
from tumble.segmentation.matching import match_protocol
from tumble.sensor import change_frame
from tumble.simulation import Grade, find_grade, simulate_protocol

FALSE_ALARM = 0.01
SITE = Site.from_gravity(9.80665)
GROUPS = {"scale": (slice(0, 3), 1e6, "ppm"), "misalignment": (slice(3, 6), 648000.0 / np.pi, "″")}
GROUPS["bias"] = (slice(6, 9), 1e6, "µg")


def cases() -> list[tuple[str, str, PosePlan, Grade, float]]:
    """Name, procedure, plan, grade and placement of what is tried."""
    rng = np.random.default_rng(1)
    cube, sphere = Reach("26", twenty_six_directions()), Reach("the sphere", sphere_grid(), sphere=True)
    found: list[tuple[str, str, PosePlan, Grade, float]] = []
    for grade_name, reach, count, criterion in (
        ("consumer-mems", cube, 9, "minimax"),
        ("consumer-mems", cube, 18, "A"),
        ("tactical", sphere, 18, "A"),
    ):
        grade = find_grade(grade_name)
        task = PoseTask(grade.accelerometer.noise, criterion_of(criterion), grade.rate, gravity=SITE.gravity)
        plan = plan_poses(task, reach, count, 30.0, rng)
        words = f"{grade_name}, {count} poses of {reach.words}, {criterion}"
        found.append((words, "multi-position", plan, grade, np.radians(5.0)))
    last = found[-1]
    order = shortest_order(last[2].directions)
    short = plan_of("shortest", task, last[2].directions[order], last[2].dwells)
    found.append((f"{last[0]}, in the shortest order", last[1], short, last[3], last[4]))
    grade, tilt = find_grade("consumer-mems"), np.radians(0.5)
    task = PoseTask(
        grade.accelerometer.noise,
        criterion_of("A", np.array([0, 1, 2, 6, 7, 8])),
        grade.rate,
        gravity=SITE.gravity,
        placement=float(np.hypot(tilt**2, np.sqrt(2.0) * tilt * grade.accelerometer.misalignment)),
        shortening=tilt**2,
    )
    faces = plan_of("six faces", task, scheme_directions()["six faces"], np.full(6, 30.0))
    found.append(("consumer-mems, six faces levelled to 0.5°", "six-position", faces, grade, tilt))
    return found


def errors_of(procedure: str, plan: PosePlan, grade: Grade, placement: float, seed: int) -> np.ndarray | None:
    """Estimate less truth, over the parameters of the plan; None if the holds were not found."""
    steps: list[HoldStep | TurnStep] = []
    for up, dwell in zip(plan.directions, plan.dwells, strict=True):
        steps += [TurnStep(plan.turn)] if steps else []
        steps.append(HoldStep(float(dwell), Pose(up, None, placement)))
    protocol = Protocol("plan", procedure, tuple(steps), site=SITE)
    model = grade.simulate_model(np.random.default_rng([seed, 1]))

    def played(noise: bool):
        rng = np.random.default_rng([seed, 2])
        return simulate_protocol(protocol, grade.rate, rng, site=SITE, grade=grade, model=model, noise=noise)[
            0
        ]

    recording = played(True)
    wander = np.mean(recording.specific_force - played(False).specific_force, axis=0)
    timeline = find_timeline(recording)
    means = observe_holds(recording, timeline)
    if len(means) != len(plan.dwells):
        return None
    if procedure == "six-position":
        from tumble.calibration.procedures.six_position import calibrate_six_position

        matching = match_protocol(protocol, recording, timeline, means)
        found = calibrate_six_position(recording, means, matching, protocol, SITE, improved=False).model
        truth = model.accelerometer
    else:
        from tumble.calibration.procedures.multi_position import calibrate_multi_position

        found = calibrate_multi_position(recording, means, SITE).model
        truth = change_frame(model, "accelerometer-x").accelerometer
    size = np.diag(truth.matrix)
    off = (found.accelerometer.matrix - truth.matrix) / size[:, None]
    bias = (found.accelerometer.bias - truth.bias - wander) / size / SITE.gravity
    return np.array([*np.diag(off), off[1, 0], -off[2, 0], off[2, 1], *bias])


def judge_poses(runs: int) -> None:
    """Print the table of plans of poses."""
    tried = cases()
    told = [plan.sigmas < 0.3 for _, _, plan, _, _ in tried]
    level = FALSE_ALARM / sum(int(one.sum()) for one in told)
    print("| plan | parameters | predicted | simulated | ratio by parameter | inside |")
    print("|---|---|---:|---:|---|---|")
    for (words, procedure, plan, grade, placement), there in zip(tried, told, strict=True):
        drawn = [errors_of(procedure, plan, grade, placement, seed) for seed in range(runs)]
        kept = np.array([one for one in drawn if one is not None])
        count = len(kept)
        rms = np.sqrt(np.mean(kept**2, axis=0))
        low, high = (np.sqrt(count / chi2.ppf(q, count)) for q in (1.0 - level / 2.0, level / 2.0))
        for group, (part, factor, unit) in GROUPS.items():
            if not np.all(there[part]):
                continue
            ratio = rms[part] / plan.sigmas[part]
            inside = np.all((rms[part] * low <= plan.sigmas[part]) & (plan.sigmas[part] <= rms[part] * high))
            both = [factor * float(np.sqrt(np.mean(one[part] ** 2))) for one in (plan.sigmas, rms)]
            print(
                f"| {words} | {group}, {unit} | {both[0]:.3g} | {both[1]:.3g} | "
                f"{', '.join(f'{one:.2f}' for one in ratio)} | {'yes' if inside else 'no'} |",
                flush=True,
            )
        if count < runs:
            print(f"{words}: the holds were not found in {runs - count} of {runs} runs")
    print(f"\nInside: rms times {low:.2f} to {high:.2f} ({runs} runs, all together 1 % false alarms).")


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    poses = commands.add_parser("poses", help="plans of poses")
    poses.add_argument("--runs", type=int, default=100)
    protocol = commands.add_parser("protocol", help="plans of whole protocols, calibrated jointly")
    protocol.add_argument("--hand-held", type=int, default=100, help="runs of each grade")
    protocol.add_argument("--turntable", type=int, default=40)
    protocol.add_argument("--case", help="only this one, such as hand-held,tactical")
    protocol.add_argument("--workers", type=int, default=1)
    asked = parser.parse_args()
    if asked.command == "poses":
        judge_poses(asked.runs)
    else:
        judge_protocols(asked.hand_held, asked.turntable, asked.case, asked.workers)


if __name__ == "__main__":
    main()
