"""Zhang's 500 simulated calibrations from raw samples, beside drawing their random numbers, in one run.

    python benchmarks/turntable_study.py

Table 3: nine dwells of 100 s and twelve rotations of 180 s at 100 Hz, six sensors, 500 runs; simulated and
evaluated, by one thread and by two. Against it numpy's drawing of as many normal numbers with the same
generator and nothing else, piece by piece into an array that stays in the cache, which is the least that it
can do. Then the same study by its sufficient statistics, and how far the scatter of the two is apart.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from collections.abc import Callable

import numpy as np

from tumble_papers.zhang.turntable_evaluation import evaluate, in_paper_units, unit_parameters
from tumble_papers.zhang.turntable_simulation import Setting, simulate, table_setting

RUNS = 500


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


def study(setting: Setting, threads: int = 1, *, sampled: bool = True) -> np.ndarray:
    """Return the standard deviations of the 21 parameters, in the paper's units."""
    estimates = evaluate(simulate(setting, RUNS, generator(), sampled=sampled, threads=threads))
    return in_paper_units(estimates.parameters(), unit_parameters(setting.unit)).std(axis=0, ddof=1)


def main() -> None:
    """Print times and their ratios."""
    setting = table_setting("3")
    dwell, turn = (round(seconds * setting.sampling) for seconds in (setting.dwell, setting.duration))
    count = RUNS * 6 * (len(setting.up) * dwell + 2 * len(setting.axes) * turn)
    buffer = np.empty(36_000)
    drawing = best(lambda: draw_piece_by_piece(count, buffer))
    print(f"numpy draws {count} normal numbers, nothing else: {drawing:.2f} s")
    for threads in (1, 2):
        seconds = best(lambda threads=threads: study(setting, threads))
        print(
            f"{RUNS} runs of table 3 from samples, {threads} threads: {seconds:.2f} s, ratio {seconds / drawing:.2f}"
        )
    seconds = best(lambda: study(setting, sampled=False))
    print(f"the same by sufficient statistics: {seconds:.3f} s, ratio {seconds / drawing:.4f}")
    ratio = study(setting) / study(setting, sampled=False)
    print(f"standard deviations, from samples over by statistics: {ratio.min():.3f} to {ratio.max():.3f}")


if __name__ == "__main__":
    main()
