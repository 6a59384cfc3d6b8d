"""What benchmarks of one run share: the least of several timings, and numpy's drawing of random numbers."""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from collections.abc import Callable

import numpy as np


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
