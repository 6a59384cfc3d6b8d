"""Which clock stamps are from, and how far its rate may be off, as they lie and as somebody says."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

import tumble
from tumble.errors import RecordingError, UsageError
from tumble.recording.recording import Recording
from tumble.recording.stamps import NOMINAL, clock_of_stamps, clock_without_stamps, stamp_jitter
from tumble.sample_rates import CRYSTAL, SampleRate, sample_rate, stated_clock

K = np.arange(6000)
RNG = np.random.default_rng(3)
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


@pytest.mark.parametrize("name", REGULAR)
def test_stamps_that_are_perfectly_regular_are_nominal(name: str) -> None:
    """One clock counted and wrote: nothing says how fast it ran. 1 % to either side, rectangular: over root three."""
    clock = clock_of_stamps(REGULAR[name])
    assert clock.kind == "nominal"
    assert clock.sigma == pytest.approx(0.01 / np.sqrt(3.0))


@pytest.mark.parametrize("name", READ)
def test_stamps_that_jitter_are_of_an_unknown_board_unless_somebody_knows_better(name: str) -> None:
    """A ceramic resonator is 0.5 % off, and its stamps look as a crystal's do."""
    board = clock_of_stamps(READ[name])
    assert (board.kind, board.sigma) == ("board", NOMINAL)
    device, trusted = (
        clock_of_stamps(READ[name], None, known) for known in ("device", stated_clock("crystal"))
    )
    assert (device.kind, trusted.kind) == ("device", "trusted")
    for clock in (device, trusted):
        assert clock.rate == pytest.approx(99.37, rel=1e-5)
        assert CRYSTAL <= clock.sigma < 1.1 * CRYSTAL


def test_what_counts_the_samples_is_as_good_as_somebody_says() -> None:
    """The kind of file says who read a clock, which regular stamps are none of; a stated share is of any stamps."""
    assert clock_of_stamps(REGULAR["counted"], None, "device").kind == "nominal"
    assert clock_of_stamps(REGULAR["counted"], None, stated_clock("±20ppm")).sigma == pytest.approx(2e-5)


def test_a_computers_stamps_are_as_uncertain_as_jitter_over_the_length_makes_them() -> None:
    """5 ms of jitter in 60 s is 8e-5, which a crystal's 5e-5 stand beside."""
    time = 1.7e9 + K / 100.0 + 5e-3 * np.abs(RNG.standard_normal(K.size)).clip(0.0, 1.9)
    time = np.sort(time)
    clock = clock_of_stamps(time)
    jitter = np.std(time - np.polyval(np.polyfit(K, time, 1), K))
    assert clock.kind == "host"
    assert clock.sigma == pytest.approx(
        np.hypot(CRYSTAL, np.sqrt(2.0) * jitter / (time[-1] - time[0])), rel=0.05
    )


def test_a_rate_that_is_stated_is_as_uncertain_as_it_is_stated_and_as_the_stamps_are_off_it() -> None:
    assert clock_without_stamps(SampleRate(200.0, 0.4)).sigma == pytest.approx(2e-3)
    assert clock_without_stamps(200.0).sigma == NOMINAL
    stated = clock_of_stamps(REGULAR["counted"], SampleRate(99.97, 0.03))
    assert stated.kind == "stated"
    assert stated.sigma == pytest.approx(np.hypot(0.03 / 99.97, 100.0 / 99.97 - 1.0), rel=1e-6)
    # a crystal is better than that, and is believed
    assert clock_of_stamps(READ["device"], SampleRate(99.4, 0.1), "device").kind == "device"
    assert clock_of_stamps(READ["device"], SampleRate(99.4, 0.1)).kind == "stated"
    assert clock_of_stamps(REGULAR["counted"], SampleRate(97.5, 0.975)).sigma > 0.025
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


def _frame(rate: float) -> dict[str, np.ndarray]:
    time = np.arange(3000) / rate
    force = np.tile([0.3, -0.2, 9.8], (3000, 1)) + 0.01 * RNG.standard_normal((3000, 3))
    gyro = 1e-3 * RNG.standard_normal((3000, 3))
    names = ["time (s)", *(f"a{axis} (m/s^2)" for axis in "xyz"), *(f"g{axis} (rad/s)" for axis in "xyz")]
    return dict(zip(names, np.column_stack([time, force, gyro]).T, strict=True))


def test_stamps_that_contradict_a_rate_stated_with_its_uncertainty_are_refused() -> None:
    """Half a per cent off is five sigmas of 0.1 %; without an uncertainty nobody can say."""
    frame = pl.DataFrame(_frame(99.5))
    with pytest.raises(RecordingError, match=r"99\.5 Hz, but 100\.0±0\.1 Hz was declared"):
        tumble.read_recording(frame, rate="100±0.1")
    assert tumble.read_recording(frame, rate=100.0).clock.kind == "nominal"
    assert tumble.read_recording(frame, rate="99.6±0.2").clock.kind == "stated"


@pytest.mark.parametrize(
    ("name", "said", "kind"),
    [("time (s)", None, "board"), ("time (s)", "crystal", "trusted"), ("time (s)", "±0.1%", "trusted"),
     ("gps_time (s)", None, "host"), ("utc (s)", None, "host")],
)  # fmt: skip
def test_a_plain_table_has_a_crystal_where_its_column_or_the_user_says_so(
    name: str, said: str | None, kind: str
) -> None:
    columns = _frame(99.5)
    time = columns.pop("time (s)") + 1e-4 * RNG.uniform(size=3000)
    clock = tumble.read_recording(pl.DataFrame({name: time, **columns}), rate=said).clock
    assert clock.kind == kind


def test_pieces_of_a_recording_keep_its_clock() -> None:
    recording: Recording = tumble.read_recording(pl.DataFrame(_frame(99.5)), rate="99.5±0.2")
    assert recording.between(5, 400).clock == recording.clock


def test_the_jitter_of_stamps_is_told_from_samples_that_are_irregular() -> None:
    late = np.sort(K / 100.0 + np.abs(0.003 * RNG.standard_normal(K.size)))
    assert stamp_jitter(late) == pytest.approx(0.003 * np.sqrt(1.0 - 2.0 / np.pi), rel=0.1)
    irregular = np.cumsum(0.01 + 0.002 * RNG.standard_normal(K.size))
    assert stamp_jitter(irregular) < 0.0006
    assert stamp_jitter(K / 100.0) < 1e-12
    with_gap = np.delete(late, np.arange(500, 700))
    assert stamp_jitter(with_gap) == pytest.approx(stamp_jitter(late), rel=0.1)
