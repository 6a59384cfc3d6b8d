"""What uncertainty to expect of the strapdown rotation test: simulated, calibrated, a figure and a table.

    python docs/figures/strapdown_uncertainty.py            # simulate (some minutes), then draw
    python docs/figures/strapdown_uncertainty.py --draw     # draw from strapdown-uncertainty.csv

All sequences of Savage's table 1 are played by units of four grades on a fixture that is off by 1 mrad in
every way, with rests of 3, 6 and 10 s before and after. Given is the median, over runs and axes, of the
standard uncertainty that the calibration states.
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
import expected_uncertainty  # noqa: E402
from expected_uncertainty import opening, panel, rounded  # noqa: E402

TABLE = FOLDER / "strapdown-uncertainty.csv"
GRADES = {**expected_uncertainty.GRADES, "ring-laser": "#7a4fa3"}
SECONDS, USUAL = (3.0, 6.0, 10.0), 10.0
RUNS = 5
FIXTURE = 1e-3  # rad
# Start of the parameters' names -> (title, factor from SI, unit).
GROUPS = {
    "gyro scale": ("Gyro scale", 1e6, "ppm"),
    "gyro asymmetry": ("Gyro asymmetry", 1e6, "ppm"),
    "gyro non-orthogonality": ("Gyro non-orthogonality", 1e6, "µrad"),
    "gyro bias": ("Gyro bias", 3600.0 * 180.0 / math.pi, "°/h"),
    "accelerometer bias": ("Accelerometer bias", 1e6, "µm/s²"),
    "accelerometer scale": ("Accelerometer scale", 1e6, "ppm"),
    "accelerometer asymmetry": ("Accelerometer asymmetry", 1e6, "ppm"),
    "accelerometer misalignment": ("Accelerometer misalignment", 1e6, "µrad"),
}
DRAWN = ("gyro scale", "gyro non-orthogonality", "accelerometer bias", "accelerometer misalignment")
Job = tuple[str, float, int]


def one_run(job: Job) -> dict[str, float]:
    """Return the median stated uncertainty of each group of parameters in one simulated calibration."""
    from dataclasses import replace

    import numpy as np

    from tumble.calibration import Session
    from tumble.earth import Site
    from tumble.protocol import HoldStep, named_protocol
    from tumble.simulation import FixtureErrors, find_grade, simulate_protocol
    from tumble.workflows import run_procedure

    grade, seconds, seed = job
    rng = np.random.default_rng([seed, round(seconds)])
    site = Site.from_latitude(math.radians(48.0), 300.0)
    site = Site(site.gravity, 0.0, site.latitude, site.height, "simulated")
    protocol = named_protocol("strapdown-rotation")
    steps = [
        replace(step, duration=seconds) if isinstance(step, HoldStep) else step for step in protocol.steps
    ]
    protocol = replace(protocol, steps=tuple(steps))
    fixture = FixtureErrors(
        FIXTURE, (FIXTURE, FIXTURE), FIXTURE, FIXTURE, FIXTURE, (FIXTURE, FIXTURE, FIXTURE), FIXTURE
    ).drawn(rng)
    recording, _ = simulate_protocol(
        protocol, 100.0, rng, site=site, grade=find_grade(grade), fixture=fixture
    )
    estimate, _ = run_procedure(Session(recording, protocol, site), None)
    return {
        group: median(p.standard_uncertainty for p in estimate.parameters if p.name.startswith(group))
        for group in GROUPS
    }


def simulate(runs: int, workers: int) -> None:
    """Simulate every setting `runs` times and write the medians."""
    settings = [(grade, seconds) for grade in GRADES for seconds in SECONDS]
    jobs: list[Job] = [(*setting, seed) for setting in settings for seed in range(runs)]
    with ProcessPoolExecutor(workers) as pool:
        outcomes = list(pool.map(one_run, jobs))
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["grade", "seconds", "runs", "group", "sigma"])
        for setting in settings:
            mine = [o for o, job in zip(outcomes, jobs, strict=True) if job[:2] == setting]
            for group in GROUPS:
                writer.writerow([*setting, runs, group, f"{median(o[group] for o in mine):.3g}"])


def read_table() -> list[dict[str, str]]:
    """Return the rows of the table of medians."""
    with TABLE.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def draw() -> None:
    """Write the figure: a panel a group of parameters, a line a grade, both axes logarithmic."""
    expected_uncertainty.GRADES.update(GRADES)
    width, height, left, top = 300, 190, 62, 64
    title = "Stated standard uncertainty against the seconds at rest"
    parts = [
        *opening(2 * (width + left) + 16, 2 * (height + 62) + top, title),
        f'<text x="16" y="24" font-size="16" font-weight="600">{title}</text>',
    ]
    for i, (grade, colour) in enumerate(GRADES.items()):
        parts.append(f'<path d="M{16 + 170 * i} 42h26" stroke="{colour}" stroke-width="2.5"/>')
        parts.append(f'<text x="{48 + 170 * i}" y="46">{grade}</text>')
    for i, group in enumerate(DRAWN):
        label, factor, unit = GROUPS[group]
        points: dict[str, list[tuple[float, float]]] = {grade: [] for grade in GRADES}
        for row in read_table():
            if row["group"] == group:
                points[row["grade"]].append((float(row["seconds"]), factor * float(row["sigma"])))
        x, y = left + (i // 2) * (width + left), top + 22 + (i % 2) * (height + 62)
        parts += panel(points, (x, y, width - 24, height), f"{label}, {unit}", "seconds", SECONDS)
    (FOLDER / "strapdown-uncertainty.svg").write_text("\n".join([*parts, "</svg>", ""]), encoding="utf-8")


def value(grade: str, seconds: float, group: str) -> str:
    """Return a median from the table as the page prints it."""
    for row in read_table():
        if (row["grade"], float(row["seconds"]), row["group"]) == (grade, seconds, group):
            return rounded(GROUPS[group][1] * float(row["sigma"]))
    raise KeyError((grade, seconds, group))


def write_table() -> None:
    """Put the table between its marks on the procedure's page."""
    columns = [*((grade, USUAL, grade) for grade in GRADES), ("tactical", SECONDS[0], "tactical, 3 s")]
    lines = [
        "| | " + " | ".join(head for *_, head in columns) + " | unit |",
        "|---|" + "---:|" * len(columns) + "---|",
    ]
    for group, (label, _, unit) in GROUPS.items():
        cells = " | ".join(value(grade, seconds, group) for grade, seconds, _ in columns)
        lines.append(f"| {label} | {cells} | {unit} |")
    page = FOLDER.parent / "procedures" / "strapdown-rotation.md"
    start, end = "<!-- strapdown-rotation -->", "<!-- /strapdown-rotation -->"
    before, _, rest = page.read_text(encoding="utf-8").partition(start)
    page.write_text(
        before + "\n".join([start, "", *lines, "", end]) + rest.partition(end)[2], encoding="utf-8"
    )


def main() -> None:
    """Simulate unless told to draw only; then draw and write the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--draw", action="store_true", help="draw from the table as it is")
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    if not options.draw:
        simulate(options.runs, options.workers)
    draw()
    write_table()


if __name__ == "__main__":
    main()
