"""What is not rest is found, said, and left out; values written several times over are taken once."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from tumble.noise.characterisation import characterise
from tumble.noise.deviation import allan_deviation
from tumble.noise.evidence import RestEvidence
from tumble.noise.held import blocks_without_repeats, find_held, say_held, without_repeats
from tumble.noise.suitability import judge_rest
from tumble.recording import Recording
from unit.given import given, signals

# What is not rest -------------------------------------------------------------------------------------

RATE = 50.0
N_G, N_A = 1e-4, 2e-3


@pytest.fixture(autouse=True)
def without_models(monkeypatch: pytest.MonkeyPatch) -> None:
    """No model is fitted, which takes the longest: what is done before is asked here."""
    monkeypatch.setattr("tumble.noise.channel._fit", lambda octaves, lines, method: (None, "left out"))


def at_rest(samples: int = 30_000, *, add_force: Any = 0.0, add_rate: Any = 0.0, **more: Any) -> Recording:
    """White noise alone, sigma of a sample is N √rate, and what is added to it."""
    rng, size = np.random.default_rng(0), np.sqrt(RATE)
    force = N_A * size * rng.standard_normal((samples, 3)) + [0.1, 0.2, 9.8] + add_force
    turn = N_G * size * rng.standard_normal((samples, 3)) + [0.01, -0.02, 0.005] + add_rate
    return Recording(np.arange(samples) / RATE, force, turn, "m/s^2", "rad/s", RATE, **more)


def in_axis(axis: int, signal: Any) -> np.ndarray:
    return np.asarray(signal)[:, None] * np.eye(3)[axis]


def said(texts: Sequence[str], words: str) -> str:
    (one,) = [text for text in texts if words in text]
    return one


def test_a_good_rest_is_taken_whole_and_without_a_word() -> None:
    found = judge_rest(RestEvidence.of(at_rest()))
    assert found.pieces == ((0, 30_000),)
    assert found.remarks == ()


@pytest.mark.parametrize(
    ("unit", "factor", "shown"),
    [("deg/s", np.degrees(1.0), "rad/s"), ("mrad/s", 1e3, "rad/s"), ("counts", 1e6, "counts")],
)
def test_the_files_unit_makes_no_difference_but_counts_stay_counts(unit, factor, shown):
    plain = at_rest()
    other = replace(plain, angular_rate=factor * given(plain.angular_rate), angular_rate_unit=unit)
    first, second = characterise(plain).channels[4], characterise(other).channels[4]
    assert (first.unit, second.unit) == ("rad/s", shown)
    size = 1e6 if unit == "counts" else 1.0
    assert second.curve.deviation == pytest.approx(size * first.curve.deviation, rel=1e-9)


def test_a_step_in_the_middle_parts_the_recording_where_it_is() -> None:
    found = characterise(at_rest(add_rate=in_axis(2, 0.002 * (np.arange(30_000) >= 17_345))))
    words = said(found.sentences, "steps by")
    assert words.startswith("gz steps by 0.00")
    assert float(words.split("t = ")[1].split(" s")[0]) == pytest.approx(346.9, abs=0.2)
    (_, first), (second, _) = found.suitability.pieces
    assert first <= 17_345 <= second
    assert second - first < 100


def without(lost: Any) -> Recording:
    """A recording without some of its rows."""
    whole = at_rest()
    keep = np.delete(np.arange(len(whole)), lost)
    force, rate = (part[keep] for part in signals(whole))
    gaps = tuple(int(row) + 1 for row in np.flatnonzero(np.diff(keep) > 1))
    return replace(whole, time=whole.time[keep], specific_force=force, angular_rate=rate, gaps=gaps)


def test_a_few_lost_samples_do_not_bound_the_averaging_times_and_many_are_gaps() -> None:
    found = characterise(without([700, 9000, 9001, 20_000]))
    assert "4 lost sample(s) in 3 place(s) are filled in" in found.sentences[0]
    assert found.suitability.pieces == ((0, 30_000),)
    whole = characterise(at_rest()).channels[0].curve
    # Four samples of 30,000 take no more than that off the variance, and scatter as little.
    assert found.channels[0].curve.deviation[:20] == pytest.approx(whole.deviation[:20], rel=1e-3)
    found = characterise(without(slice(10_000, 12_000)))
    assert "Samples are missing in 1 place(s)" in found.sentences[0]
    assert found.suitability.pieces == ((0, 10_000), (10_000, 28_000))


def test_warm_up_is_said_with_the_seconds_to_skip() -> None:
    warming = at_rest(60_000, add_rate=in_axis(0, 0.003 * np.exp(-np.arange(60_000) / RATE / 60.0)))
    words = said(characterise(warming).sentences, "warms up")
    assert words.startswith("gx: the level drifts")
    assert 60.0 < float(words.split("--skip ")[1].split("`")[0]) < 600.0
    assert not [text for text in characterise(warming, skip=600.0).sentences if "warms up" in text]


def test_a_temperature_trend_is_said_and_can_be_taken_off() -> None:
    celsius = 25.0 + 8.0 * np.sin(np.arange(60_000) / 15_000.0)
    drifting = at_rest(60_000, add_rate=in_axis(1, 1e-4 * celsius), temperature=celsius)
    found = characterise(drifting)
    words = said(found.sentences, "follows the temperature")
    assert words.startswith("gy follows")
    assert float(words.split("(")[1].split(" rad/s per °C")[0]) == pytest.approx(1e-4, rel=0.02)
    freed = characterise(drifting, remove_temperature=True)
    assert not any("follows the temperature" in text for text in freed.sentences)
    assert freed.channels[4].curve.deviation[-8, 0] < 0.2 * found.channels[4].curve.deviation[-8, 0]


def test_rounding_to_coarse_steps_is_said() -> None:
    step, rest = 5.0 * N_G * np.sqrt(RATE), at_rest()
    coarse = step * np.round(given(rest.angular_rate) / step)
    found = characterise(replace(rest, angular_rate=coarse))
    assert any("less than one step of the converter" in text for text in found.sentences)


@pytest.mark.parametrize("period", [20.0, 120.0])
def test_a_unit_that_sways_slowly_is_said_not_to_rest(period: float) -> None:
    """A degree is 17 mrad of gravity, far below the scatter that stands for motion, second by second."""
    lean = np.radians(1.0) * np.sin(2.0 * np.pi * np.arange(30_000) / RATE / period)
    swayed = at_rest(add_force=9.8 * np.column_stack([np.sin(lean), 0.0 * lean, np.cos(lean) - 1.0]))
    words = said(
        judge_rest(RestEvidence.of(swayed)).remarks, "Gravity goes to and fro in the unit's axes by "
    )
    # a tenth of the time a sine is beyond 0.988 of its amplitude; its means of a second, about its median, by less
    assert float(words.partition("°")[0].rpartition(" ")[2]) == pytest.approx(0.98, abs=0.015)


def test_a_bias_that_drifts_by_three_mg_is_no_sway() -> None:
    drift = 0.03 * np.linspace(-1.0, 1.0, 30_000)[:, None] * [1.0, -1.0, 0.5]
    found = judge_rest(RestEvidence.of(at_rest(add_force=drift)))
    assert not any("Gravity" in text for text in found.remarks)


# Values that a logger wrote several times over: found, told from chance, and taken once ---------------

Rows = npt.NDArray[np.int64]
LOGGED, SAMPLES = 100.0, 6000


def rest(rows: Rows) -> Recording:
    """A unit at rest whose values stand in rows by their index."""
    values = np.random.default_rng(5).standard_normal((SAMPLES, 6))
    force, turn = 9.8 + 0.02 * values[:, :3], 1e-3 * values[:, 3:]
    return Recording(np.arange(len(rows)) / LOGGED, force[rows], turn[rows], "m/s^2", "rad/s", LOGGED)


def taken_once(recording: Recording) -> Recording:
    return given(without_repeats(recording, given(find_held(recording))))


def held_at(rows_per_value: float) -> Recording:
    return rest(np.floor(np.arange(SAMPLES) / rows_per_value + 1e-9).astype(int))


@pytest.mark.parametrize("rows", [2.0, 3.0, 4.0, 5.0, 10.0, 2.5, 1.04])
def test_values_are_taken_once_at_the_rate_of_new_ones(rows: float) -> None:
    recording = held_at(rows)
    held = given(find_held(recording))
    assert held.rows == pytest.approx(rows, rel=2e-3)
    assert (held.fewest, held.most) == (int(rows), int(np.ceil(rows)))
    once = given(without_repeats(recording, held))
    assert once.rate == pytest.approx(LOGGED / rows, rel=2e-3)
    assert len(once) == len(np.unique(given(recording.specific_force), axis=0))
    assert once.gaps == ()
    assert np.diff(once.time) == pytest.approx(rows / LOGGED, rel=2e-2)
    found = judge_rest(RestEvidence.of(once))
    assert found.samples == len(once)
    assert not any("not at rest" in text or "repeat" in text for text in found.remarks)
    # white noise of 0.02 a value has N = 0.02 over the root of the values' rate
    deviation = allan_deviation(
        given(once.specific_force), once.rate, taus=[1.0 / once.rate], noise=0
    ).deviation
    assert deviation[0] * np.sqrt(1.0 / once.rate) == pytest.approx(0.02 / np.sqrt(LOGGED / rows), rel=0.15)
    assert f"{100.0 * held.share:.0f} % of the rows" in say_held(held)


def test_rows_of_every_length_in_a_jittery_loggers_file_are_taken_once() -> None:
    once = taken_once(rest(np.sort(np.random.default_rng(1).integers(0, SAMPLES // 2, SAMPLES))))
    assert not once.gaps
    assert np.all(np.any(np.diff(given(once.specific_force), axis=0) != 0.0, axis=1))


def test_a_few_repeats_in_no_order_are_told_but_not_taken_out() -> None:
    rng = np.random.default_rng(2)
    index = np.arange(SAMPLES)
    lost = np.flatnonzero(rng.random(SAMPLES) < 0.05)[1:]
    index[lost] -= 1
    recording = rest(index)
    assert find_held(recording) is None
    judged = judge_rest(RestEvidence.of(recording))
    assert any("replaced by the row before" in text for text in judged.remarks)
    assert judged.shortest == pytest.approx(5.0 / (0.95 * LOGGED), rel=0.02)


@pytest.mark.parametrize("step", [0.0, 3.0, 5.0])
def test_a_coarse_converters_repeats_are_chance(step: float) -> None:
    """Channels repeat one by one: at 5 sigma a step four of five rows are like the one before, and none is held."""
    values = np.random.default_rng(3).standard_normal((SAMPLES, 3))
    values = step * np.round(values / step) if step else values
    repeated = np.mean(np.all(np.diff(values, axis=0) == 0.0, axis=1))
    assert repeated > 0.4 or not step
    stamps = np.arange(SAMPLES) / LOGGED
    assert find_held(Recording(stamps, values + 9.8, None, "m/s^2", "rad/s", LOGGED)) is None


def test_a_sensor_that_stood_still_leaves_a_gap_and_a_gap_between_repeats_stays_one() -> None:
    index = np.floor(np.arange(SAMPLES) / 2).astype(int)
    index[2001:2401] = index[2000]
    once = taken_once(rest(index))
    assert once.gaps == (1001,)
    assert once.time[1001] - once.time[1000] == pytest.approx(4.0, abs=0.05)
    recording, keep = held_at(4.0), np.r_[0:2000, 3001:SAMPLES]
    force, rate = (part[keep] for part in signals(recording))
    broken = replace(
        recording, time=recording.time[keep], specific_force=force, angular_rate=rate, gaps=(2000,)
    )
    assert taken_once(broken).gaps == (500,)


def test_block_by_block_the_same_values_are_taken() -> None:
    recording = held_at(3.0)
    held = given(find_held(recording))

    def read() -> Iterator[Recording]:
        for start in range(0, SAMPLES, 701):
            yield recording.between(start, min(start + 701, SAMPLES))

    blocks = list(blocks_without_repeats(read, held)())
    joined = np.concatenate([given(block.angular_rate) for block in blocks])
    assert np.array_equal(joined, given(taken_once(recording).angular_rate))
    assert {block.rate for block in blocks} == {held.rate}
