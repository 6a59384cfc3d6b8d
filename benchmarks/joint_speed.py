"""How long the joint estimator takes: an hour at 200 Hz with 60 holds and 60 turns, and more of them.

    python benchmarks/joint_speed.py
    python benchmarks/joint_speed.py --segments 120 300 600 1200

A unit is held and turned by turns; noise is white. Printed for each number of holds and turns: samples, processor
seconds of the solver (gathering, adjusting with variance components, everything but reading and the search for
holds), of one linearisation of all equations, iterations' worth of them, and the largest memory of the process
above what it had with the samples in it, over the samples' size in binary (seven doubles each).
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import time
import tracemalloc

import numpy as np
from scipy.spatial.transform import Rotation

from tumble.calibration import balance_recording, gather, imu_unknowns, observe, start_adjustment, unknowns_of
from tumble.earth import Site
from tumble.estimation import linearise
from tumble.segmentation import Hold, NoiseFloor, Timeline, Turn, observe_holds
from tumble.sensor import ImuModel, Triad
from tumble.simulation import Motion, simulate_recording
from tumble_papers.hayal import adjust_norms

SITE = Site(9.81, 0.0, float(np.radians(48.0)), 300.0, "as simulated")
MODEL = ImuModel(
    Triad(np.array([[1.02, 0.0, 0.0], [-0.011, 0.98, 0.0], [0.031, -0.019, 1.05]]), np.array([0.11, -0.23, 0.31])),
    Triad(
        np.array([[0.99, 0.021, -0.033], [-0.014, 1.03, 0.026], [0.037, -0.018, 0.97]]),
        np.array([0.021, -0.013, 0.034]),
    ),
)  # fmt: skip


def scene(holds: int, hold: float, turn: float, rate: float, noise: tuple[float, float]):
    """Return a recording with its holds and turns as they were commanded."""
    rng = np.random.default_rng(1)
    motion = Motion.between_poses(Rotation.random(holds, rng), np.full(holds, hold), np.full(holds - 1, turn))
    recording, _ = simulate_recording(motion, rate, rng, site=SITE, distort=MODEL.distort)
    recording.specific_force[:] += noise[0] * rng.standard_normal(recording.specific_force.shape)
    recording.angular_rate[:] += noise[1] * rng.standard_normal(recording.angular_rate.shape)
    still, both = round(hold * rate), round((hold + turn) * rate)
    found = tuple(Hold(both * k + 2, both * k + still - 2) for k in range(holds))
    turns = tuple(Turn(k, k + 1, found[k].stop, found[k + 1].start) for k in range(holds - 1))
    floor = NoiseFloor(np.full(3, noise[0]), np.full(3, noise[1]), 1.0, "as simulated")
    timeline = Timeline(found, turns, (), floor)
    return recording, timeline, observe_holds(recording, timeline)


def measure(holds: int, hold: float, turn: float, rate: float) -> None:
    """Print one row."""
    recording, timeline, means = scene(holds, hold, turn, rate, (0.01, 1e-3))

    def solve():
        u = imu_unknowns(unknowns_of(MODEL))
        u["gyro.matrix"][:] += 1e-3
        task = start_adjustment(observe(gather(recording, timeline, means), u), u, SITE)
        return task, balance_recording(task)

    task, _ = solve()
    started = time.process_time()
    solve()
    whole = time.process_time() - started
    started = time.process_time()
    for _ in range(3):
        linearise(task)
    once = (time.process_time() - started) / 3.0
    tracemalloc.start()
    solve()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    samples = recording.time.size
    print(
        f"{2 * holds:9d}{samples:10d}{whole:12.2f} s{1e3 * once:14.1f} ms{whole / once:10.0f}"
        f"{(peak + 56 * samples) / (56 * samples):12.2f}",
        flush=True,
    )


def nine_parameters(sets: int = 20000) -> None:
    """Print what a nine-parameter solve costs within a Monte Carlo loop."""
    rng = np.random.default_rng(2)
    forces = 9.81 * Rotation.random(26, rng).as_matrix()[:, 2]
    raw = forces @ MODEL.accelerometer.matrix.T + MODEL.accelerometer.bias
    many = raw + 1e-3 * rng.standard_normal((sets, *raw.shape))
    adjust_norms(many[:10], 1e-3, 9.81)
    started = time.process_time()
    adjust_norms(many, 1e-3, 9.81)
    print(f"nine parameters from 26 poses: {1e6 * (time.process_time() - started) / sets:.1f} µs a solve")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--segments", type=int, nargs="*", default=[])
    asked = parser.parse_args()
    print(f"{'segments':>9s}{'samples':>10s}{'solver':>14s}{'linearise':>17s}{'ratio':>10s}{'memory':>12s}")
    if not asked.segments:
        measure(60, 55.0, 5.0, 200.0)
        nine_parameters()
    for segments in asked.segments:
        measure(segments // 2, 4.0, 2.0, 50.0)


if __name__ == "__main__":
    main()
