"""Is the plan of a whole protocol worth what it foretells? `python benchmarks/plan.py protocol` runs this.

Each run draws a unit of the grade, plays the protocol with it sample by sample (placement and turns by hand, a table's
angles, noise, flicker, converter), finds the holds, and calibrates jointly as `tumble calibrate` does. The plan is made
for the very motion that was played, turn by turn as long as it was. Beside what is foretold stand what the calibration
states, and the errors against the unit's truth; a bias is its mean over the recording.

The errors are divided by what the plan foretells for their own run: their mean square over n runs is chi-square over n
where the plan is right. All parameters of all four cases together are to raise a false alarm in 1 % of such studies.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import math
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from joint_coverage import calibrate, simulate
from scipy.stats import chi2
from uncertainty import true_values

from tumble.design.joint_information import GROUPS, NAMES, planned_problem
from tumble.design.joint_plan import PlanTask, true_covariance
from tumble.design.planned_motion import planned_data, play_plan
from tumble.earth import Site
from tumble.errors import TumbleError
from tumble.simulation import find_grade

FALSE_ALARM = 0.01
SITE = replace(Site.from_latitude(math.radians(48.0), 300.0), gravity_sigma=0.0)
RATE = 50.0
PRACTICAL = {
    "accelerometer bias": (1e6 / 9.80665, "µg"),
    "accelerometer scale": (1e6, "ppm"),
    "accelerometer misalignment": (648000.0 / np.pi, "″"),
    "gyro bias": (648000.0 / np.pi, "°/h"),
    "gyro scale": (1e6, "ppm"),
    "gyro misalignment": (648000.0 / np.pi, "″"),
    "rotation between the triads": (648000.0 / np.pi, "″"),
}
CASES = (
    ("hand-held", "consumer-mems"),
    ("hand-held", "industrial-mems"),
    ("hand-held", "tactical"),
    ("turntable", "tactical"),
)
TESTED = 21 * len(CASES)


@dataclass
class Run:
    """One recording: (21,) foretold, stated, and by how much the estimate is off; NaN where it failed."""

    predicted: np.ndarray
    stated: np.ndarray
    error: np.ndarray
    kept_for_nothing: bool = False
    failure: str = ""


def run(procedure: str, grade_name: str, seed: int) -> Run:
    """Plan, play and calibrate one unit."""
    grade = find_grade(grade_name)
    recording, protocol, model = simulate(procedure, grade_name, RATE, False, seed, SITE)
    task = PlanTask.of_grade(protocol, replace(grade, rate=RATE), SITE)
    # The same numbers in the same order: placement and turns are those of the recording.
    played = play_plan(protocol, SITE, np.random.default_rng([1000, seed]))
    problem = planned_problem(planned_data(played, task.noise), SITE, task.sizes)
    predicted = np.sqrt(np.diag(true_covariance(task, played, problem)))[:21]
    try:
        estimate = calibrate(procedure, recording, protocol, SITE)["joint"]
    except TumbleError as error:
        nothing = np.full(21, np.nan)
        return Run(predicted, nothing, nothing, failure=f"run {seed}: {error}")
    truth = true_values(model, estimate)
    told = {
        p.name: (p.value - truth[p.name], p.standard_uncertainty)
        for p in estimate.parameters
        if p.name in truth
    }
    error, stated = np.array([told[name] for name in NAMES[:21]]).T
    senses = grade.g_sensitivity > 0.0
    wrong = any(t.kept and not (t.name == "g_sensitivity" and senses) for t in estimate.terms)
    return Run(predicted, stated, error, wrong)


def report(procedure: str, grade: str, runs: list[Run]) -> None:
    """Print a row for each group of parameters, each parameter tested by itself."""
    good = [one for one in runs if not one.failure]
    n, level = len(good), FALSE_ALARM / TESTED
    low, high = (math.sqrt(chi2.ppf(q, n) / n) for q in (level / 2.0, 1.0 - level / 2.0))
    predicted, stated, error = (
        np.array([getattr(one, what) for one in good]) for what in ("predicted", "stated", "error")
    )
    by_parameter = np.sqrt(np.mean((error / predicted) ** 2, axis=0))
    said = np.exp(np.mean(np.log(stated / predicted), axis=0))
    for group, (factor, unit) in PRACTICAL.items():
        part = GROUPS[group]
        sizes = (factor * math.sqrt(np.mean(one[:, part] ** 2)) for one in (predicted, stated, error))
        inside = np.all((by_parameter[part] >= low) & (by_parameter[part] <= high))
        ratios = (", ".join(f"{r:.2f}" for r in one[part]) for one in (said, by_parameter))
        print(
            f"| {procedure}, {grade} | {group}, {unit} | {' | '.join(f'{s:.3g}' for s in sizes)} | "
            f"{' | '.join(ratios)} | {'yes' if inside else 'no'} |",
            flush=True,
        )
    wrong = sum(one.kept_for_nothing for one in good)
    print(
        f"\n{procedure}, {grade}: {n} of {len(runs)} runs calibrated; inside is {low:.2f} to {high:.2f} "
        f"({TESTED} parameters together {100 * FALSE_ALARM:g} % false alarms); an optional term that is not there was "
        f"kept in {wrong}.\n"
    )
    for one in runs:
        if one.failure:
            print(one.failure)


def judge_protocols(hand_held: int, turntable: int, case: str | None, workers: int) -> None:
    """Print the table of all cases.

    Parameters
    ----------
    hand_held, turntable : how many runs.
    case : only this one, such as "hand-held,tactical".
    workers : processes.
    """
    print(
        "| test | parameters | foretold | stated | rms error | stated / foretold | error / foretold | inside |"
    )
    print("|---|---|---:|---:|---:|---|---|---|")
    for procedure, grade in CASES:
        count = hand_held if procedure == "hand-held" else turntable
        if count == 0 or case not in (None, f"{procedure},{grade}"):
            continue
        jobs = ([procedure] * count, [grade] * count, range(count))
        if workers > 1:
            with ProcessPoolExecutor(workers) as pool:
                runs = list(pool.map(run, *jobs))
        else:
            runs = [run(*job) for job in zip(*jobs, strict=True)]
        report(procedure, grade, runs)
