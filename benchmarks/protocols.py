"""How far the uncertainties of the tests with a protocol can be trusted: simulated, calibrated, compared.

    python benchmarks/protocols.py                              # 60 runs of each procedure, two grades
    python benchmarks/protocols.py --runs 200 --procedure rate-table --grade tactical

Each run draws another unit, other placements within the protocol's uncertainties, and other noise. Printed
are, for the entries of matrix and bias that the procedure states an uncertainty of, the standard deviation
of error over stated uncertainty (1 is right), the share inside 95 % intervals, and the largest of all; and
how often the verdict was fit. A bias is compared with its mean over the session, wander included.
"""

from __future__ import annotations

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

PROCEDURES = {
    "six-position": "six-position",
    "improved-six-position": "six-position",
    "multi-position": "multi-position-26",
    "rate-table": "rate-table",
    "modified-multi-position": "modified-multi-position",
    "turntable": "turntable-9",
    "laboratory": "laboratory",
    "strapdown-rotation": "strapdown-rotation",
}
GRADES = ("consumer-mems", "tactical")


def one_run(job: tuple[str, str, int, bool, float]) -> tuple[list[tuple[str, float, float]], bool] | str:
    """Return (parameter, error over sigma, coverage factor) of each entry, and the verdict; or what went wrong."""
    import numpy as np

    from tumble.calibration.session import Session
    from tumble.document import calibration_from_estimate
    from tumble.earth import Site
    from tumble.errors import TumbleError
    from tumble.protocol import named_protocol
    from tumble.sensor import change_frame
    from tumble.simulation import find_grade, simulate_protocol
    from tumble.workflows.procedures import run_procedure

    procedure, grade_name, seed, white, rate = job
    grade = find_grade(grade_name)
    if white:

        def quiet(noise):
            return replace(noise, bias_instability=0.0, rate_random_walk=0.0)

        grade = replace(
            grade,
            accelerometer=replace(grade.accelerometer, noise=quiet(grade.accelerometer.noise)),
            gyroscope=replace(grade.gyroscope, noise=quiet(grade.gyroscope.noise)),
        )
    site = Site.from_latitude(float(np.radians(48.0)), 500.0)
    site = replace(site, gravity_sigma=0.0)
    protocol = replace(named_protocol(PROCEDURES[procedure]), site=site)
    recording, truth = simulate_protocol(protocol, rate, np.random.default_rng(seed), site=site, grade=grade)
    try:
        estimate, _ = run_procedure(Session(recording, protocol, site), procedure)
    except TumbleError as error:
        return f"seed {seed}: {error}"
    document = calibration_from_estimate(estimate, recording, site)
    model = truth.model if estimate.frame == "fixture" else change_frame(truth.model, estimate.frame)
    rows: list[tuple[str, float, float]] = []
    for index, name in enumerate(estimate.names):
        sigma = float(np.sqrt(estimate.covariance[index, index]))
        undetermined = procedure == "multi-position" and name.startswith("gyroscope.matrix")
        if sigma > 0.0 and not undetermined:
            error = entry(estimate.model, name) - entry(model, name)
            if ".bias" in name:
                wander = truth.force_wander if name.startswith("acc") else truth.rate_wander
                error -= float(np.nanmean(wander[:, int(name[-2])]))
            rows.append((name, error / sigma, estimate.coverage_factor))
    return rows, document.verdict.fit


def entry(model, name: str) -> float:
    triad, rest = name.split(".")
    key, index = rest.rstrip("]").split("[")
    owner = model if key == "g_sensitivity" else getattr(model, triad)
    value = getattr(owner, key)
    if value is None:
        return 0.0
    for i in index.split(","):
        value = value[int(i)]
    return float(value)


def report(procedure: str, grade: str, outcomes: list) -> None:
    import numpy as np

    failed = [outcome for outcome in outcomes if isinstance(outcome, str)]
    done = [outcome for outcome in outcomes if not isinstance(outcome, str)]
    groups: dict[str, list[tuple[float, float]]] = {}
    for rows, _ in done:
        for name, z, factor in rows:
            groups.setdefault(name.split("[")[0], []).append((z, factor))
    fit = sum(verdict for _, verdict in done)
    print(f"| {procedure} | {grade} | {len(outcomes)} | {len(failed)} | {fit} | ", end="")
    cells = []
    for name, values in sorted(groups.items()):
        z, factor = np.array(values).T
        inside = 100.0 * np.mean(np.abs(z) <= factor)
        cells.append(f"{name} {np.sqrt(np.mean(z**2)):.2f}, {inside:.0f} %, {np.abs(z).max():.1f}")
    print("; ".join(cells), "|", flush=True)
    for message in failed[:3]:
        print(f"    {message}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--runs", type=int, default=60)
    parser.add_argument("--procedure", choices=list(PROCEDURES))
    parser.add_argument("--grade", choices=GRADES)
    parser.add_argument("--first", type=int, default=70_000, help="first seed")
    parser.add_argument("--rate", type=float, default=50.0, help="Hz")
    parser.add_argument("--white", action="store_true", help="without flicker and random walk")
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    print("| procedure | grade | runs | failed | fit | rms of error over sigma, inside 95 %, largest |")
    print("|---|---|---:|---:|---:|---|")
    with ProcessPoolExecutor(given.workers) as pool:
        for procedure in [given.procedure] if given.procedure else PROCEDURES:
            for grade in [given.grade] if given.grade else GRADES:
                jobs = [
                    (procedure, grade, given.first + k, given.white, given.rate) for k in range(given.runs)
                ]
                report(procedure, grade, list(pool.map(one_run, jobs, chunksize=4)))


if __name__ == "__main__":
    main()
