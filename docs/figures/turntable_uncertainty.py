"""What uncertainty to expect of a turntable, without alignment and with: simulated, calibrated, a figure and tables.

    python docs/figures/turntable_uncertainty.py            # simulate (some minutes), then draw
    python docs/figures/turntable_uncertainty.py --draw     # draw from turntable-uncertainty.csv

The protocols turntable-9, turntable-18 and laboratory are played by units of four grades, with the holds
made 10, 30 and 100 s long and the rotations one, two and five revolutions; once more in full by the
tactical grade, with a table whose angles (and, in the laboratory, attitudes) are better and worse. Given
is the median, over runs and axes, of the standard uncertainty that the calibration states.
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

TABLE = FOLDER / "turntable-uncertainty.csv"
GRADES = {**expected_uncertainty.GRADES, "ring-laser": "#7a4fa3"}
# Seconds of a hold -> revolutions of a rotation.
REVOLUTIONS = {10.0: 1, 30.0: 2, 100.0: 5}
SECONDS, USUAL = tuple(REVOLUTIONS), 100.0
TABLES = (0.0, 2.0, 10.0, 60.0)  # arc seconds
OWN_TABLE = 2.0
RUNS = 5
ARC_SECOND = math.pi / 648000.0
ACCELEROMETER = {
    "accelerometer bias": ("Accelerometer bias", 1e6, "µm/s²"),
    "accelerometer scale": ("Accelerometer scale", 1e6, "ppm"),
}
GYRO = {
    "gyro bias": ("Gyro bias", 3600.0 * 180.0 / math.pi, "°/h"),
    "gyro scale": ("Gyro scale", 1e6, "ppm"),
}
# Start of the parameters' names -> (title, factor from SI, unit), by protocol.
UNALIGNED = {
    **ACCELEROMETER,
    "accelerometer non-orthogonality": ("Accelerometer non-orthogonality", 1.0 / ARC_SECOND, "″"),
    **GYRO,
    "gyro non-orthogonality": ("Gyro non-orthogonality", 1.0 / ARC_SECOND, "″"),
    "rotation between": ("Rotation between the triads", 1.0 / ARC_SECOND, "″"),
}
GROUPS = {
    "turntable-9": UNALIGNED,
    "turntable-18": UNALIGNED,
    "laboratory": {
        **ACCELEROMETER,
        "accelerometer misalignment": ("Accelerometer misalignment", 1.0 / ARC_SECOND, "″"),
        **GYRO,
        "gyro misalignment": ("Gyro misalignment", 1.0 / ARC_SECOND, "″"),
    },
}
DRAWN = (
    ("turntable-9", "accelerometer scale"),
    ("turntable-9", "accelerometer non-orthogonality"),
    ("turntable-9", "gyro scale"),
    ("turntable-9", "rotation between"),
    ("turntable-9", "gyro bias"),
    ("laboratory", "gyro misalignment"),
)
Job = tuple[str, str, float, float, int]


def changed_protocol(name: str, seconds: float, table: float):
    """Return the protocol with holds of `seconds`, rotations to match, and a table of `table` arc seconds."""
    from dataclasses import replace

    from tumble.protocol import HoldStep, SpinStep, named_protocol

    angle, sigma = 2.0 * math.pi * REVOLUTIONS[seconds], table * ARC_SECOND

    def changed(step):
        if isinstance(step, SpinStep):
            sign = math.copysign(1.0, step.rate)
            duration = angle / abs(step.rate) - step.ramp
            return replace(step, duration=duration, angle=sign * angle, angle_sigma=sigma)
        if not isinstance(step, HoldStep):
            return step
        pose = replace(step.pose, sigma=sigma) if name == "laboratory" else step.pose
        return replace(step, duration=min(seconds, step.duration), pose=pose)

    protocol = named_protocol(name)
    return replace(protocol, steps=tuple(changed(step) for step in protocol.steps))


def one_run(job: Job) -> dict[str, float]:
    """Return the median stated uncertainty of each group of parameters in one simulated calibration."""
    import numpy as np

    from tumble.calibration import Session
    from tumble.earth import Site
    from tumble.simulation import find_grade, simulate_protocol
    from tumble.workflows import run_procedure

    name, grade, seconds, table, seed = job
    rng = np.random.default_rng([seed, round(seconds), round(table)])
    site = Site.from_latitude(math.radians(48.0), 300.0)
    site = Site(site.gravity, 0.0, site.latitude, site.height, "simulated")
    protocol = changed_protocol(name, seconds, table)
    recording, _ = simulate_protocol(protocol, 100.0, rng, site=site, grade=find_grade(grade))
    estimate, _ = run_procedure(Session(recording, protocol, site), None)
    return {
        group: median(p.standard_uncertainty for p in estimate.parameters if p.name.startswith(group))
        for group in GROUPS[name]
    }


def settings() -> list[tuple[str, str, float, float]]:
    """Return (protocol, grade, seconds, arc seconds of the table) of all rows."""
    rows: list[tuple[str, str, float, float]] = []
    for name in GROUPS:
        rows += [
            (name, grade, seconds, OWN_TABLE)
            for grade in GRADES
            for seconds in (SECONDS if name != "turntable-18" else (USUAL,))
        ]
        if name != "turntable-18":
            rows += [(name, "tactical", USUAL, table) for table in TABLES if table != OWN_TABLE]
    return rows


def simulate(runs: int, workers: int) -> None:
    """Simulate every setting `runs` times and write the medians."""
    jobs: list[Job] = [(*row, seed) for row in settings() for seed in range(runs)]
    with ProcessPoolExecutor(workers) as pool:
        outcomes = list(pool.map(one_run, jobs))
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["protocol", "grade", "seconds", "table_arcsec", "runs", "group", "sigma"])
        for row in settings():
            mine = [o for o, job in zip(outcomes, jobs, strict=True) if job[:4] == row]
            for group in GROUPS[row[0]]:
                writer.writerow([*row, runs, group, f"{median(o[group] for o in mine):.3g}"])


def read_table() -> list[dict[str, str]]:
    """Return the rows of the table of medians."""
    with TABLE.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def draw() -> None:
    """Write the figure: a panel a group of parameters, a line a grade, both axes logarithmic."""
    expected_uncertainty.GRADES.update(GRADES)
    width, height, left, top = 300, 190, 62, 64
    title = "Stated standard uncertainty against the seconds of each hold, table of 2″"
    parts = [
        *opening(3 * (width + left) + 16, 2 * (height + 62) + top, title),
        f'<text x="16" y="24" font-size="16" font-weight="600">{title}</text>',
    ]
    for i, (grade, colour) in enumerate(GRADES.items()):
        parts.append(f'<path d="M{16 + 170 * i} 42h26" stroke="{colour}" stroke-width="2.5"/>')
        parts.append(f'<text x="{48 + 170 * i}" y="46">{grade}</text>')
    for i, (name, group) in enumerate(DRAWN):
        label, factor, unit = GROUPS[name][group]
        points: dict[str, list[tuple[float, float]]] = {grade: [] for grade in GRADES}
        for row in read_table():
            if (row["protocol"], row["group"]) == (name, group) and float(row["table_arcsec"]) == OWN_TABLE:
                points[row["grade"]].append((float(row["seconds"]), factor * float(row["sigma"])))
        x, y = left + (i // 2) * (width + left), top + 22 + (i % 2) * (height + 62)
        box = (x, y, width - 24, height)
        parts += panel(points, box, f"{name}: {label.lower()}, {unit}", "seconds", SECONDS)
    (FOLDER / "turntable-uncertainty.svg").write_text("\n".join([*parts, "</svg>", ""]), encoding="utf-8")


def value(name: str, grade: str, seconds: float, table: float, group: str) -> str:
    """Return a median from the table as the pages print it."""
    for row in read_table():
        setting = (row["protocol"], row["grade"], float(row["seconds"]), float(row["table_arcsec"]))
        if setting == (name, grade, seconds, table) and row["group"] == group:
            return rounded(GROUPS[name][group][1] * float(row["sigma"]))
    raise KeyError((name, grade, seconds, table, group))


def by_grade(name: str) -> list[str]:
    """Return the table of a protocol: every grade at the usual length, tactical also shorter."""
    columns = [
        *((grade, USUAL, grade) for grade in GRADES),
        *(("tactical", seconds, f"tactical, {seconds:g} s") for seconds in SECONDS if seconds != USUAL),
    ]
    if name == "turntable-18":
        columns = columns[: len(GRADES)]
    lines = [
        "| | " + " | ".join(head for *_, head in columns) + " | unit |",
        "|---|" + "---:|" * len(columns) + "---|",
    ]
    for group, (label, _, unit) in GROUPS[name].items():
        cells = [value(name, grade, seconds, OWN_TABLE, group) for grade, seconds, _ in columns]
        lines.append(f"| {label} | {' | '.join(cells)} | {unit} |")
    return lines


def write_tables() -> None:
    """Put the tables between their marks on the procedures' pages."""
    tables = {
        "turntable": {
            "turntable-9": by_grade("turntable-9"),
        },
        "laboratory": {
            "laboratory": by_grade("laboratory"),
        },
    }
    for page_name, mine in tables.items():
        page = FOLDER.parent / "procedures" / f"{page_name}.md"
        text = page.read_text(encoding="utf-8")
        for mark, lines in mine.items():
            start, end = f"<!-- {mark} -->", f"<!-- /{mark} -->"
            before, _, rest = text.partition(start)
            text = before + "\n".join([start, "", *lines, "", end]) + rest.partition(end)[2]
        page.write_text(text, encoding="utf-8")


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
