"""Do the joint estimator's intervals hold, and is it better than a paper's own estimator?

    python benchmarks/joint_coverage.py --procedure hand-held --grade consumer-mems --runs 100
    python benchmarks/joint_coverage.py --procedure turntable --grade tactical --runs 20 --white
    python benchmarks/joint_coverage.py --procedure modified-multi-position --estimator modified-multi-position

Every run draws a unit of the grade, plays the named protocol with it, and calibrates it as a user gets it: segments
found, outliers left out, optional terms tried; with `--estimator` by a paper's own estimator, too. Printed,
per group of parameters: root mean square of error over stated sigma (z), the share inside the 95 % interval, with
the factor of all degrees of freedom and with each parameter's own, the rms error against that of the paper's
(ratio below one: the joint one is nearer), all with the 95 % interval of a bootstrap over runs. Then the mean
normalised estimation error squared (NEES) over its degrees of freedom, which optional terms were kept though the
unit has none or missed though it has them, and coverage in the runs where a term was kept. The truth of a wandering
bias is its mean over the recording. Both are compared in the axes of the accelerometers; where the paper's
estimator knows its fixture's axes alone, or nothing of a group, the joint estimate's figures stand by themselves.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import math
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np
from uncertainty import GROUPS, true_values, without_wander

from tumble.calibration import Budget, Estimate, Session
from tumble.earth import Site
from tumble.errors import TumbleError
from tumble.protocol import named_protocol
from tumble.recording import Recording
from tumble.sensor import ImuModel
from tumble.simulation import find_grade, simulate_protocol
from tumble.workflows import find_estimator, run_procedure

PROTOCOLS = {
    "hand-held": "hand-held",
    "multi-position": "multi-position-26",
    "six-position": "six-position",
    "rate-table": "rate-table",
    "modified-multi-position": "modified-multi-position",
    "turntable": "turntable-9",
    "laboratory": "laboratory",
    "strapdown-rotation": "strapdown-rotation",
}
PLAIN = GROUPS[:-1]
WAYS = ("paper", "joint")


@dataclass
class Run:
    """One recording calibrated both ways: errors and stated sigmas of each parameter by name."""

    seed: int
    failure: str = ""
    errors: dict[str, dict[str, float]] = field(default_factory=dict)
    sigmas: dict[str, dict[str, float]] = field(default_factory=dict)
    factor: dict[str, float] = field(default_factory=dict)
    own_factors: dict[str, float] = field(default_factory=dict)
    kept: dict[str, tuple[str, ...]] = field(default_factory=dict)
    nees: dict[str, float] = field(default_factory=dict)
    left_out: dict[str, int] = field(default_factory=dict)
    senses_force: bool = False
    seconds: float = 0.0


def simulate(procedure: str, grade_name: str, rate: float, white: bool, seed: int, site: Site):
    """Return a recording of a unit of the grade, the protocol, and the true model."""
    grade = find_grade(grade_name)
    if white:
        grade = replace(
            grade,
            accelerometer=without_wander(grade.accelerometer),
            gyroscope=without_wander(grade.gyroscope),
        )
    protocol = replace(named_protocol(PROTOCOLS[procedure]), site=site)
    rng = np.random.default_rng([1000, seed])
    recording, truth = simulate_protocol(protocol, rate, rng, site=site, grade=grade)
    model = truth.model
    # The bias of a session is the bias that it had on average, over all that was recorded: what wandered
    # belongs to it.
    force = replace(model.accelerometer, bias=model.accelerometer.bias + truth.mean_wander[0])
    gyro = replace(model.gyroscope, bias=model.gyroscope.bias + truth.mean_wander[1])
    return recording, protocol, replace(model, accelerometer=force, gyroscope=gyro)


def calibrate(
    procedure: str, recording: Recording, protocol, site: Site, estimator: str | None
) -> dict[str, Estimate]:
    """Return the joint estimate, and the paper's where one is asked for and it is in the same axes."""
    has_protocol = procedure != "hand-held"
    session = Session(recording, protocol if has_protocol else None, site)
    joint, _ = run_procedure(session, "joint")
    theirs = (
        None if estimator is None else find_estimator(estimator, has_protocol=has_protocol).estimate(session)
    )
    if theirs is None or theirs.frame != joint.frame:
        return {"joint": joint}
    return {"paper": theirs, "joint": joint}


def run(seed: int, procedure: str, grade: str, rate: float, white: bool, estimator: str | None = None) -> Run:
    site = replace(Site.from_latitude(math.radians(48.0), 300.0), gravity_sigma=0.0)
    recording, protocol, model = simulate(procedure, grade, rate, white, seed, site)
    started = time.perf_counter()
    try:
        made = calibrate(procedure, recording, protocol, site, estimator)
    except TumbleError as error:
        return Run(seed, failure=f"{type(error).__name__}: {error}")
    done = Run(seed, senses_force=senses_force(model), seconds=time.perf_counter() - started)
    for way, estimate in made.items():
        add_errors(done, way, estimate, model)
    return done


def add_errors(done: Run, way: str, estimate: Estimate, model: ImuModel) -> None:
    truth = true_values(model, estimate)
    at = [k for k, p in enumerate(estimate.parameters) if p.standard_uncertainty > 0.0]
    named = [estimate.parameters[k] for k in at]
    done.errors[way] = {p.name: p.value - truth.get(p.name, 0.0) for p in named}
    done.sigmas[way] = {p.name: p.standard_uncertainty for p in named}
    done.factor[way] = estimate.coverage_factor
    if way == "joint":
        budget = estimate.shown(Budget)
        told = None if budget is None else budget.statement
        own = [estimate.coverage_factor] * len(estimate.parameters) if told is None else told.coverage_factors
        done.own_factors = {estimate.parameters[k].name: float(own[k]) for k in at}
    done.kept[way] = tuple(term.name for term in estimate.terms if term.kept)
    done.left_out[way] = len(estimate.left_out)
    plain = [k for k, p in zip(at, named, strict=True) if p.name.startswith(PLAIN)]
    z = np.array([done.errors[way][estimate.parameters[k].name] for k in plain])
    z /= np.array([estimate.parameters[k].standard_uncertainty for k in plain])
    correlations = estimate.correlations[np.ix_(plain, plain)]
    done.nees[way] = float(z @ np.linalg.solve(correlations, z)) / len(plain)


def senses_force(model: ImuModel) -> bool:
    return model.g_sensitivity is not None and bool(np.any(model.g_sensitivity))


def interval(values: Callable[[np.ndarray], float], runs: int) -> str:
    """Return a statistic of all runs with the 95 % interval of 1000 bootstrap draws of runs."""
    rng = np.random.default_rng(0)
    low, high = np.quantile([values(rng.integers(0, runs, runs)) for _ in range(1000)], (0.025, 0.975))
    return f"{values(np.arange(runs)):6.3f} [{low:.3f}, {high:.3f}]"


def report(runs: list[Run]) -> None:
    good = [r for r in runs if not r.failure]
    for r in runs:
        if r.failure:
            print(f"  run {r.seed}: {r.failure}")
    left = ", ".join(f"{np.mean([r.left_out[way] for r in given]):.2f} {way}" for way, given in by_way(good))
    print(
        f"  {len(good)} good runs, {np.mean([r.seconds for r in good]):.1f} s each for both; "
        f"left out per run: {left}"
    )
    print(
        f"  {'group':33s}{'paper: rms z':>22s}{'joint: rms z':>22s}{'joint: inside 95 %':>24s}"
        f"{'own factor':>12s}{'rms joint / paper':>24s}{'sigma ratio':>13s}"
    )
    for group in (*PLAIN, "all of these", "g-sensitivity"):
        row(good, PLAIN if group == "all of these" else (group,), group)
    for way, given in by_way(good):
        nees = np.array([r.nees[way] for r in given])
        print(f"  NEES / degrees of freedom, {way:9s} {interval(lambda d, n=nees: n[d].mean(), len(given))}")
    selection(good)


def by_way(runs: list[Run]) -> list[tuple[str, list[Run]]]:
    """Return the ways that there are, each with its runs."""
    given = [(way, [r for r in runs if way in r.errors]) for way in WAYS]
    return [(way, some) for way, some in given if some]


def row(good: list[Run], starts: tuple[str, ...], label: str) -> None:
    def of_group(run: Run, way: str) -> set[str]:
        # What is known of a group differs from run to run only where a term was kept or not.
        return {n for n in run.errors.get(way, {}) if n.startswith(starts)}

    chosen = [r for r in good if of_group(r, "joint")]
    if len(chosen) < 2:
        return
    names = sorted(set.intersection(*(of_group(r, "joint") for r in chosen)))
    if not names:  # told in some recordings only
        return
    both = all(set(names) <= of_group(r, "paper") for r in chosen)
    square, ratio, spread = ({} for _ in range(3))
    for way in WAYS if both else ("joint",):
        e = np.array([[r.errors[way][n] for n in names] for r in chosen])
        s = np.array([[r.sigmas[way][n] for n in names] for r in chosen])
        square[way], ratio[way], spread[way] = (e / s) ** 2, e**2, s**2
    n = len(chosen)
    k = np.array([r.factor["joint"] for r in chosen])
    own = np.array([[r.own_factors[m] for m in names] for r in chosen])
    covered, covered_own = square["joint"] <= k[:, None] ** 2, square["joint"] <= own**2

    def root_mean(values):
        return lambda d: math.sqrt(values[d].mean())

    def gain(d):
        # parameters of one group have one unit, all together do not: the mean of their logarithms
        return math.exp(0.5 * np.mean(np.log(ratio["joint"][d].mean(0) / ratio["paper"][d].mean(0))))

    paper, gained, stated = "-", "-", "-"
    if both:
        paper, gained = interval(root_mean(square["paper"]), n), interval(gain, n)
        stated = f"{math.exp(0.5 * np.mean(np.log(spread['joint'].mean(0) / spread['paper'].mean(0)))):.3f}"
    print(
        f"  {f'{label} ({len(names)})':33s}{paper:>22s}{interval(root_mean(square['joint']), n):>22s}"
        f"{interval(lambda d: 100.0 * covered[d].mean(), n):>24s}{100.0 * covered_own.mean():12.2f}"
        f"{gained:>24s}{stated:>13s}"
    )


def selection(good: list[Run]) -> None:
    """Print which terms were kept for nothing or missed, and what that does to coverage."""
    for way, given in by_way(good):
        wrong = [[t for t in r.kept[way] if t != "g_sensitivity" or not r.senses_force] for r in given]
        names = sorted({t for w in wrong for t in w})
        share = sum(bool(w) for w in wrong)
        missed = sum(r.senses_force and "g_sensitivity" not in r.kept[way] for r in given)
        have = sum(r.senses_force for r in given)
        told = ", ".join(f"{n} {sum(n in w for w in wrong)}" for n in names) or "none"
        print(f"  {way}: a term that is not there kept in {share} of {len(given)} runs ({told}); ", end="")
        print(f"g-sensitivity missed in {missed} of the {have} that have it")
    kept = [r for r in good if r.kept["joint"]]
    if kept:
        inside = [
            abs(e) <= r.factor["joint"] * r.sigmas["joint"][n]
            for r in kept
            for n, e in r.errors["joint"].items()
            if n.startswith(PLAIN)
        ]
        print(f"  joint, in the {len(kept)} runs with a term kept: {100 * np.mean(inside):.1f} % inside 95 %")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--procedure", choices=tuple(PROTOCOLS), default="hand-held")
    parser.add_argument("--grade", default="consumer-mems")
    parser.add_argument("--estimator", help="a paper's own, as `tumble calibrate --estimator` takes it")
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--rate", type=float, default=50.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--white", action="store_true", help="white noise only: no bias wanders")
    asked = parser.parse_args()
    seeds = range(asked.seed, asked.seed + asked.runs)
    jobs = [(seed, asked.procedure, asked.grade, asked.rate, asked.white, asked.estimator) for seed in seeds]
    if asked.workers > 1:
        with ProcessPoolExecutor(asked.workers) as pool:
            runs = list(pool.map(run, *zip(*jobs, strict=True)))
    else:
        runs = [run(*job) for job in jobs]
    white = ", white noise" if asked.white else ""
    print(f"{asked.procedure}, {asked.grade}{white}, {asked.rate:g} Hz, {asked.runs} runs")
    report(runs)


if __name__ == "__main__":
    main()
