"""A stream of blocks gives what the whole signal gives."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.arrays import block_means
from tumble.errors import UsageError
from tumble.noise.deviation import PLACES, StreamedDeviation, allan_deviation


def signal_of(samples: int) -> np.ndarray:
    rng = np.random.default_rng(11)
    return (
        rng.standard_normal((samples, 2)) + 0.01 * np.cumsum(rng.standard_normal((samples, 2)), axis=0) + 9.8
    )


def streamed(signal: np.ndarray, cuts: list[int]) -> StreamedDeviation:
    collector = StreamedDeviation(100.0, signal.shape[1])
    for block in np.split(signal, cuts):
        collector.add(block)
    return collector


def test_short_averaging_times_are_exact_wherever_the_blocks_are_cut() -> None:
    signal = signal_of(20_000)
    whole = allan_deviation(signal, 100.0)
    found = streamed(signal, [1, 3, 3, 100, 101, 400, 9000, 19_999]).deviation()
    assert found.tau == pytest.approx(whole.tau)
    short = found.averaging <= PLACES
    assert found.count[short].tolist() == whole.count[short].tolist()
    assert found.deviation[short] == pytest.approx(whole.deviation[short], rel=1e-9)


def test_long_averaging_times_are_those_of_the_averaged_signal() -> None:
    """Means of 2^h samples: no aliasing, the same statistics at fewer places, to rounding."""
    signal = signal_of(40_000)
    found = streamed(signal, [777, 20_001]).deviation()
    for height in (1, 3, 6):
        m = PLACES << height
        averaged = allan_deviation(block_means(signal, 1 << height), 1.0, taus=[float(PLACES)])
        at = list(found.averaging).index(m)
        assert found.deviation[at] == pytest.approx(averaged.deviation[0], rel=1e-9)


def test_no_difference_lies_across_a_gap() -> None:
    signal = signal_of(9000)
    collector = StreamedDeviation(100.0, 2)
    collector.add(signal[:4001])
    collector.add(signal[4001:5000] + 1e6, after_gap=True)
    collector.add(signal[5000:] + 1e6)
    found = collector.deviation()
    whole = allan_deviation(signal, 100.0, gaps=[4001])
    assert found.pieces == (4001, 4999)
    # Rounding against a jump of 1e6.
    assert found.deviation[:8] == pytest.approx(whole.deviation[:8], rel=1e-6)


def test_memory_does_not_grow_with_the_recording() -> None:
    collector = streamed(signal_of(50_000), list(range(1000, 50_000, 1000)))
    held = sum(floor.held.size + floor.odd.size for floor in collector._floors)
    assert held <= 2 * (2 * PLACES + 1) * 17  # seventeen levels at most, two channels


def test_nothing_taken_is_nothing_given() -> None:
    with pytest.raises(UsageError, match="too few"):
        StreamedDeviation(1.0, 1).deviation()
