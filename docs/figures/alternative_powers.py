"""How large must a fault be to be found? Simulated, calibrated, and a figure of how often it is said or left out.

    python docs/figures/alternative_powers.py            # simulate (some minutes), then draw
    python docs/figures/alternative_powers.py --draw     # draw from alternative-powers.csv

Biases jump halfway, or fade with a fifth of the recording as time constant, on one axis of a unit that is turned by
hand (26 poses); and a rate table turns all spins, or one of them, otherwise than its protocol says.
"""

from __future__ import annotations

import argparse
import csv
import math
import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

FOLDER = Path(__file__).resolve().parent
TABLE = FOLDER / "alternative-powers.csv"
GRADES = {"consumer-mems": "#b3471b", "industrial-mems": "#1f6fb2", "tactical": "#2d7d46"}
TRIADS = ("accelerometers", "gyros")
SIZES = (0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # bias instabilities of the grade
SHARES = (0.0, 3e-4, 1e-3, 3e-3, 1e-2)
PANELS = {
    "jump": ("Biases jump halfway", "size over bias instability", SIZES),
    "fade": ("Biases fade", "size over bias instability", SIZES),
    "rates": ("A rate table", "share that its rates are off by", SHARES),
}
Job = tuple[str, str, str, float, int]


def is_found(job: Job) -> bool:
    """Whether a calibration names the fault."""
    import numpy as np

    from tumble.calibration import Session
    from tumble.earth import Site
    from tumble.protocol import SpinStep, named_protocol
    from tumble.simulation import find_grade, simulate_protocol
    from tumble.workflows import run_procedure

    fault, what, name, size, seed = job
    rng, grade = np.random.default_rng([seed, round(1e5 * size)]), find_grade(name)
    site = Site.from_latitude(math.radians(48.0), 300.0)
    on_table = fault == "rates"
    protocol = named_protocol("rate-table" if on_table else "multi-position-26")
    recording, _ = simulate_protocol(protocol, 20.0 if on_table else 100.0, rng, site=site, grade=grade)
    if on_table:
        spins = [k for k, step in enumerate(protocol.steps) if isinstance(step, SpinStep)]
        wrong = spins if what == "all" else [int(rng.choice(spins))]
        steps = [
            replace(s, rate=s.rate * (1.0 + size)) if k in wrong else s for k, s in enumerate(protocol.steps)
        ]
        protocol = replace(protocol, steps=tuple(steps))
    else:
        triad = grade.accelerometer if what == "accelerometers" else grade.gyroscope
        after = np.linspace(0.0, 1.0, len(recording.time))
        shape = 1.0 * (after > 0.5) if fault == "jump" else np.exp(-5.0 * after)
        added = np.outer(size * triad.noise.bias_instability * shape, np.eye(3)[int(rng.integers(3))])
        column = "specific_force" if what == "accelerometers" else "angular_rate"
        recording = replace(recording, **{column: getattr(recording, column) + added})
    estimate, _ = run_procedure(Session(recording, protocol, site), None if on_table else "hand-held")
    if on_table and any(left.kind == "spin" for left in estimate.left_out):
        return True
    words = ("turned", "spins", "rate that the protocol") if on_table else (f"biases of the {what}",)
    return any(word in said for said in (*estimate.objections, *estimate.cautions) for word in words)


def simulate(runs: int, workers: int) -> None:
    """Simulate every setting `runs` times and write how often the fault is found."""
    rows = [
        (fault, what, grade, size)
        for fault, (_, _, sizes) in PANELS.items()
        for what in (("all", "one") if fault == "rates" else TRIADS)
        for grade in GRADES
        for size in sizes
    ]
    with ProcessPoolExecutor(workers) as pool:
        found = list(pool.map(is_found, [(*row, seed) for row in rows for seed in range(runs)]))
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["fault", "what", "grade", "size", "runs", "found"])
        for k, row in enumerate(rows):
            writer.writerow([*row, runs, sum(found[k * runs : (k + 1) * runs])])


def draw() -> None:
    """Write the figure: a panel a fault, a colour a grade, dashes for gyros and for a single spin."""
    import matplotlib.pyplot as plt

    with TABLE.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    plt.rcParams["svg.hashsalt"], plt.rcParams["svg.fonttype"] = "tumble", "none"
    figure, axes = plt.subplots(1, 3, figsize=(10.5, 3.6), sharey=True, layout="constrained")
    for axis, (fault, (title, along, sizes)) in zip(axes, PANELS.items(), strict=True):
        for what, dashes in zip(("all", "one") if fault == "rates" else TRIADS, ("-", "--"), strict=True):
            for grade, colour in GRADES.items():
                mine = [r for r in rows if (r["fault"], r["what"], r["grade"]) == (fault, what, grade)]
                share = [100.0 * int(r["found"]) / int(r["runs"]) for r in mine]
                places = [float(r["size"]) or 0.5 * sizes[1] for r in mine]
                axis.plot(places, share, dashes, color=colour, marker=".")
        axis.set(title=title, xlabel=along, xscale="log", ylim=(-3, 103))
        axis.set_xticks([0.5 * sizes[1], *sizes[1:]], ["0", *(f"{size:g}" for size in sizes[1:])])
        axis.minorticks_off()
        axis.grid(color="#e4e4e4")
    axes[0].set_ylabel("found, %")
    for name, style in {
        **{grade: {"color": colour} for grade, colour in GRADES.items()},
        "accelerometers; all rates": {"color": "#222"},
        "gyros; the rate of one spin": {"color": "#222", "linestyle": "--"},
    }.items():
        axes[0].plot([], [], label=name, **style)
    figure.legend(loc="outside lower center", ncols=5, frameon=False)
    figure.savefig(FOLDER / "alternative-powers.svg", metadata={"Date": None})


def main() -> None:
    """Simulate unless told to draw only; then draw."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--draw", action="store_true", help="draw from the table as it is")
    parser.add_argument("--runs", type=int, default=12)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    if not options.draw:
        simulate(options.runs, options.workers)
    draw()


if __name__ == "__main__":
    main()
