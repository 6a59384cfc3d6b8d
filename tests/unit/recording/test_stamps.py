"""Stamps: units, wraps, duplicates, steps back, gaps, rates."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.errors import RecordingError
from tumble.recording import read_blocks, read_recording
from tumble.recording.stamps import BlockState, Told, continue_stamps, find_gaps, guess_time_unit


def with_time(tumbled, time: np.ndarray) -> np.ndarray:
    return np.column_stack([time, tumbled.specific_force[: len(time)], tumbled.angular_rate[: len(time)]])


def test_the_unit_of_time_is_the_one_with_a_plausible_rate() -> None:
    steps = {"s": (0.1, 0.15, 0.01, 5e-4, 1e-4), "ms": (0.3, 1.0, 40.0), "us": (500.0,), "ns": (2.5e6,)}
    for unit, some in steps.items():
        assert {guess_time_unit(step) for step in some} == {unit}


def test_where_two_units_of_time_are_plausible_the_other_is_named(tumbled, csv) -> None:
    slow = read_recording(csv(with_time(tumbled, 0.101 * np.arange(len(tumbled.time)))))
    assert slow.rate == pytest.approx(1 / 0.101)
    assert any("in ms they would be 9901 Hz" in r.text for r in slow.remarks)
    usual = read_recording(csv(with_time(tumbled, 0.01 * np.arange(len(tumbled.time)))))
    assert not any("they would be" in r.text for r in usual.remarks)


@pytest.mark.parametrize("size", [2**16, 2**32, 604_800_000])
def test_a_counter_that_wraps_is_carried_on(tumbled, csv, size) -> None:
    ticks = (np.arange(len(tumbled.time)) * 10 + size - 3000) % size
    recording = read_recording(csv(with_time(tumbled, ticks)))
    assert any("wraps 1 time(s)" in r.text for r in recording.remarks)
    # Ticks of up to 4e9 ms in seconds: rounding of a double there is 1e-9.
    assert np.abs(np.diff(recording.time) - 0.01).max() < 1e-8


def test_repeated_stamps_are_left_out(tumbled, csv) -> None:
    time = tumbled.time.copy()
    time[[100, 500]] = time[[99, 499]]
    recording = read_recording(csv(with_time(tumbled, time)))
    assert len(recording) == len(time) - 2
    said = "2 row(s) with a repeated stamp left out (first: line 102)"
    assert any(said in remark.text for remark in recording.remarks)
    assert np.all(np.diff(recording.time) > 0.0)


def test_stamps_that_are_coarse_or_go_back_or_contradict_the_rate_are_refused(tumbled, csv) -> None:
    with pytest.raises(RecordingError, match="give 100 Hz, but 130 Hz was declared"):
        read_recording(csv(tumbled.rows()), rate=130.0)
    with pytest.raises(RecordingError, match="coarser than the sampling"):
        read_recording(csv(with_time(tumbled, np.floor(tumbled.time * 25) / 25)))
    # going back is, with its line
    time = tumbled.time.copy()
    time[800:] -= 3.0
    with pytest.raises(RecordingError, match=r"line 802: time steps back from 7\.99 to 5; .* Split the file"):
        read_recording(csv(with_time(tumbled, time)))


@pytest.mark.parametrize("header", ["t,ax,ay,az,gx,gy,gz", None])
def test_time_that_stands_still_is_refused(tumbled, csv, header) -> None:
    with pytest.raises(RecordingError, match=r"never changes .* give --rate"):
        read_recording(csv(with_time(tumbled, np.full(len(tumbled.time), 4.0)), header=header))


def test_gaps_are_found_where_samples_are_missing(tumbled, csv) -> None:
    rows = np.delete(tumbled.rows(), [*range(300, 350), 600], axis=0)
    recording = read_recording(csv(rows))
    assert recording.gaps == (300, 550)
    assert recording.rate == pytest.approx(100.0, rel=1e-6)
    # jitter is none
    rng = np.random.default_rng(2)
    time = np.arange(5000) / 100 + 0.0015 * rng.uniform(-1, 1, 5000)
    assert find_gaps(time, 100.0) == ()


def test_blocks_are_the_recording_cut_in_pieces(tumbled, csv, monkeypatch) -> None:
    """A wrap, a gap, duplicates and NaN rows on both sides of the cuts."""
    from tumble.recording.formats import text

    time = (np.arange(len(tumbled.time)) * 10 + 2**16 - 9000) % 2**16
    rows = with_time(tumbled, time)
    rows[1500, 0] = rows[1499, 0]
    rows[1600:1605, 2] = np.nan
    rows = np.delete(rows, slice(2000, 2100), axis=0)
    path = csv(rows)
    path.write_text(path.read_text() + "9,9")
    whole = read_recording(path)
    monkeypatch.setattr(text, "_CHUNK", 20_000)
    blocks = list(read_blocks(path, units="m/s^2,rad/s,ms"))
    assert len(blocks) > 3
    assert np.array_equal(np.concatenate([b.time for b in blocks]), whole.time)
    assert np.array_equal(np.vstack([b.specific_force for b in blocks]), whole.specific_force)
    assert blocks[0].sources == whole.sources
    assert any("the last line is cut short" in remark.text for remark in blocks[-1].remarks)


@pytest.mark.parametrize(("burst", "within"), [(3, 0.0019), (8, 0.0001), (5, 0.0002)])
def test_stamps_of_samples_that_arrive_in_bursts_are_laid_evenly(tumbled, csv, monkeypatch, burst, within):
    from tumble.recording.formats import text

    rng = np.random.default_rng(2)
    index = np.arange(len(tumbled.time))
    true = index / 99.0
    arrival = (index // burst + 1) * burst / 99.0 + (index % burst) * within
    arrival += rng.uniform(0.0, 1e-4, len(index))[index // burst * burst]
    arrival[index > 3000] += 7.0  # samples are missing here
    path = csv(with_time(tumbled, arrival))
    recording = read_recording(path)
    assert recording.rate == pytest.approx(99.0, rel=1e-3)
    assert len(recording) == len(index)
    assert len(recording.gaps) == 1
    assert abs(recording.gaps[0] - 3001) < burst
    part = slice(0, 2990)
    # evenly, but for the common delay of an arrival
    assert np.ptp(recording.time[part] - true[part]) < 0.01
    assert any(f"bursts of about {burst}" in remark.text for remark in recording.remarks)
    monkeypatch.setattr(text, "_CHUNK", 90_000)
    blocks = list(read_blocks(path))
    np.testing.assert_allclose(np.concatenate([b.time for b in blocks]), recording.time, atol=0.01)


def test_bursts_are_followed_from_block_to_block_though_the_clock_drifts() -> None:
    told, state = Told("x", str, "s", 100.0), BlockState(0, -0.01, 0.0, 0.05, -0.01)
    for at in np.arange(200_000).reshape(20, -1):
        true = 0.01 * at * (1.0 + 1e-9 * at)  # 200 ppm at the end
        time, *_ = continue_stamps(true[at % 5 == 4].repeat(5) + 1e-4 * (at % 5), told, state)
        assert np.abs(time - true).max() < 0.06


def test_lost_samples_are_no_bursts(tumbled, csv) -> None:
    rng = np.random.default_rng(3)
    kept = rng.random(len(tumbled.time)) > 0.4
    recording = read_recording(csv(with_time(tumbled, tumbled.time)[kept]))
    assert np.array_equal(recording.time, tumbled.time[kept])
    assert not any("bursts" in remark.text for remark in recording.remarks)
