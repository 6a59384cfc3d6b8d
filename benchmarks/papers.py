"""The papers' studies beside drawing their random numbers, in one run, and what their loops are held against.

    python benchmarks/papers.py

Hayal's table 4.5: 500 runs with every sample drawn, attitudes, means and adjustments included; one adjustment beside
scipy's `least_squares`. Savage's rotation test: raw increments of 200 units in all 17 sequences, three play-backs of
each; its attitude loop beside the bare one of `kernels.py`. Zhang's table 3: 500 calibrations from raw samples by one
thread and by two, and by sufficient statistics. The papers' figures themselves: `tumble reproduce`.
"""

from __future__ import annotations

import numba
import numpy as np
from kernels import bare
from scipy.optimize import least_squares
from timing import best, draw_piece_by_piece, generator

from tumble.attitude import transform_sequence
from tumble.sensor import matrix_from_shin
from tumble_papers.hayal import adjust_norms, run_setting, simulate_means, table_setting as norm_setting
from tumble_papers.savage import GRADES, START_NORM, Setting as RotationTest, run_study, simulate_run
from tumble_papers.zhang import evaluate, simulate, table_setting

RUNS, UNITS, LENGTH = 500, 200, 4_000
NORMS, TURNTABLE = norm_setting("4.5", 2), table_setting("3")


def solve_with_scipy(means: np.ndarray) -> np.ndarray:
    """Minimise the sum of (|true| - K)² over the nine parameters."""

    def residual(values: np.ndarray) -> np.ndarray:
        matrix = np.real(matrix_from_shin(values[3:6], values[6:9]))
        true = np.linalg.solve(matrix, (means - values[:3]).T)
        return np.linalg.norm(true, axis=0) - NORMS.reference

    start = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    return least_squares(residual, start, x_scale="jac").x


def norms() -> None:
    """Print the times of Hayal's study, and how far the two solutions are apart."""
    each = NORMS.attitudes * NORMS.samples * 3
    count = RUNS * each
    study = best(lambda: run_setting(NORMS, RUNS, generator()))
    drawing = best(lambda: generator().standard_normal(count))
    buffer = np.empty(each)
    pieces = best(lambda: draw_piece_by_piece(count, buffer))
    print(f"{RUNS} runs of table 4.5, {count} samples drawn: {1e3 * study:.1f} ms")
    print(
        f"numpy draws {count} normal numbers, nothing else: {1e3 * drawing:.1f} ms, ratio {study / drawing:.2f}"
    )
    print(f"the same piece by piece: {1e3 * pieces:.1f} ms, ratio {study / pieces:.2f}")
    means = simulate_means(NORMS, RUNS, generator())
    sigma = NORMS.noise / np.sqrt(NORMS.samples)
    ours = best(lambda: adjust_norms(means, sigma, NORMS.reference)) / RUNS
    scipys = best(lambda: [solve_with_scipy(one) for one in means[:20]]) / 20
    print(
        f"one adjustment: {1e6 * ours:.1f} us; scipy least_squares: {1e6 * scipys:.0f} us, ratio {scipys / ours:.0f}"
    )
    batch = adjust_norms(means[:20], sigma, NORMS.reference)
    off = [
        np.max(np.abs(solve_with_scipy(one) - batch.parameters[k]) / batch.sigmas[k])
        for k, one in enumerate(means[:20])
    ]
    print(f"the two solutions are apart by {max(off):.1e} of a stated sigma at most")


def rotations() -> None:
    """Print what the study takes beside its random numbers."""
    setting = RotationTest(GRADES["nav"])
    turning = len(simulate_run(setting, generator()).rate) - 2 * len(setting.sequences) * setting.window
    count = UNITS * (3 * turning + 2 * len(setting.sequences) * setting.window * 6)
    buffer = np.empty(36_000)
    streams = generator().spawn(UNITS)
    drawing = best(lambda: draw_piece_by_piece(count, buffer))
    print(f"numpy draws {count} normal numbers, nothing else: {drawing:.2f} s")
    seconds = best(lambda: [simulate_run(setting, stream) for stream in streams])
    print(f"raw increments of {UNITS} units, 1 thread: {seconds:.2f} s, ratio {seconds / drawing:.2f}")
    for threads in (1, 2):
        seconds = best(
            lambda threads=threads: run_study(setting, (START_NORM,), UNITS, generator(), threads=threads)
        )
        print(f"with three play-backs, {threads} thread: {seconds:.2f} s, ratio {seconds / drawing:.2f}")


def integration() -> None:
    """Print what a sample takes of the attitude, beside loops that do nothing else."""
    rng = np.random.default_rng(1)
    rate = np.ascontiguousarray(rng.normal(0.0, 1.0, (LENGTH, 3)))
    force = np.ascontiguousarray(rng.normal(0.0, 9.8, (LENGTH, 3)))
    weights, earth, averages, C, out = (
        np.full(1000, 1e-3),
        np.full(3, 4e-5),
        np.zeros((2, 3)),
        np.eye(3),
        np.zeros(4),
    )
    many = range(200)
    contracted = numba.njit(fastmath={"contract", "arcp", "nsz"})(bare.py_func)

    def ours(size: int) -> None:
        for _ in many:
            transform_sequence(
                rate, force, 0.01, earth, weights[:size], 0, weights[:size], LENGTH - size, averages, C
            )

    samples = len(many) * LENGTH
    timings = {
        "a sequence with two averages over a quarter of it each": best(lambda: ours(1000), 9),
        "the same with averages over a sample each": best(lambda: ours(1), 9),
        "bare loop of benchmarks/kernels.py": best(lambda: [bare(rate, 0.01, out) for _ in many], 9),
        "the same with contracted operations": best(lambda: [contracted(rate, 0.01, out) for _ in many], 9),
    }
    plain = timings["bare loop of benchmarks/kernels.py"]
    least = min(list(timings.values())[2:])
    print("attitude through a sequence, ns a sample, over the bare loop, over the better of the two")
    for name, seconds in timings.items():
        print(f"  {name:<56}{1e9 * seconds / samples:8.1f}{seconds / plain:8.2f}{seconds / least:8.2f}")


def study(threads: int = 1, *, sampled: bool = True) -> np.ndarray:
    """Return the standard deviations of the 21 parameters, SI."""
    estimates = evaluate(simulate(TURNTABLE, RUNS, generator(), sampled=sampled, threads=threads))
    return estimates.parameters().std(axis=0, ddof=1)


def turntable() -> None:
    """Print the times of Zhang's study and their ratios."""
    dwell, turn = (round(seconds * TURNTABLE.sampling) for seconds in (TURNTABLE.dwell, TURNTABLE.duration))
    count = RUNS * 6 * (len(TURNTABLE.up) * dwell + 2 * len(TURNTABLE.axes) * turn)
    buffer = np.empty(36_000)
    drawing = best(lambda: draw_piece_by_piece(count, buffer))
    print(f"numpy draws {count} normal numbers, nothing else: {drawing:.2f} s")
    for threads in (1, 2):
        seconds = best(lambda threads=threads: study(threads))
        print(
            f"{RUNS} runs of table 3 from samples, {threads} threads: {seconds:.2f} s, ratio {seconds / drawing:.2f}"
        )
    seconds = best(lambda: study(sampled=False))
    print(f"the same by sufficient statistics: {seconds:.3f} s, ratio {seconds / drawing:.4f}")
    ratio = study() / study(sampled=False)
    print(f"standard deviations, from samples over by statistics: {ratio.min():.3f} to {ratio.max():.3f}")


if __name__ == "__main__":
    norms()
    rotations()
    integration()
    turntable()
