"""Overlapping Allan deviation beside the bare loop and beside what else could make it, in one run.

    python benchmarks/allan.py [SAMPLES [CHANNELS]]

The bare loop is what one writes with numba for one averaging time: squares of second differences over
contiguous slices of the running sum. Ours makes the running sum from the recording's columns too, all channels,
with degrees of freedom and intervals. allantools is measured where it can be imported, on one channel.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import resource
import sys
import time
import warnings
from collections.abc import Callable

import numba
import numpy as np

from tumble.noise import StreamedDeviation, allan_deviation

RATE = 100.0
TAUS = 94


@numba.njit(fastmath=True)
def bare(phase, m):
    first, middle, last = phase[: -2 * m], phase[m:-m], phase[2 * m :]
    total = 0.0
    for i in range(first.shape[0]):
        change = last[i] - 2.0 * middle[i] + first[i]
        total += change * change
    return total


def plain(signal, averaging):
    """The definition in numpy, without loops over samples."""
    phase = np.concatenate([[0.0], np.cumsum(signal - signal.mean())])
    return np.array(
        [
            np.sqrt(0.5 * np.mean((phase[2 * m :] - 2.0 * phase[m:-m] + phase[: -2 * m]) ** 2)) / m
            for m in averaging
        ]
    )


def best(function: Callable[[], object], repeats: int = 3) -> float:
    seconds = []
    for _ in range(repeats):
        started = time.perf_counter()
        function()
        seconds.append(time.perf_counter() - started)
    return min(seconds)


def averaging_times(longest: int) -> np.ndarray:
    """94 of them, evenly spaced in the logarithm as far as whole samples allow."""
    count, found = TAUS, np.ones(1, dtype=np.int64)
    while found.size < min(TAUS, longest):
        found = np.unique(np.rint(np.geomspace(1, longest, count)).astype(np.int64))
        count += 1
    return found[-TAUS:]


def peak_megabytes() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def main() -> None:
    samples = int(sys.argv[1]) if len(sys.argv) > 1 else 2_000_000
    channels = int(sys.argv[2]) if len(sys.argv) > 2 else 6
    rng = np.random.default_rng(1)
    signal = rng.standard_normal((samples, channels))
    averaging = averaging_times(samples // 3)
    taus = averaging / RATE
    work = channels * sum(samples + 1 - 2 * int(m) for m in averaging)
    allan_deviation(signal[:1000], RATE)
    bare(np.zeros(100), 1)

    before = peak_megabytes()
    ours = best(lambda: allan_deviation(signal, RATE, taus=taus, noise=0), 2)
    grown = peak_megabytes() - before
    phase = np.concatenate([[0.0], np.cumsum(signal[:, 0])])
    loop = channels * best(lambda: [bare(phase, int(m)) for m in averaging])
    numpy_ = channels * best(lambda: plain(signal[:, 0], averaging), 1)
    print(f"{samples} samples x {channels} channels x {averaging.size} averaging times")
    print(f"  {'':<34}{'ns':>8}{'ratio':>9}   (ns per sample, channel and averaging time)")
    for name, seconds in (("bare loop", loop), ("ours, everything", ours), ("numpy", numpy_)):
        print(f"  {name:<34}{1e9 * seconds / work:8.3f}{seconds / loop:9.2f}")
    found = allan_deviation(signal[:, 0], RATE, taus=taus).deviation[:, 0]
    gap = np.max(np.abs(found / plain(signal[:, 0], averaging) - 1.0))
    print(f"  largest relative difference from numpy: {gap:.1e}")
    print(f"  memory beyond the recording's {signal.nbytes / 2**20:.0f} MB: {grown:.0f} MB")

    def stream() -> None:
        collector = StreamedDeviation(RATE, channels)
        for start in range(0, samples, 500_000):
            collector.add(signal[start : start + 500_000])
        collector.deviation()

    stream()
    octaves = best(lambda: allan_deviation(signal, RATE, noise=0), 2)
    print(f"  octaves: {octaves:.2f} s at once, {best(stream, 2):.2f} s streamed in blocks of half a million")
    peer(signal[:, 0], taus, found, channels, work, loop)


def peer(signal, taus, found, channels, work, loop) -> None:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import allantools
    except ImportError:
        print("  allantools is not installed: not measured")
        return
    answer: list[np.ndarray] = []
    seconds = channels * best(
        lambda: answer.append(allantools.oadev(signal, rate=RATE, data_type="freq", taus=taus)[1]), 1
    )
    print(f"  {'allantools.oadev':<34}{1e9 * seconds / work:8.3f}{seconds / loop:9.2f}")
    print(f"  largest relative difference from allantools: {np.max(np.abs(found / answer[0] - 1.0)):.1e}")


if __name__ == "__main__":
    main()
