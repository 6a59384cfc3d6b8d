"""What standard uncertainty to expect: simulated recordings, calibrated, and two figures of the outcome.

    python docs/figures/expected_uncertainty.py            # simulate (some minutes), then draw
    python docs/figures/expected_uncertainty.py --draw     # draw from expected-uncertainty.csv

For each grade, once with 26 poses and holds of 1.5 to 24 s, once with holds of 4 s and 10 to 52 poses,
units are drawn, tumbled by hand and calibrated with the hand-held procedure. Given is the median, over
runs and axes, of the standard uncertainty that the calibration states. Whether the stated ones hold is
another study: benchmarks/uncertainty.py.
"""

from __future__ import annotations

import argparse
import csv
import math
import os
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

FOLDER = Path(__file__).resolve().parent
TABLE = FOLDER / "expected-uncertainty.csv"
GRADES = {"consumer-mems": "#b3471b", "industrial-mems": "#1f6fb2", "tactical": "#2d7d46"}
SECONDS = (1.5, 3.0, 6.0, 12.0, 24.0)
POSES = (10, 14, 18, 26, 52)
USUAL_SECONDS, USUAL_POSES = 4.0, 26
# Start of the parameters' names -> (title, factor from SI, unit).
GROUPS = {
    "accelerometer bias": ("Accelerometer bias", 1e3, "mm/s²"),
    "accelerometer scale": ("Accelerometer scale", 1e6, "ppm"),
    "accelerometer non-orthogonality": ("Accelerometer non-orthogonality", 1e6, "µrad"),
    "gyro bias": ("Gyro bias", 1e6, "µrad/s"),
    "gyro scale": ("Gyro scale", 1e6, "ppm"),
    "gyro non-orthogonality": ("Gyro non-orthogonality", 1e6, "µrad"),
}


def chosen_poses(count: int):
    """Faces and four corners; faces and corners; faces and edges; all; all twice."""
    import numpy as np

    from tumble.simulation import poses_26

    faces, edges, corners = np.arange(6), np.arange(6, 18), np.arange(18, 26)
    four = corners[[0, 3, 5, 6]]  # no two of them opposite or neighbours
    every = np.arange(26)
    choice = {
        10: np.concatenate([faces, four]),
        14: np.concatenate([faces, corners]),
        18: np.concatenate([faces, edges]),
        26: every,
        52: np.concatenate([every, every]),
    }
    return poses_26()[choice[count]]


def one_run(job: tuple[str, float, int, int]) -> dict[str, float]:
    """Return the median stated uncertainty of each group of parameters in one simulated calibration."""
    import numpy as np
    from scipy.spatial.transform import Rotation

    from tumble.calibration import Session, calibrate, find_procedure
    from tumble.earth import Site
    from tumble.simulation import Motion, find_grade, simulate_recording

    grade, seconds, count, seed = job
    rng = np.random.default_rng([seed, count, round(10 * seconds)])
    site = Site.from_latitude(math.radians(48.0), 300.0)
    site = Site(site.gravity, 0.0, site.latitude, site.height, "simulated")
    off = Rotation.from_euler("xyz", rng.normal(0.0, 2.0, (count, 3)), degrees=True)
    headings = Rotation.from_rotvec(
        np.column_stack([np.zeros((count, 2)), rng.uniform(0.0, 2 * np.pi, count)])
    )
    poses = (headings * chosen_poses(count) * off)[rng.permutation(count)]
    motion = Motion.between_poses(
        poses, rng.uniform(0.8, 1.2, count) * seconds, rng.uniform(1.5, 3.0, count - 1)
    )
    recording, _ = simulate_recording(motion, 100.0, rng, site=site, grade=find_grade(grade))
    estimate = calibrate(Session(recording, given_site=site), find_procedure("hand-held"))
    return {
        group: float(
            np.median([p.standard_uncertainty for p in estimate.parameters if p.name.startswith(group)])
        )
        for group in GROUPS
    }


def simulate(runs: int, workers: int) -> None:
    """Simulate every setting `runs` times and write the medians."""
    from statistics import median

    settings = [(seconds, USUAL_POSES) for seconds in SECONDS] + [(USUAL_SECONDS, count) for count in POSES]
    jobs = [(g, s, n, seed) for g in GRADES for s, n in settings for seed in range(runs)]
    with ProcessPoolExecutor(workers) as pool:
        outcomes = list(pool.map(one_run, jobs, chunksize=2))
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["grade", "seconds", "poses", "runs", *GROUPS])
        for grade in GRADES:
            for setting in settings:
                mine = [o for o, job in zip(outcomes, jobs, strict=True) if job[:3] == (grade, *setting)]
                medians = [f"{median(o[group] for o in mine):.3g}" for group in GROUPS]
                writer.writerow([grade, setting[0], setting[1], runs, *medians])


Points = dict[str, list[tuple[float, float]]]


def read_table() -> list[dict[str, str]]:
    """Return the rows of the table of medians."""
    with TABLE.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def opening(width: int, height: int, title: str) -> list[str]:
    """Return the first lines of a figure on white ground."""
    style = 'font-family="system-ui, sans-serif" font-size="12" fill="#222"'
    return [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" {style}>',
        f"<title>{title}</title>",
        '<rect width="100%" height="100%" fill="#fff"/>',
    ]


def draw(name: str, title: str, axis: str, ticks: tuple[float, ...]) -> None:
    """Write one figure: a panel a group of parameters, a line a grade, both axes logarithmic."""
    rows, by_seconds = read_table(), axis.startswith("seconds")
    width, height, left, top = 300, 190, 62, 64
    parts = [
        *opening(3 * (width + left) + 16, 2 * (height + 62) + top, title),
        f'<text x="16" y="24" font-size="16" font-weight="600">{title}</text>',
    ]
    for i, (grade, colour) in enumerate(GRADES.items()):
        x = 16 + 170 * i
        parts.append(f'<path d="M{x} 42h26" stroke="{colour}" stroke-width="2.5"/>')
        parts.append(f'<text x="{x + 32}" y="46">{grade}</text>')
    for i, (group, (label, factor, unit)) in enumerate(GROUPS.items()):
        points: Points = {grade: [] for grade in GRADES}
        for row in rows:
            wanted = (
                int(row["poses"]) == USUAL_POSES if by_seconds else float(row["seconds"]) == USUAL_SECONDS
            )
            along = float(row["seconds"] if by_seconds else row["poses"])
            if wanted and along in ticks:
                points[row["grade"]].append((along, factor * float(row[group])))
        x, y = left + (i % 3) * (width + left), top + 22 + (i // 3) * (height + 62)
        parts += panel(points, (x, y, width - 24, height), f"{label}, {unit}", axis, ticks)
    (FOLDER / f"{name}.svg").write_text("\n".join([*parts, "</svg>", ""]), encoding="utf-8")


def panel(
    points: Points, box: tuple[int, int, int, int], title: str, axis: str, ticks: tuple[float, ...]
) -> list[str]:
    """Return the marks of one panel."""
    x0, y0, width, height = box
    values = [y for line in points.values() for _, y in line]
    low, high = math.log10(min(values)) - 0.08, math.log10(max(values)) + 0.08
    first, last = math.log10(min(ticks)), math.log10(max(ticks))

    def at(x: float, y: float) -> tuple[float, float]:
        along = (math.log10(x) - first) / (last - first)
        return x0 + 10 + along * (width - 20), y0 + height * (high - math.log10(y)) / (high - low)

    parts = [f'<text x="{x0 - 46}" y="{y0 - 8}" font-weight="600">{title}</text>']
    for tick in ticks:
        x, _ = at(tick, 10**low)
        parts.append(f'<path d="M{x:.1f} {y0}v{height}" stroke="#e4e4e4"/>')
        parts.append(f'<text x="{x:.1f}" y="{y0 + height + 16}" text-anchor="middle">{tick:g}</text>')
    for value in round_values(low, high):
        _, y = at(ticks[0], value)
        parts.append(f'<path d="M{x0} {y:.1f}h{width}" stroke="#e4e4e4"/>')
        parts.append(f'<text x="{x0 - 6}" y="{y + 4:.1f}" text-anchor="end">{value:g}</text>')
    for grade, line in points.items():
        path = "L".join(f"{x:.1f} {y:.1f}" for x, y in (at(*point) for point in sorted(line)))
        parts.append(f'<path d="M{path}" fill="none" stroke="{GRADES[grade]}" stroke-width="2"/>')
        for x, y in (at(*point) for point in line):
            parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{GRADES[grade]}"/>')
    parts.append(f'<path d="M{x0} {y0}v{height}h{width}" fill="none" stroke="#666"/>')
    parts.append(f'<text x="{x0 + width}" y="{y0 + height + 32}" text-anchor="end" fill="#555">{axis}</text>')
    return parts


def round_values(low: float, high: float) -> list[float]:
    """Return at least three round numbers between powers of ten, where there are so many."""
    found: list[float] = []
    for steps in ((1, 2, 5), (1, 1.5, 2, 3, 5, 7)):
        powers = range(math.floor(low), math.ceil(high) + 1)
        found = [step * 10.0**p for p in powers for step in steps if low <= p + math.log10(step) <= high]
        if len(found) >= 3:
            break
    return found


def write_tables() -> None:
    """Put the table of medians between its marks on the hand-held procedure's page."""
    page = FOLDER.parent / "procedures" / "hand-held.md"
    lines = ["| | " + " | ".join(GRADES) + " | unit |", "|---|" + "---:|" * len(GRADES) + "---|"]
    usual = [
        r for r in read_table() if (float(r["seconds"]), int(r["poses"])) == (USUAL_SECONDS, USUAL_POSES)
    ]
    for group, (label, factor, unit) in GROUPS.items():
        values = [factor * float(row[group]) for row in usual]
        lines.append(f"| {label} | " + " | ".join(f"{rounded(value)}" for value in values) + f" | {unit} |")
    start, end = "<!-- expected-uncertainty -->", "<!-- /expected-uncertainty -->"
    before, _, rest = page.read_text(encoding="utf-8").partition(start)
    table = "\n".join([start, "", *lines, "", end])
    page.write_text(before + table + rest.partition(end)[2], encoding="utf-8")


def rounded(value: float) -> str:
    """Return two figures without an exponent."""
    return f"{float(f'{value:.2g}'):g}"


def draw_motion() -> None:
    """Draw the motion in outline: holds and turns in time, and a face, an edge and a corner up."""
    title = "Rest 10 s, then turn and hold, pose by pose"
    parts = [
        *opening(760, 250, title),
        f'<text x="16" y="26" font-size="16" font-weight="600">{title}</text>',
    ]
    x, blocks = 16, [("rest 10 s", 130, 0), *[("turn", 40, 1), ("hold 4 s", 84, 0)] * 4, ("…", 30, 2)]
    for text, width, kind in blocks:
        if kind < 2:
            fill = ("#dcebf7", "#f6d9cb")[kind]
            y, height = (52, 34) if kind == 0 else (44, 50)
            parts.append(
                f'<rect x="{x}" y="{y}" width="{width - 3}" height="{height}" rx="3" fill="{fill}"/>'
            )
        parts.append(f'<text x="{x + width / 2 - 2}" y="73" text-anchor="middle">{text}</text>')
        x += width
    parts.append(
        '<text x="16" y="114" fill="#555">a turn takes 1 to 3 s and goes about an axis that lies level</text>'
    )
    poses = (
        ((0, 0, 1), "face: +z up"),
        ((0, 1, 1), "edge between +y and +z up"),
        ((1, 1, 1), "corner of +x, +y and +z up"),
    )
    for i, (up, text) in enumerate(poses):
        parts += cube(up, (120 + 240 * i, 182))
        parts.append(f'<text x="{120 + 240 * i}" y="242" text-anchor="middle">{text}</text>')
    (FOLDER / "motion.svg").write_text("\n".join([*parts, "</svg>", ""]), encoding="utf-8")


def cube(up: tuple[int, int, int], centre: tuple[int, int]) -> list[str]:
    """Return the visible faces of a cube whose direction `up` points up, seen from slightly above."""
    import numpy as np

    upward = np.array(up) / np.linalg.norm(up)
    # Chosen so that as many as possible of the faces that look up are seen.
    views = {
        1: ([1.0, 0.0, 0.0], 28.0, 28.0),
        2: ([1.0, 0.0, 0.0], 78.0, 28.0),
        3: ([1.0, -1.0, 0.0], 0.0, 58.0),
    }
    beside, *degrees = views[sum(up)]
    right = np.array(beside) / np.linalg.norm(beside)
    turn, tilt = np.radians(degrees)
    across = np.cos(turn) * right - np.sin(turn) * np.cross(upward, right)
    away = np.cross(upward, across)
    rows = np.array([across, np.cos(tilt) * upward + np.sin(tilt) * away])
    towards = np.cos(tilt) * -away + np.sin(tilt) * upward
    parts: list[str] = []
    names: list[str] = []
    for axis, sign in ((a, s) for a in range(3) for s in (1.0, -1.0)):
        normal = sign * np.eye(3)[axis]
        if normal @ towards <= 1e-9:
            continue
        first, second = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
        corners = [normal + a * first + b * second for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
        flat = [(centre[0] + 25 * (rows @ c)[0], centre[1] - 25 * (rows @ c)[1]) for c in corners]
        shade = 200 + round(45 * float(normal @ upward))
        outline = " ".join(f"{x:.1f},{y:.1f}" for x, y in flat)
        parts.append(
            f'<polygon points="{outline}" fill="rgb({shade - 14},{shade - 4},{shade})" stroke="#345"/>'
        )
        x, y = centre[0] + 25 * (rows @ normal)[0], centre[1] - 25 * (rows @ normal)[1]
        names.append(
            f'<text x="{x:.1f}" y="{y + 4:.1f}" text-anchor="middle">{"-+"[sign > 0]}{"xyz"[axis]}</text>'
        )
    return parts + names


def main() -> None:
    """Simulate if asked to, and draw both figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draw", action="store_true", help="draw only, from the table that is there")
    parser.add_argument("--runs", type=int, default=16)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    if not options.draw:
        simulate(options.runs, options.workers)
    seconds_title = f"Stated standard uncertainty against seconds per hold ({USUAL_POSES} poses, 100 Hz)"
    draw("uncertainty-by-seconds", seconds_title, "seconds per hold", SECONDS)
    draw_motion()
    write_tables()
    poses_title = (
        f"Stated standard uncertainty against number of poses (holds of {USUAL_SECONDS:g} s, 100 Hz)"
    )
    draw("uncertainty-by-poses", poses_title, "poses", tuple(float(n) for n in POSES))


if __name__ == "__main__":
    main()
