"""Values that a logger wrote several times over: found, told from chance, and taken once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from tumble.arrays import Table
from tumble.noise.deviation import allan_deviation
from tumble.noise.evidence import RestEvidence
from tumble.noise.held import (
    beyond_chance,
    blocks_without_repeats,
    equal_rows,
    find_held,
    say_held,
    without_repeats,
)
from tumble.noise.suitability import judge_rest
from tumble.recording import Recording

Rows = npt.NDArray[np.int64]
RATE, SAMPLES = 100.0, 6000


def rest(rows: Rows, rate: float = RATE) -> Recording:
    """A unit at rest whose values stand in rows by their index."""
    rng = np.random.default_rng(5)
    values = rng.standard_normal((SAMPLES, 6))
    force, turn = 9.8 + 0.02 * values[:, :3], 1e-3 * values[:, 3:]
    stamps = np.arange(len(rows)) / rate
    return Recording(stamps, force[rows], turn[rows], "m/s^2", "rad/s", rate)


def force_of(recording: Recording) -> Table:
    assert recording.specific_force is not None
    return recording.specific_force


def held_at(rows_per_value: float) -> Recording:
    return rest(np.floor(np.arange(SAMPLES) / rows_per_value + 1e-9).astype(int))


@pytest.mark.parametrize("rows", [2.0, 3.0, 4.0, 5.0, 10.0, 2.5, 1.04])
def test_values_are_taken_once_at_the_rate_of_new_ones(rows: float) -> None:
    recording = held_at(rows)
    held = find_held(recording)
    assert held is not None
    assert held.rows == pytest.approx(rows, rel=2e-3)
    assert (held.fewest, held.most) == (int(rows), int(np.ceil(rows)))
    once = without_repeats(recording, held)
    assert once is not None
    assert once.rate == pytest.approx(RATE / rows, rel=2e-3)
    assert len(once) == len(np.unique(force_of(recording), axis=0))
    assert once.gaps == ()
    assert np.diff(once.time) == pytest.approx(rows / RATE, rel=2e-2)
    found = judge_rest(RestEvidence.of(once))
    assert found.samples == len(once)
    assert not any("not at rest" in text or "repeat" in text for text in found.remarks)
    # white noise of 0.02 a value has N = 0.02 over the root of the values' rate
    deviation = allan_deviation(force_of(once), once.rate, taus=[1.0 / once.rate], noise=0).deviation
    assert deviation[0] * np.sqrt(1.0 / once.rate) == pytest.approx(0.02 / np.sqrt(RATE / rows), rel=0.15)
    assert f"{100.0 * held.share:.0f} % of the rows" in say_held(held)


def test_rows_of_every_length_in_a_jittery_loggers_file_are_taken_once() -> None:
    rng = np.random.default_rng(1)
    recording = rest(np.sort(rng.integers(0, SAMPLES // 2, SAMPLES)))
    held = find_held(recording)
    assert held is not None
    once = without_repeats(recording, held)
    assert once is not None
    assert not once.gaps
    assert np.all(np.any(np.diff(force_of(once), axis=0) != 0.0, axis=1))


def test_samples_that_differ_are_left_alone() -> None:
    assert find_held(held_at(1.0)) is None


def test_a_few_repeats_in_no_order_are_told_but_not_taken_out() -> None:
    rng = np.random.default_rng(2)
    index = np.arange(SAMPLES)
    lost = np.flatnonzero(rng.random(SAMPLES) < 0.05)[1:]
    index[lost] -= 1
    recording = rest(index)
    assert find_held(recording) is None
    judged = judge_rest(RestEvidence.of(recording))
    assert any("replaced by the row before" in text for text in judged.remarks)
    assert judged.shortest == pytest.approx(5.0 / (0.95 * RATE), rel=0.02)


@pytest.mark.parametrize("step", [3.0, 5.0])
def test_a_coarse_converters_repeats_are_chance(step: float) -> None:
    """Channels repeat one by one: at 5 sigma a step four of five rows are like the one before, and none is held."""
    rng = np.random.default_rng(3)
    values = step * np.round(rng.standard_normal((SAMPLES, 3)) / step)
    stamps = np.arange(SAMPLES) / RATE
    recording = Recording(stamps, values + 9.8, None, "m/s^2", "rad/s", RATE)
    rows, each = equal_rows(values)
    assert rows / SAMPLES > 0.4
    assert beyond_chance(rows, each, SAMPLES - 1) < 0.02
    assert find_held(recording) is None


def test_a_sensor_that_stood_still_leaves_a_gap() -> None:
    index = np.floor(np.arange(SAMPLES) / 2).astype(int)
    index[2001:2401] = index[2000]
    recording = rest(index)
    held = find_held(recording)
    assert held is not None
    once = without_repeats(recording, held)
    assert once is not None
    assert once.gaps == (1001,)
    assert once.time[1001] - once.time[1000] == pytest.approx(4.0, abs=0.05)


def test_block_by_block_the_same_values_are_taken() -> None:
    recording = held_at(3.0)
    held = find_held(recording)
    assert held is not None

    def read() -> Iterator[Recording]:
        for start in range(0, SAMPLES, 701):
            yield recording.between(start, min(start + 701, SAMPLES))

    whole = without_repeats(recording, held)
    blocks = list(blocks_without_repeats(read, held)())
    assert whole is not None
    joined: Table = np.concatenate([np.asarray(block.angular_rate) for block in blocks])
    assert np.array_equal(joined, np.asarray(whole.angular_rate))
    assert {block.rate for block in blocks} == {held.rate}


def test_a_gap_between_repeats_stays_one() -> None:
    recording = held_at(4.0)
    keep = np.r_[0:2000, 3001:SAMPLES]
    broken = replace(
        recording,
        time=recording.time[keep],
        specific_force=np.asarray(recording.specific_force)[keep],
        angular_rate=np.asarray(recording.angular_rate)[keep],
        gaps=(2000,),
    )
    held = find_held(broken)
    assert held is not None
    once = without_repeats(broken, held)
    assert once is not None
    assert once.gaps == (500,)
