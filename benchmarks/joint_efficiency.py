"""How near the joint estimator comes to the Cramér-Rao bound on Zhang's simulated table, beside his own estimator.

    python benchmarks/joint_efficiency.py --table 3 --runs 500 --jobs 2
    python benchmarks/joint_efficiency.py --table 3 --runs 1000 --coloured

Each run draws nine dwells of 100 s and six axes turned about both ways for 180 s (tables 3 and 4 of the paper),
starts the estimator off by 100 ppm of every parameter, and lets it settle. Printed are the bound, the standard
deviation of the errors, the efficiency (bound over standard deviation) with its one-sided bounds for all 21
parameters together at a false-alarm rate of 1 %, the stated sigma over the standard deviation, and what the
paper's estimator makes of as many runs. The site's latitude is another one in each run, by the sigma to which the
estimator believes it.

With --coloured the biases of both triads wander as 1/f noise over the whole campaign, which is shorter: dwells of
40 s, after which white noise has come down to the wander's floor, and two revolutions each way. Printed are, against
the covariance that `calibrate_joint` states, the root mean square of error over stated sigma, the share inside 95 %
intervals, and the normalised estimation error squared (NEES) of all 21 together, each with what chance allows at a
false-alarm rate of 1 % for all parameters together. The truth of a bias is its mean over the campaign.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import numpy as np
from scipy.stats import binom, chi2

from tumble.calibration.equations.reference_equations import LATITUDE_SIGMA
from tumble_papers.zhang.joint_turntable import (
    TruePlan,
    bound,
    coloured_run,
    paper_truth,
    study_runs,
    true_plan,
)
from tumble_papers.zhang.turntable_evaluation import evaluate, in_paper_units, unit_parameters
from tumble_papers.zhang.turntable_simulation import simulate, table_setting

FALSE_ALARM = 0.01
NAMES = (
    *(f"accelerometer scale {a}, ppm" for a in "xyz"),
    *(f"accelerometer misalignment {a}, ″" for a in ("yz", "zy", "zx")),
    *(f"accelerometer bias {a}, µg" for a in "xyz"),
    *(f"gyro scale {a}, ppm" for a in "xyz"),
    *(f"gyro misalignment {a}, ″" for a in ("yz", "zy", "zx")),
    *(f"gyro bias {a}, °/h" for a in "xyz"),
    *(f"inter-triad {a}, ″" for a in "xyz"),
)


def piece(task: tuple[str, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return errors and stated sigmas of some runs."""
    table, runs, seed = task
    return study_runs(true_plan(table_setting(table), latitude_sigma=LATITUDE_SIGMA), runs, seed)


DWELL, DURATION = 40.0, 72.0  # s
INSIDE = 0.95


def coloured_plan(table: str) -> TruePlan:
    """Return the shorter campaign in which biases wander."""
    setting = replace(table_setting(table), dwell=DWELL, duration=DURATION)
    return true_plan(setting, latitude_sigma=LATITUDE_SIGMA, white_until=DWELL)


def coloured_piece(task: tuple[str, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return errors over stated sigmas of some runs, and their NEES."""
    table, runs, seed = task
    plan = coloured_plan(table)
    made = [coloured_run(plan, np.random.default_rng([seed, run])) for run in range(runs)]
    over_sigma = np.array([error / np.sqrt(np.diag(covariance)) for error, covariance in made])
    return over_sigma, np.array([error @ np.linalg.solve(covariance, error) for error, covariance in made])


def report_coloured(table: str, runs: int, jobs: int) -> None:
    """Print what the stated covariance is worth where biases wander."""
    started = time.perf_counter()
    tasks = [(table, size, 2000 + k) for k, size in enumerate(_shares(runs))]
    with ProcessPoolExecutor(jobs) as pool:
        made = list(pool.map(coloured_piece, tasks))
    over_sigma, nees = np.concatenate([m[0] for m in made]), np.concatenate([m[1] for m in made])
    seconds = (time.perf_counter() - started) / runs * jobs
    rms, size = np.sqrt(np.mean(over_sigma**2, axis=0)), over_sigma.shape[1]
    covered = np.mean(np.abs(over_sigma) <= chi2.isf(1.0 - INSIDE, 1) ** 0.5, axis=0)
    # each of 21 parameters has its share of the false alarm, half of it on either side
    tail = 0.5 * FALSE_ALARM / size
    by_chance = np.sqrt(chi2.isf([1.0 - tail, tail], runs) / runs)
    inside = np.array([binom.ppf(tail, runs, INSIDE), binom.isf(tail, runs, INSIDE)]) / runs
    together = chi2.isf([1.0 - 0.5 * FALSE_ALARM, 0.5 * FALSE_ALARM], runs * size) / (runs * size)
    print(f"table {table}, biases wander: {runs} runs, {seconds:.2f} s of one core each")
    print(
        f"by chance: rms z {by_chance[0]:.3f} to {by_chance[1]:.3f}, inside {inside[0]:.3f} to {inside[1]:.3f}\n"
    )
    print(f"{'':34s} {'rms z':>7s} {'inside 95 %':>12s}")
    for k, name in enumerate(NAMES):
        print(f"{name.split(',')[0]:34s} {rms[k]:7.3f} {100.0 * covered[k]:12.1f}")
    out = np.count_nonzero((rms < by_chance[0]) | (rms > by_chance[1]))
    out_inside = np.count_nonzero((covered < inside[0]) | (covered > inside[1]))
    print(f"\noutside of what chance allows: rms z of {out}, intervals of {out_inside} parameters")
    print(f"all: rms z {np.sqrt(np.mean(over_sigma**2)):.3f}, {100.0 * covered.mean():.1f} % inside 95 %")
    print(f"NEES over {size}: {nees.mean() / size:.4f}; by chance {together[0]:.4f} to {together[1]:.4f}")


def _shares(runs: int) -> list[int]:
    """Return pieces of at most a hundred runs, whose seeds do not depend on how many processes there are."""
    return [min(100, runs - first) for first in range(0, runs, 100)]


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser()
    options.add_argument("--table", choices=("3", "4"), default="3")
    options.add_argument("--runs", type=int, default=500)
    options.add_argument("--jobs", type=int, default=2)
    options.add_argument("--coloured", action="store_true", help="biases wander as 1/f noise")
    asked = options.parse_args()
    if asked.coloured:
        report_coloured(asked.table, asked.runs, asked.jobs)
        return
    setting = table_setting(asked.table)
    plan = true_plan(setting)
    truth = paper_truth(plan)
    limits = np.abs(in_paper_units(truth + bound(plan, np.random.default_rng(0)), truth))
    started = time.perf_counter()
    tasks = [(asked.table, size, 1000 + k) for k, size in enumerate(_shares(asked.runs))]
    with ProcessPoolExecutor(asked.jobs) as pool:
        made = list(pool.map(piece, tasks))
    seconds = time.perf_counter() - started
    errors = np.concatenate([m[0] for m in made])
    sigmas = np.concatenate([m[1] for m in made])
    runs = len(errors)
    off = in_paper_units(truth + errors, truth)
    stated = np.abs(in_paper_units(truth + sigmas, truth)).mean(axis=0)
    scatter = np.sqrt(np.mean(off**2, axis=0))
    estimates = evaluate(simulate(setting, runs, np.random.Generator(np.random.SFC64(1)), sampled=False))
    paper = in_paper_units(estimates.parameters(), unit_parameters(setting.unit)).std(axis=0, ddof=1)
    # rms² runs / truth² is chi-square: how far below the true efficiency one of 21 may come by chance
    chance = np.sqrt(chi2.isf(FALSE_ALARM / len(limits), runs) / runs)
    print(f"table {asked.table}: {runs} runs, {seconds / runs * asked.jobs:.2f} s of one core each")
    print(f"by chance one of the 21 comes {1.0 - 1.0 / chance:.3f} below its efficiency in 1 % of studies\n")
    print(
        f"{'':34s} {'bound':>9s} {'rms error':>9s} {'efficiency':>10s} {'stated/rms':>10s} {'paper':>9s} {'gain':>5s}"
    )
    for k, name in enumerate(NAMES):
        print(
            f"{name:34s} {limits[k]:9.4f} {scatter[k]:9.4f} {limits[k] / scatter[k]:10.3f} "
            f"{stated[k] / scatter[k]:10.3f} {paper[k]:9.4f} {paper[k] / scatter[k]:5.1f}"
        )
    worst = float(np.min(limits / scatter))
    print(f"\nleast efficiency {worst:.3f}; at least {0.95 / chance:.3f} is what 0.95 allows by chance")
    spread = np.mean((off / np.abs(in_paper_units(truth + sigmas, truth))) ** 2)
    inside = np.mean(np.abs(off) < 1.96 * np.abs(in_paper_units(truth + sigmas, truth)))
    print(f"mean squared normalised error {spread:.3f}, {100 * inside:.1f} % inside 95 %")


if __name__ == "__main__":
    main()
