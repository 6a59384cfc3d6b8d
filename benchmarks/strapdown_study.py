"""Savage's rotation test simulated 200 times, beside drawing its random numbers; its attitude loop beside a bare one.

    python benchmarks/strapdown_study.py

All 17 sequences of table 1 with 10 s at rest before and after at 100 Hz: the raw increments of 200 units, and
three play-backs of each. Against it numpy's drawing of as many normal numbers with the same generator and nothing
else, into an array that stays in the cache. Then the loop that carries the attitude through a sequence and averages
the specific force in it, a sample, beside a loop that composes quaternions and nothing else, and beside the better
of that loop's two compilations.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from collections.abc import Callable

import numba
import numpy as np

from tumble.attitude.kernels import transform_sequence
from tumble_papers.savage.strapdown_simulation import GRADES, START_NORM, Setting, run_study, simulate_run

RUNS = 200
SAMPLES = 4_000


def best(function: Callable[[], object], repeats: int = 3) -> float:
    """Return the least of several timings, s: what the machine can do when nobody else is on it."""
    function()
    seconds: list[float] = []
    for _ in range(repeats):
        started = time.perf_counter()
        function()
        seconds.append(time.perf_counter() - started)
    return min(seconds)


def generator() -> np.random.Generator:
    """Return the generator of the studies."""
    return np.random.Generator(np.random.SFC64(1))


def draw_piece_by_piece(count: int, buffer: np.ndarray) -> None:
    """Draw `count` normal numbers into the same small array again and again."""
    rng = generator()
    for _ in range(count // buffer.size):
        rng.standard_normal(out=buffer)


def compose(rate: np.ndarray, step: float, out: np.ndarray) -> None:
    """Compose quaternions of constant rate over each step: the least that any integrator does."""
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    for i in range(rate.shape[0]):
        p, q, r = 0.5 * step * rate[i, 0], 0.5 * step * rate[i, 1], 0.5 * step * rate[i, 2]
        s = p * p + q * q + r * r
        c, k = 1.0 - s / 2.0 * (1.0 - s / 12.0), 1.0 - s / 6.0 * (1.0 - s / 20.0)
        p, q, r = k * p, k * q, k * r
        w, x, y, z = (
            w * c - x * p - y * q - z * r,
            w * p + x * c + y * r - z * q,
            w * q - x * r + y * c + z * p,
            w * r + x * q - y * p + z * c,
        )
    out[0], out[1], out[2], out[3] = w, x, y, z


def study() -> None:
    """Print what the study takes beside its random numbers."""
    setting = Setting(GRADES["nav"])
    turning = len(simulate_run(setting, generator()).rate) - 2 * len(setting.sequences) * setting.window
    count = RUNS * (3 * turning + 2 * len(setting.sequences) * setting.window * 6)
    buffer = np.empty(36_000)
    streams = generator().spawn(RUNS)
    drawing = best(lambda: draw_piece_by_piece(count, buffer))
    print(f"numpy draws {count} normal numbers, nothing else: {drawing:.2f} s")
    seconds = best(lambda: [simulate_run(setting, stream) for stream in streams])
    print(f"raw increments of {RUNS} units, 1 thread: {seconds:.2f} s, ratio {seconds / drawing:.2f}")
    for threads in (1, 2):
        seconds = best(
            lambda threads=threads: run_study(setting, (START_NORM,), RUNS, generator(), threads=threads)
        )
        print(f"with three play-backs, {threads} thread: {seconds:.2f} s, ratio {seconds / drawing:.2f}")


def integration() -> None:
    """Print what a sample takes of the attitude, beside loops that do nothing else."""
    rng = np.random.default_rng(1)
    rate = np.ascontiguousarray(rng.normal(0.0, 1.0, (SAMPLES, 3)))
    force = np.ascontiguousarray(rng.normal(0.0, 9.8, (SAMPLES, 3)))
    weights, earth, averages, C, out = (
        np.full(1000, 1e-3),
        np.full(3, 4e-5),
        np.zeros((2, 3)),
        np.eye(3),
        np.zeros(4),
    )
    many = range(200)
    strict = numba.njit(compose)
    contracted = numba.njit(fastmath={"contract", "arcp", "nsz"})(compose)

    def ours(size: int) -> None:
        for _ in many:
            transform_sequence(
                rate, force, 0.01, earth, weights[:size], 0, weights[:size], SAMPLES - size, averages, C
            )

    samples = len(many) * SAMPLES
    timings = {
        "a sequence with two averages over a quarter of it each": best(lambda: ours(1000), 9),
        "the same with averages over a sample each": best(lambda: ours(1), 9),
        "bare loop of benchmarks/kernels.py": best(lambda: [strict(rate, 0.01, out) for _ in many], 9),
        "the same with contracted operations": best(lambda: [contracted(rate, 0.01, out) for _ in many], 9),
    }
    bare = timings["bare loop of benchmarks/kernels.py"]
    least = min(list(timings.values())[2:])
    print("attitude through a sequence, ns a sample, over the bare loop, over the better of the two")
    for name, seconds in timings.items():
        print(f"  {name:<56}{1e9 * seconds / samples:8.1f}{seconds / bare:8.2f}{seconds / least:8.2f}")


if __name__ == "__main__":
    study()
    integration()
