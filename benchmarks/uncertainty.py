"""Do the stated uncertainties hold? Simulated recordings, calibrated, errors over stated sigma.

    python benchmarks/uncertainty.py --runs 200 --grade consumer-mems

Every run draws a unit of the grade, tumbles it through 26 attitudes placed by hand (headings at
random, each angle off by 2 degrees), records it, finds the holds, calibrates it, and compares every
parameter with the truth. Printed: mean and standard deviation of error / stated sigma per group of
parameters, the share inside the stated 95 % interval, failures, and what wrong terms were kept.

The limits in brackets hold for one group at 1 % false alarm with independent parameters; parameters
of one run are correlated, so the bootstrap over runs (2000 draws) gives the interval that counts.
"""

from __future__ import annotations

import argparse
import math
import os
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.spatial.transform import Rotation

from tumble.calibration import (
    LAYOUT,
    Estimate,
    Session,
    calibrate,
    find_procedure,
    named_function,
    unknowns_from_triad,
)
from tumble.earth import Site
from tumble.errors import TumbleError
from tumble.sensor import ImuModel, change_frame
from tumble.simulation import Motion, find_grade, poses_26, simulate_recording

GROUPS = (
    "accelerometer bias",
    "accelerometer scale",
    "accelerometer non-orthogonality",
    "gyro bias",
    "gyro scale",
    "gyro non-orthogonality",
    "rotation between the triads",
    "g-sensitivity",
)


@dataclass
class Outcome:
    seed: int
    failure: str = ""
    flagged: bool = False
    names: tuple[str, ...] = ()
    normalised: tuple[float, ...] = ()
    inside: tuple[bool, ...] = ()
    kept: tuple[str, ...] = ()
    holds: int = 0
    left_out: int = 0


def simulate(seed: int, grade_name: str, rate: float, hold: float, site: Site, white: bool):
    """Return a recording of a unit of the grade in 26 attitudes, and its true model."""
    rng = np.random.default_rng(seed)
    poses = poses_26()
    order = rng.permutation(26)
    off = Rotation.from_euler("xyz", rng.normal(0.0, 2.0, (26, 3)), degrees=True)
    headings = Rotation.from_euler(
        "zyx", np.column_stack([rng.uniform(0.0, 360.0, 26), np.zeros((26, 2))]), degrees=True
    )
    attitudes = (headings * poses * off)[order]
    motion = Motion.between_poses(attitudes, rng.uniform(0.8, 1.5, 26) * hold, rng.uniform(1.5, 3.0, 25))
    grade = find_grade(grade_name)
    if white:
        grade = replace(
            grade,
            accelerometer=without_wander(grade.accelerometer),
            gyroscope=without_wander(grade.gyroscope),
        )
    recording, truth = simulate_recording(motion, rate, rng, site=site, grade=grade)
    # The bias of a session is the bias that it had on average: what wandered belongs to it.
    model = truth.model
    force = replace(model.accelerometer, bias=model.accelerometer.bias + truth.mean_wander[0])
    gyro = replace(model.gyroscope, bias=model.gyroscope.bias + truth.mean_wander[1])
    return recording, replace(model, accelerometer=force, gyroscope=gyro)


def without_wander(triad):
    return replace(triad, noise=replace(triad.noise, bias_instability=0.0, rate_random_walk=0.0))


def true_values(model: ImuModel, estimate: Estimate) -> dict[str, float]:
    """Return the truth in the estimate's own parameters."""
    turned = change_frame(model, "accelerometer-x")
    x = np.zeros(LAYOUT.size)
    # Round-off above the diagonal is cut off.
    x[:12] = unknowns_from_triad(
        type(turned.accelerometer)(np.tril(turned.accelerometer.matrix), turned.accelerometer.bias)
    )
    x[LAYOUT["gyro.matrix"]], x[LAYOUT["gyro.bias"]] = turned.gyroscope.matrix.ravel(), turned.gyroscope.bias
    if turned.g_sensitivity is not None:
        x[LAYOUT["gyro.g_sensitivity"]] = turned.g_sensitivity.ravel()
    units = ("m/s^2", "rad/s")
    labels, values = named_function(frozenset({"g_sensitivity"}), "full", "accelerometer-x", units)
    return {name: float(value) for (name, _), value in zip(labels, values(x), strict=True)}


def run(seed: int, grade: str, rate: float, hold: float, white: bool) -> Outcome:
    site = Site.from_latitude(math.radians(48.0), 300.0)
    exact = Site(site.gravity, 0.0, site.latitude, site.height, "simulated")
    recording, model = simulate(seed, grade, rate, hold, exact, white)
    try:
        session = Session(recording, given_site=exact)
        estimate = calibrate(session, find_procedure("hand-held"))
    except TumbleError as error:
        return Outcome(seed, failure=f"{type(error).__name__}: {error}")
    truth = true_values(model, estimate)
    names, normalised, inside = [], [], []
    for parameter in estimate.parameters:
        true = truth.get(parameter.name, 0.0)
        z = (parameter.value - true) / parameter.standard_uncertainty
        names.append(parameter.name)
        normalised.append(z)
        inside.append(abs(z) <= estimate.coverage_factor)
    return Outcome(
        seed,
        names=tuple(names),
        normalised=tuple(normalised),
        inside=tuple(inside),
        kept=tuple(term.name for term in estimate.terms if term.kept),
        holds=len(session.timeline.holds),
        left_out=len(estimate.left_out),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--grade", default="consumer-mems")
    parser.add_argument("--rate", type=float, default=100.0)
    parser.add_argument("--hold", type=float, default=4.0, help="seconds, times 0.8 to 1.5")
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--white", action="store_true", help="white noise only: no bias instability")
    options = parser.parse_args()
    started = time.perf_counter()
    jobs = [
        (options.seed + k, options.grade, options.rate, options.hold, options.white)
        for k in range(options.runs)
    ]
    if options.workers > 1:
        with ProcessPoolExecutor(options.workers) as pool:
            outcomes = list(pool.map(run, *zip(*jobs, strict=True), chunksize=5))
    else:
        outcomes = [run(*job) for job in jobs]
    report(outcomes, options, time.perf_counter() - started)


def report(outcomes: list[Outcome], options: argparse.Namespace, seconds: float) -> None:
    good = [outcome for outcome in outcomes if not outcome.failure]
    print(
        f"{options.grade}{', white noise' if options.white else ''}, "
        f"{options.rate:g} Hz, 26 holds of about {options.hold:g} s: "
        f"{len(outcomes)} runs in {seconds:.0f} s, {len(outcomes) - len(good)} failures"
    )
    for outcome in outcomes:
        if outcome.failure:
            print(f"  seed {outcome.seed}: {outcome.failure}")
    print(
        f"  holds found: {np.mean([o.holds for o in good]):.2f} of 26; "
        f"left out per run: {np.mean([o.left_out for o in good]):.3f}"
    )
    kept = {name: sum(name in o.kept for o in good) for o in good for name in o.kept}
    print(f"  optional terms kept: {kept or 'none'} of {len(good)} runs")
    rng = np.random.default_rng(0)
    print(
        f"  {'group':34s}{'n':>6s}{'mean z':>9s}{'sd z [95 % bootstrap]':>26s}{'inside 95 %':>22s}{'max |z|':>9s}"
    )
    for group in GROUPS:
        rows = [
            [(z, i) for n, z, i in zip(o.names, o.normalised, o.inside, strict=True) if n.startswith(group)]
            for o in good
        ]
        rows = [row for row in rows if row]
        if len(rows) < 2:
            continue
        z = [np.array([value for value, _ in row]) for row in rows]
        inside = [np.array([value for _, value in row], dtype=float) for row in rows]
        everything, covered = np.concatenate(z), np.concatenate(inside)
        draws = rng.integers(0, len(rows), (2000, len(rows)))
        squares, sums, counts = (np.array([f(v) for v in z]) for f in (lambda v: np.sum(v**2), np.sum, len))
        spread = np.sqrt(
            squares[draws].sum(1) / counts[draws].sum(1) - (sums[draws].sum(1) / counts[draws].sum(1)) ** 2
        )
        cover = np.array([np.sum(v) for v in inside])[draws].sum(1) / counts[draws].sum(1)
        low, high = np.quantile(spread, (0.025, 0.975))
        clow, chigh = np.quantile(cover, (0.025, 0.975))
        error = np.std(sums / counts) / np.sqrt(len(rows))
        print(
            f"  {group:34s}{everything.size:6d}{everything.mean():+6.2f}±{error:.2f}"
            f"{everything.std():10.3f} [{low:.3f}, {high:.3f}]"
            f"{100 * covered.mean():8.1f} [{100 * clow:.1f}, {100 * chigh:.1f}]{np.max(np.abs(everything)):9.2f}"
        )


if __name__ == "__main__":
    main()
