"""What a turntable's errors do to a calibration without noise: a table on the procedure's page.

    python docs/figures/turntable_errors.py

Protocol turntable-9 in full at 20 Hz; a unit without noise, placed within what the protocol
allows; the median over five tables of the largest error.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from statistics import median

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

FOLDER = Path(__file__).resolve().parent
ARC_SECOND = np.pi / 648000.0
RUNS = 5
CASES = {
    "nothing": {},
    "each angle off by 2″": {"angle_sigma": 2.0 * ARC_SECOND},
    "10″ once a revolution": {"once": 10.0 * ARC_SECOND},
    "10″ twice a revolution": {"twice": 10.0 * ARC_SECOND},
    "ramps uneven by 30 %": {"ramp_spread": 0.3},
    "rate ripples by 0.2 %": {"ripple": 2e-3},
    "axis leans by 1°": {"axis_tilt": np.radians(1.0)},
    "axis wobbles by 20″": {"wobble": 20.0 * ARC_SECOND},
}
HEADS = ("gyro scale, ppm", "gyro angles, ″", "gyro bias, °/h", "between the triads, ″")


def errors(name: str, case: dict[str, float], seed: int) -> list[float]:
    """Return the largest error of each kind in one calibration."""
    from tumble.calibration import Session
    from tumble.earth import Site
    from tumble.protocol import named_protocol
    from tumble.sensor import ImuModel, Triad, change_frame
    from tumble.simulation import TableErrors, simulate_protocol
    from tumble.workflows import run_procedure

    rng = np.random.default_rng(seed)
    model = ImuModel(
        Triad(np.eye(3) + rng.normal(0.0, 1e-3, (3, 3)), rng.normal(0.0, 0.01, 3)),
        Triad(np.eye(3) + rng.normal(0.0, 1e-3, (3, 3)), rng.normal(0.0, 1e-5, 3)),
    )
    site = Site.from_latitude(np.radians(48.0), 300.0)
    protocol = replace(named_protocol(name), site=site)
    table = TableErrors(**{"angle_sigma": 0.0, **case})
    recording, _ = simulate_protocol(
        protocol, 20.0, rng, site=site, model=model, table=table, placement=name != "laboratory"
    )
    estimate, _ = run_procedure(Session(recording, protocol, site), None)
    true = model if estimate.frame == "fixture" else change_frame(model, "accelerometer-x")
    own, known = estimate.model.gyroscope.matrix, true.gyroscope.matrix
    off = np.linalg.solve(known, own) - np.eye(3)
    turn = 0.5 * np.array([off[2, 1] - off[1, 2], off[0, 2] - off[2, 0], off[1, 0] - off[0, 1]])
    sheared = 0.5 * (off + off.T) - np.diag(np.diag(off))
    bias = estimate.model.gyroscope.bias - true.gyroscope.bias
    return [
        1e6 * float(np.max(np.abs(np.diag(off)))),
        2.0 * float(np.max(np.abs(sheared))) / ARC_SECOND,
        float(np.max(np.abs(bias))) * 3600.0 * 180.0 / np.pi,
        float(np.max(np.abs(turn))) / ARC_SECOND,
    ]


def table_lines(name: str) -> list[str]:
    """Return the table of a protocol."""
    lines = [f"| {name} | " + " | ".join(HEADS) + " |", "|---|" + "---:|" * len(HEADS)]
    for label, case in CASES.items():
        runs = [errors(name, case, seed) for seed in range(RUNS if case else 1)]
        cells = [f"{float(f'{median(run[k] for run in runs):.2g}'):g}" for k in range(len(HEADS))]
        lines.append(f"| {label} | " + " | ".join("0" if float(c) < 1e-4 else c for c in cells) + " |")
    return lines


def main() -> None:
    """Put the table between its marks on the page."""
    page = FOLDER.parent / "procedures" / "turntable.md"
    before, _, rest = page.read_text(encoding="utf-8").partition("<!-- errors -->")
    block = "\n".join(["<!-- errors -->", "", *table_lines("turntable-9"), "", "<!-- /errors -->"])
    page.write_text(before + block + rest.partition("<!-- /errors -->")[2], encoding="utf-8")


if __name__ == "__main__":
    main()
