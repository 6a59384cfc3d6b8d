"""How near the joint estimator comes to the Cramér-Rao bound on Zhang's simulated table, beside his own estimator.

    python benchmarks/joint_efficiency.py --table 3 --runs 500 --jobs 2

Each run draws nine dwells of 100 s and six axes turned about both ways for 180 s (tables 3 and 4 of the paper),
starts the estimator off by 100 ppm of every parameter, and lets it settle. Printed are the bound, the standard
deviation of the errors, the efficiency (bound over standard deviation) with its one-sided bounds for all 21
parameters together at a false-alarm rate of 1 %, the stated sigma over the standard deviation, and what the
paper's estimator makes of as many runs.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from scipy.stats import chi2

from tumble.studies.joint_turntable import bound, paper_truth, study_runs, true_plan
from tumble.studies.turntable_evaluation import evaluate, in_paper_units, unit_parameters
from tumble.studies.turntable_simulation import simulate, table_setting

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
    return study_runs(true_plan(table_setting(table)), runs, seed)


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser()
    options.add_argument("--table", choices=("3", "4"), default="3")
    options.add_argument("--runs", type=int, default=500)
    options.add_argument("--jobs", type=int, default=2)
    asked = options.parse_args()
    setting = table_setting(asked.table)
    plan = true_plan(setting)
    truth = paper_truth(plan)
    limits = np.abs(in_paper_units(truth + bound(plan, np.random.default_rng(0)), truth))
    started = time.perf_counter()
    share = -(-asked.runs // (4 * asked.jobs))
    tasks = [(asked.table, share, 1000 + k) for k in range(4 * asked.jobs)]
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
