"""Two streams with stamps of their own become one, whole or piece by piece."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.errors import RecordingError
from tumble.recording.formats.streams import Merging, merge_streams
from tumble.recording.samples import Samples, joined

SLOPES = np.array([[0.3, -2.0, 9.0], [0.7, 0.1, -0.4]])  # at t = 0, and per second


def force_at(time: np.ndarray) -> np.ndarray:
    return SLOPES[0] + time[:, None] * SLOPES[1]


def streams(step: float = 0.02, offset: float = 0.0031) -> tuple[Samples, Samples]:
    """A specific force that grows linearly, and a gyro at twice the rate."""
    slow, fast = offset + step * np.arange(200), 0.01 * np.arange(400)
    return Samples(slow, force_at(slow)), Samples(fast, None, np.column_stack([fast, -fast, 2.0 * fast]))


def test_a_line_is_interpolated_exactly_at_the_gyro_s_stamps() -> None:
    force, rates = streams()
    merged, remarks = merge_streams("a.bag", ("/acc", force), ("/gyr", rates))
    # Only rounding is left of a linear interpolation of a line.
    np.testing.assert_allclose(merged.specific_force, force_at(merged.time), rtol=0, atol=1e-13)
    assert np.array_equal(merged.angular_rate[:, 0], merged.time)
    assert merged.time[0] == 0.01  # 0.00 s is before the accelerometer's first sample
    assert any("interpolated" in r.text and r.kind == "mended" for r in remarks)


def test_the_same_stamps_give_the_same_numbers() -> None:
    time = 0.01 * np.arange(50)
    force = np.random.default_rng(1).normal(size=(50, 3))
    merged, remarks = merge_streams("a", ("f", Samples(time, force)), ("w", Samples(time, None, force + 1.0)))
    assert np.array_equal(merged.specific_force, force)
    assert remarks[0].kind == "found"


def test_piece_by_piece_is_as_whole() -> None:
    force, rates = streams()
    whole, _ = merge_streams("a", ("f", force), ("w", rates))
    merging, pieces = Merging("a", "f", "w"), []
    for start in range(0, 400, 37):
        merging.add(force.cut(slice(start // 2, (start + 37) // 2)), rates.cut(slice(start, start + 37)))
        pieces.append(merging.take())
    pieces.append(merging.take(last=True))
    whole_again = joined([p for p in pieces if p is not None])
    assert np.array_equal(whole_again.time, whole.time)
    assert np.array_equal(whole_again.specific_force, whole.specific_force)
    assert merging.left_out == 400 - len(whole)


def test_nothing_is_interpolated_over_a_gap() -> None:
    force, rates = streams()
    keep = (force.time < 1.0) | (force.time > 2.0)
    merged, remarks = merge_streams("a", ("f", force.cut(keep)), ("w", rates))
    assert not np.any((merged.time > 1.01) & (merged.time < 1.99))
    assert np.any(merged.time > 2.1)
    assert any("gap" in r.text for r in remarks)


def test_an_accelerometer_that_steps_back_is_refused() -> None:
    force, rates = streams()
    force.time[100] = force.time[98]
    with pytest.raises(RecordingError, match=r"/acc step back from .* cut the recording there"):
        merge_streams("a.bag", ("/acc", force), ("/gyr", rates))


def test_streams_of_two_times_are_refused() -> None:
    force, rates = streams()
    late = Samples(rates.time + 1000.0, None, rates.angular_rate)
    with pytest.raises(RecordingError, match="no time in common"):
        merge_streams("a", ("f", force), ("w", late))
