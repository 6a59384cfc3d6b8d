"""What uncertainty to expect of the classical tests: simulated, calibrated, a figure and tables of the outcome.

    python docs/figures/classical_uncertainty.py            # simulate (some minutes), then draw
    python docs/figures/classical_uncertainty.py --draw     # draw from classical-uncertainty.csv

Each named protocol is played by units of three grades, with its holds and spins made 10, 30 and 100 s
long, and calibrated; once more, at 30 s and with the tactical grade, with its placement made better and
worse. Given is the median, over runs and axes, of the standard uncertainty that the calibration states.
"""

from __future__ import annotations

import argparse
import csv
import math
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from statistics import median

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

FOLDER = Path(__file__).resolve().parent
sys.path.insert(0, str(FOLDER))
from expected_uncertainty import GRADES, opening, panel, rounded  # noqa: E402

TABLE = FOLDER / "classical-uncertainty.csv"
SECONDS, USUAL = (10.0, 30.0, 100.0), 30.0
PLACEMENTS = (0.05, 0.2, 0.5)  # degrees
RUNS = 5
ACCELEROMETER = {
    "accelerometer bias": ("Accelerometer bias", 1e3, "mm/s²"),
    "accelerometer scale": ("Accelerometer scale", 1e6, "ppm"),
}
GYRO = {
    "gyro bias": ("Gyro bias", 1e6, "µrad/s"),
    "gyro scale": ("Gyro scale", 1e6, "ppm"),
}
# Start of the parameters' names -> (title, factor from SI, unit), by procedure.
GROUPS = {
    "six-position": {
        **ACCELEROMETER,
        "accelerometer misalignment": ("Accelerometer misalignment", 1e3, "mrad"),
        "gyro bias": GYRO["gyro bias"],
    },
    "rate-table": {**GYRO, "gyro misalignment": ("Gyro misalignment", 1e3, "mrad")},
    "modified-multi-position": {
        **ACCELEROMETER,
        "accelerometer non-orthogonality": ("Accelerometer non-orthogonality", 1e6, "µrad"),
        **GYRO,
        "gyro non-orthogonality": ("Gyro non-orthogonality", 1e6, "µrad"),
        "rotation between": ("Rotation between the triads", 1e6, "µrad"),
    },
}
DRAWN = (
    ("six-position", "accelerometer bias", "six-position"),
    ("six-position", "accelerometer scale", "six-position"),
    ("rate-table", "gyro bias", "rate table"),
    ("rate-table", "gyro scale", "rate table"),
    ("modified-multi-position", "gyro scale", "modified"),
    ("modified-multi-position", "gyro non-orthogonality", "modified"),
)
Job = tuple[str, str, float, float | None, int]


def changed_protocol(procedure: str, seconds: float, placement: float | None):
    """Return the named protocol, holds and spins of `seconds`, placed to `placement` degrees, at exact rates."""
    from dataclasses import replace

    from tumble.protocol import HoldStep, SpinStep, named_protocol

    def changed(step):
        if isinstance(step, SpinStep):
            period = 2.0 * math.pi / abs(step.rate)
            return replace(step, duration=math.ceil(seconds / period) * period, sigma=0.0)
        if not isinstance(step, HoldStep):
            return step
        pose = step.pose
        if pose is not None and placement is not None:
            pose = replace(pose, sigma=math.radians(placement))
        return replace(step, duration=seconds, pose=pose)

    protocol = named_protocol(procedure)
    return replace(protocol, steps=tuple(changed(step) for step in protocol.steps))


def one_run(job: Job) -> dict[str, float]:
    """Return the median stated uncertainty of each group of parameters in one simulated calibration."""
    import numpy as np

    from tumble.calibration import Session
    from tumble.earth import Site
    from tumble.simulation import find_grade, simulate_protocol
    from tumble.workflows import run_procedure

    procedure, grade, seconds, placement, seed = job
    rng = np.random.default_rng([seed, round(seconds), round(100 * (placement or 0.0))])
    site = Site.from_latitude(math.radians(48.0), 300.0)
    site = Site(site.gravity, 0.0, site.latitude, site.height, "simulated")
    protocol = changed_protocol(procedure, seconds, placement)
    recording, _ = simulate_protocol(protocol, 100.0, rng, site=site, grade=find_grade(grade))
    estimate, _ = run_procedure(Session(recording, protocol, site), procedure)
    return {
        group: median(p.standard_uncertainty for p in estimate.parameters if p.name.startswith(group))
        for group in GROUPS[procedure]
    }


def settings() -> list[tuple[str, str, float, float | None]]:
    """Return (procedure, grade, seconds, placement) of all rows; no placement is the protocol's own."""
    rows: list[tuple[str, str, float, float | None]] = []
    for procedure in GROUPS:
        rows += [(procedure, grade, seconds, None) for grade in GRADES for seconds in SECONDS]
        if procedure != "modified-multi-position":
            rows += [(procedure, "tactical", USUAL, placement) for placement in PLACEMENTS]
    return rows


def simulate(runs: int, workers: int) -> None:
    """Simulate every setting `runs` times and write the medians."""
    jobs: list[Job] = [(*row, seed) for row in settings() for seed in range(runs)]
    with ProcessPoolExecutor(workers) as pool:
        outcomes = list(pool.map(one_run, jobs))
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["procedure", "grade", "seconds", "placement_deg", "runs", "group", "sigma"])
        for row in settings():
            mine = [o for o, job in zip(outcomes, jobs, strict=True) if job[:4] == row]
            procedure, grade, seconds, placement = row
            for group in GROUPS[procedure]:
                shown = "" if placement is None else placement
                value = f"{median(o[group] for o in mine):.3g}"
                writer.writerow([procedure, grade, seconds, shown, runs, group, value])


def read_table() -> list[dict[str, str]]:
    """Return the rows of the table of medians."""
    with TABLE.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def draw() -> None:
    """Write the figure: a panel a group of parameters, a line a grade, both axes logarithmic."""
    width, height, left, top = 300, 190, 62, 64
    title = "Stated standard uncertainty against the seconds of each hold and spin"
    parts = [
        *opening(3 * (width + left) + 16, 2 * (height + 62) + top, title),
        f'<text x="16" y="24" font-size="16" font-weight="600">{title}</text>',
    ]
    for i, (grade, colour) in enumerate(GRADES.items()):
        parts.append(f'<path d="M{16 + 170 * i} 42h26" stroke="{colour}" stroke-width="2.5"/>')
        parts.append(f'<text x="{48 + 170 * i}" y="46">{grade}</text>')
    rows = [row for row in read_table() if row["placement_deg"] == ""]
    for i, (procedure, group, short) in enumerate(DRAWN):
        label, factor, unit = GROUPS[procedure][group]
        points: dict[str, list[tuple[float, float]]] = {grade: [] for grade in GRADES}
        for row in rows:
            if (row["procedure"], row["group"]) == (procedure, group):
                points[row["grade"]].append((float(row["seconds"]), factor * float(row["sigma"])))
        x, y = left + (i // 2) * (width + left), top + 22 + (i % 2) * (height + 62)
        box = (x, y, width - 24, height)
        parts += panel(points, box, f"{short}: {label.lower()}, {unit}", "seconds", SECONDS)
    (FOLDER / "classical-uncertainty.svg").write_text("\n".join([*parts, "</svg>", ""]), encoding="utf-8")


def table_lines(procedure: str) -> list[str]:
    """Return the table of a procedure: by grade, and of the tactical grade by placement."""
    rows = [row for row in read_table() if row["procedure"] == procedure and float(row["seconds"]) == USUAL]
    placed = procedure != "modified-multi-position"
    heads = [*GRADES, *(f"tactical, {angle:g}°" for angle in PLACEMENTS if placed)]
    lines = ["| | " + " | ".join(heads) + " | unit |", "|---|" + "---:|" * len(heads) + "---|"]
    for group, (label, factor, unit) in GROUPS[procedure].items():
        mine = [row for row in rows if row["group"] == group]
        values = [next(r for r in mine if r["grade"] == g and not r["placement_deg"]) for g in GRADES]
        values += [r for r in mine if r["placement_deg"]]
        shown = " | ".join(rounded(factor * float(row["sigma"])) for row in values)
        lines.append(f"| {label} | {shown} | {unit} |")
    return lines


def write_tables() -> None:
    """Put the tables between their marks on the procedures' pages."""
    for procedure in GROUPS:
        page = FOLDER.parent / "procedures" / f"{procedure}.md"
        start, end = f"<!-- {procedure} -->", f"<!-- /{procedure} -->"
        before, _, rest = page.read_text(encoding="utf-8").partition(start)
        table = "\n".join([start, "", *table_lines(procedure), "", end])
        page.write_text(before + table + rest.partition(end)[2], encoding="utf-8")


def main() -> None:
    """Simulate unless told to draw only; then draw and write the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--draw", action="store_true", help="draw from the table as it is")
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    if not options.draw:
        simulate(options.runs, options.workers)
    draw()
    write_tables()


if __name__ == "__main__":
    main()
