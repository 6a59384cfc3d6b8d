"""Stamps: units, wraps, duplicates, steps back, gaps, bursts; which clock they are from and how far it may be off."""

import numpy as np
import polars as pl
import pytest
from tests.unit.recording.by_hand import said

from tumble.errors import RecordingError, UsageError
from tumble.recording import Recording, read_blocks, read_recording
from tumble.recording.formats import text
from tumble.recording.stamps import NOMINAL, BlockState, Told, clock_of_stamps, continue_stamps, stamp_jitter
from tumble.sample_rates import CRYSTAL, sample_rate


@pytest.mark.parametrize(
    ("unit", "steps"),
    [("s", (0.1, 0.15, 0.01, 5e-4, 1e-4)), ("ms", (0.3, 1.0, 40.0)), ("us", (500.0,)), ("ns", (2.5e6,))],
)
def test_the_unit_of_time_is_the_one_with_a_plausible_rate(tumbled, csv, unit, steps) -> None:
    second = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}[unit]
    for step in steps:
        rows = tumbled.rows(step * np.arange(len(tumbled.time)))
        assert read_recording(csv(rows), units="m/s^2,counts").rate == pytest.approx(second / step, rel=1e-6)


def test_where_two_units_of_time_are_plausible_the_other_is_named(tumbled, csv) -> None:
    for step, named in ((0.101, True), (0.01, False)):
        recording = read_recording(csv(tumbled.rows(step * np.arange(len(tumbled.time)))))
        assert recording.rate == pytest.approx(1 / step)
        assert ("in ms they would be 9901 Hz" in said(recording)) == named
        assert ("they would be" in said(recording)) == named


@pytest.mark.parametrize("size", [2**16, 2**32, 604_800_000])
def test_a_counter_that_wraps_is_carried_on(tumbled, csv, size) -> None:
    recording = read_recording(csv(tumbled.rows((np.arange(len(tumbled.time)) * 10 + size - 3000) % size)))
    assert "wraps 1 time(s)" in said(recording)
    # Ticks of up to 4e9 ms in seconds: rounding of a double there is 1e-9.
    assert np.abs(np.diff(recording.time) - 0.01).max() < 1e-8


def test_repeated_stamps_are_left_out(tumbled, csv) -> None:
    time = tumbled.time.copy()
    time[[100, 500]] = time[[99, 499]]
    recording = read_recording(csv(tumbled.rows(time)))
    assert len(recording) == len(time) - 2
    assert "2 row(s) with a repeated stamp left out (first: line 102)" in said(recording)
    assert np.all(np.diff(recording.time) > 0.0)


def test_stamps_that_are_coarse_or_go_back_or_contradict_the_rate_are_refused(tumbled, csv) -> None:
    back = np.where(np.arange(len(tumbled.time)) < 800, tumbled.time, tumbled.time - 3.0)
    still, header = np.full(len(tumbled.time), 4.0), {"header": None}
    for rows, options, words in (
        (csv(tumbled.rows()), {"rate": 130.0}, "give 100 Hz, but 130 Hz was declared"),
        (csv(tumbled.rows(np.floor(tumbled.time * 25) / 25), "coarse.csv"), {}, "coarser than the sampling"),
        (
            csv(tumbled.rows(back), "b.csv"),
            {},
            r"line 802: time steps back from 7\.99 to 5; .* Split the file",
        ),
        (csv(tumbled.rows(still), "still.csv"), {}, r"never changes .* give --rate"),
        (csv(tumbled.rows(still), "no.csv", **header), {}, r"never changes .* give --rate"),
    ):
        with pytest.raises(RecordingError, match=words):
            read_recording(rows, **options)


def test_gaps_are_found_where_samples_are_missing(tumbled, csv) -> None:
    recording = read_recording(csv(np.delete(tumbled.rows(), [*range(300, 350), 600], axis=0)))
    assert recording.gaps == (300, 550)
    assert recording.rate == pytest.approx(100.0, rel=1e-6)
    # jitter is none
    jitter = 0.0015 * np.random.default_rng(2).uniform(-1, 1, len(tumbled.time))
    assert read_recording(csv(tumbled.rows(tumbled.time + 1.0 + jitter))).gaps == ()


def test_blocks_are_the_recording_cut_in_pieces(tumbled, csv, monkeypatch) -> None:
    """A wrap, a gap, duplicates and NaN rows on both sides of the cuts."""
    rows = tumbled.rows((np.arange(len(tumbled.time)) * 10 + 2**16 - 9000) % 2**16)
    rows[1500, 0] = rows[1499, 0]
    rows[1600:1605, 2] = np.nan
    path = csv(np.delete(rows, slice(2000, 2100), axis=0))
    path.write_text(path.read_text() + "9,9")
    whole = read_recording(path)
    monkeypatch.setattr(text, "_CHUNK", 20_000)
    blocks = list(read_blocks(path, units="m/s^2,rad/s,ms"))
    assert len(blocks) > 3
    assert np.array_equal(np.concatenate([b.time for b in blocks]), whole.time)
    assert np.array_equal(np.vstack([b.specific_force for b in blocks]), whole.specific_force)
    assert blocks[0].sources == whole.sources
    assert "the last line is cut short" in said(blocks[-1])


@pytest.mark.parametrize(("burst", "within"), [(3, 0.0019), (8, 0.0001), (5, 0.0002)])
def test_stamps_of_samples_that_arrive_in_bursts_are_laid_evenly(tumbled, csv, monkeypatch, burst, within):
    rng = np.random.default_rng(2)
    index = np.arange(len(tumbled.time))
    true = index / 99.0
    arrival = (index // burst + 1) * burst / 99.0 + (index % burst) * within
    arrival += rng.uniform(0.0, 1e-4, len(index))[index // burst * burst]
    arrival[index > 3000] += 7.0  # samples are missing here
    path = csv(tumbled.rows(arrival))
    recording = read_recording(path)
    assert recording.rate == pytest.approx(99.0, rel=1e-3)
    assert len(recording) == len(index)
    assert len(recording.gaps) == 1
    assert abs(recording.gaps[0] - 3001) < burst
    # evenly, but for the common delay of an arrival
    assert np.ptp((recording.time - true)[:2990]) < 0.01
    assert f"bursts of about {burst}" in said(recording)
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
    kept = np.random.default_rng(3).random(len(tumbled.time)) > 0.4
    recording = read_recording(csv(tumbled.rows()[kept]))
    assert np.array_equal(recording.time, tumbled.time[kept])
    assert "bursts" not in said(recording)


# -- whose clock it is ------------------------------------------------------------------------------

K = np.arange(6000)
RNG = np.random.default_rng(3)
SIGNALS = np.hstack(
    [[0.3, -0.2, 9.8] + 0.01 * RNG.standard_normal((K.size, 3)), 1e-3 * RNG.standard_normal((K.size, 3))]
)
REGULAR = {
    "counted": 12.0 + K / 100.0,
    "counted by a wrong clock": (12.0 + K / 100.0) * 1.005,
    "milliseconds of a round rate": np.round(K / 128.0, 3),
    "hundredths": np.round(K / 100.0, 2),
    "a computer's seconds, counted": 1.7e9 + K / 100.0,
    "with samples missing": np.delete(K, np.arange(500, 700)) / 50.0,
    "whole milliseconds, made seconds": np.cumsum(np.full(6000, 8)) / 1000.0,
}
READ = {
    "device": K / 99.37 + 1e-6 * RNG.standard_normal(K.size),
    "milliseconds of another rate": np.round(K / 99.37, 3),
    "microseconds": np.round(K / 99.37 + 3e-6 * RNG.uniform(size=K.size), 6),
}


def read(time: np.ndarray, rate: float | str | None = None, name: str = "time (s)") -> Recording:
    """A plain table with these stamps: the rate as the user gives it, or the clock."""
    names = [*(f"a{axis} (m/s^2)" for axis in "xyz"), *(f"g{axis} (rad/s)" for axis in "xyz")]
    columns = dict(zip(names, SIGNALS[: len(time)].T, strict=True))
    return read_recording(pl.DataFrame({name: time, **columns}), rate=rate)


@pytest.mark.parametrize("name", REGULAR)
def test_stamps_that_are_perfectly_regular_are_nominal(name: str) -> None:
    """One clock counted and wrote: nothing says how fast it ran. 1 % to either side, rectangular: over root three."""
    clock = read(REGULAR[name]).clock
    assert (clock.kind, clock.sigma) == ("nominal", pytest.approx(0.01 / np.sqrt(3.0)))


@pytest.mark.parametrize("name", READ)
def test_stamps_that_jitter_are_of_an_unknown_board_unless_somebody_knows_better(name: str) -> None:
    """A ceramic resonator is 0.5 % off, and its stamps look as a crystal's do."""
    board = read(READ[name]).clock
    assert (board.kind, board.sigma) == ("board", NOMINAL)
    device, trusted = clock_of_stamps(READ[name], None, "device"), read(READ[name], "crystal").clock
    assert (device.kind, trusted.kind) == ("device", "trusted")
    for clock in (device, trusted):
        assert clock.rate == pytest.approx(99.37, rel=1e-5)
        assert CRYSTAL <= clock.sigma < 1.1 * CRYSTAL


def test_what_counts_the_samples_is_as_good_as_somebody_says() -> None:
    """The kind of file says who read a clock, which regular stamps are none of; a stated share is of any stamps."""
    assert clock_of_stamps(REGULAR["counted"], None, "device").kind == "nominal"
    assert read(REGULAR["counted"], "±20ppm").clock.sigma == pytest.approx(2e-5)


def test_a_computers_stamps_are_as_uncertain_as_jitter_over_the_length_makes_them() -> None:
    """5 ms of jitter in 60 s is 8e-5, which a crystal's 5e-5 stand beside."""
    time = np.sort(1.7e9 + K / 100.0 + 5e-3 * np.abs(RNG.standard_normal(K.size)).clip(0.0, 1.9))
    clock = read(time).clock
    jitter = np.std(time - np.polyval(np.polyfit(K, time, 1), K))
    expected = np.hypot(CRYSTAL, np.sqrt(2.0) * jitter / (time[-1] - time[0]))
    assert (clock.kind, clock.sigma) == ("host", pytest.approx(expected, rel=0.05))


def test_a_rate_that_is_stated_is_as_uncertain_as_it_is_stated_and_as_the_stamps_are_off_it() -> None:
    bare = pl.DataFrame(dict(zip(("ax", "ay", "az"), SIGNALS[:, :3].T, strict=True)))
    assert read_recording(bare, rate="200±0.4").clock.sigma == pytest.approx(2e-3)
    assert read_recording(bare, rate=200.0).clock.sigma == NOMINAL
    stated = read(REGULAR["counted"], "99.97±0.03").clock
    expected = np.hypot(0.03 / 99.97, 100.0 / 99.97 - 1.0)
    assert (stated.kind, stated.sigma) == ("stated", pytest.approx(expected, rel=1e-6))
    # a crystal is better than that, and is believed
    assert clock_of_stamps(READ["device"], sample_rate("99.4±0.1"), "device").kind == "device"
    assert read(READ["device"], "99.4±0.1").clock.kind == "stated"
    assert read(REGULAR["counted"], "97.5±0.975").clock.sigma > 0.025
    assert clock_of_stamps(REGULAR["counted"], 97.5).sigma > 0.025


@pytest.mark.parametrize(
    "text", ["100±0.1", "100+-0.1", "100 +/- 0.1", " 1e2 ± 1e-1 ", "100±0.1%", "100 +- 1000 ppm"]
)
def test_a_rate_is_read_with_its_uncertainty(text: str) -> None:
    rate = sample_rate(text)
    assert (float(rate), rate.uncertainty, rate.relative) == (100.0, 0.1, pytest.approx(1e-3))
    assert sample_rate("100").uncertainty is None
    assert sample_rate(str(rate)).uncertainty == 0.1


@pytest.mark.parametrize("text", ["", "hundred", "100±", "100±x", "-100", "0", "100±-1", "1±2", "nan", "inf"])
def test_what_is_no_rate_is_refused_with_what_to_write(text: str) -> None:
    with pytest.raises(UsageError, match=r"100±0\.1"):
        sample_rate(text)


def test_stamps_that_contradict_a_rate_stated_with_its_uncertainty_are_refused() -> None:
    """Half a per cent off is five sigmas of 0.1 %; without an uncertainty nobody can say."""
    time = K / 99.5
    with pytest.raises(RecordingError, match=r"99\.5 Hz, but 100\.0±0\.1 Hz was declared"):
        read(time, "100±0.1")
    assert read(time, 100.0).clock.kind == "nominal"
    stated = read(time, "99.6±0.2")
    assert stated.clock.kind == "stated"
    assert stated.between(5, 400).clock == stated.clock


@pytest.mark.parametrize("rate", [None, "±0.1%"])
def test_a_plain_table_has_a_better_clock_where_its_column_or_the_user_says_so(rate: str | None) -> None:
    time = K / 99.5 + 1e-4 * RNG.uniform(size=K.size)
    assert read(time, rate).clock.kind == ("board" if rate is None else "trusted")
    for name in ("gps_time (s)", "utc (s)"):
        assert read(time, None, name).clock.kind == "host"


def test_the_jitter_of_stamps_is_told_from_samples_that_are_irregular() -> None:
    late = np.sort(K / 100.0 + np.abs(0.003 * RNG.standard_normal(K.size)))
    assert stamp_jitter(late) == pytest.approx(0.003 * np.sqrt(1.0 - 2.0 / np.pi), rel=0.1)
    assert stamp_jitter(np.cumsum(0.01 + 0.002 * RNG.standard_normal(K.size))) < 0.0006
    assert stamp_jitter(K / 100.0) < 1e-12
    assert stamp_jitter(np.delete(late, np.arange(500, 700))) == pytest.approx(stamp_jitter(late), rel=0.1)
