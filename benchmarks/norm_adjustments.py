"""Many norm adjustments, beside the least that any program must do, in one run.

    python benchmarks/norm_adjustments.py

500 runs of Hayal's table 4.5 with every sample drawn (500 x 26 x 180 x 3 normal numbers), attitudes, means and
adjustments included, against numpy's drawing of as many normal numbers with the same generator and nothing
else: all into one new array, and, which is the least it can do, piece by piece into an array that stays in the
cache. Then one nine-parameter adjustment of 26 hold means against scipy.optimize.least_squares on the same
norms, with its numerical Jacobian, from the same start values.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from collections.abc import Callable

import numpy as np
from scipy.optimize import least_squares

from tumble.calibration.closed_forms.norm_batch import adjust_norms
from tumble.sensor.conventions.shin import matrix_from_shin
from tumble_papers.hayal.thesis_simulation import (
    ATTITUDES,
    FORCE_NOISE,
    GRAVITY,
    SAMPLES,
    run_setting,
    simulate_means,
    table_setting,
)

RUNS = 500


def best(function: Callable[[], object], repeats: int = 7) -> float:
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


def solve_with_scipy(means: np.ndarray) -> np.ndarray:
    """Minimise the sum of (|true| - K)² over the nine parameters."""

    def residual(values: np.ndarray) -> np.ndarray:
        matrix = np.real(matrix_from_shin(values[3:6], values[6:9]))
        true = np.linalg.solve(matrix, (means - values[:3]).T)
        return np.linalg.norm(true, axis=0) - GRAVITY

    start = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    return least_squares(residual, start, x_scale="jac").x


def main() -> None:
    """Print times, and how far the two solutions are apart."""
    setting = table_setting("4.5", 2)
    count = RUNS * ATTITUDES * SAMPLES * 3
    study = best(lambda: run_setting(setting, RUNS, generator()))
    drawing = best(lambda: generator().standard_normal(count))
    buffer = np.empty(ATTITUDES * SAMPLES * 3)
    pieces = best(lambda: draw_piece_by_piece(count, buffer))
    print(f"{RUNS} runs of table 4.5, {count} samples drawn: {1e3 * study:.1f} ms")
    print(
        f"numpy draws {count} normal numbers, nothing else: {1e3 * drawing:.1f} ms, ratio {study / drawing:.2f}"
    )
    print(f"the same piece by piece: {1e3 * pieces:.1f} ms, ratio {study / pieces:.2f}")
    means = simulate_means(setting, RUNS, generator())
    sigma = FORCE_NOISE / np.sqrt(SAMPLES)
    ours = best(lambda: adjust_norms(means, sigma, GRAVITY)) / RUNS
    scipys = best(lambda: [solve_with_scipy(one) for one in means[:20]]) / 20
    print(
        f"one adjustment: {1e6 * ours:.1f} us; scipy least_squares: {1e6 * scipys:.0f} us, ratio {scipys / ours:.0f}"
    )
    batch = adjust_norms(means[:20], sigma, GRAVITY)
    off = [
        np.max(np.abs(solve_with_scipy(one) - batch.parameters[k]) / batch.sigmas[k])
        for k, one in enumerate(means[:20])
    ]
    print(f"the two solutions are apart by {max(off):.1e} of a stated sigma at most")


if __name__ == "__main__":
    main()
