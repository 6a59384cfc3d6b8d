"""What is not rest is found, said, and left out; what is left is analysed."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from tumble.errors import RecordingError
from tumble.noise.characterisation import characterise
from tumble.noise.evidence import RestEvidence
from tumble.noise.suitability import judge_rest
from tumble.recording import Recording

RATE = 50.0
N_G, N_A = 1e-4, 2e-3


@pytest.fixture
def without_models(monkeypatch: pytest.MonkeyPatch) -> None:
    """No model is fitted, which takes the longest, where a test asks what is done before."""
    from tumble.noise import channel

    monkeypatch.setattr(channel, "_fit", lambda octaves, lines, method: (None, "left out by the test"))


def at_rest(samples: int = 30_000, seed: int = 0) -> Recording:
    """White noise alone: sigma of a sample is N √rate."""
    rng = np.random.default_rng(seed)
    return Recording(
        time=np.arange(samples) / RATE,
        specific_force=N_A * np.sqrt(RATE) * rng.standard_normal((samples, 3)) + [0.1, 0.2, 9.8],
        angular_rate=N_G * np.sqrt(RATE) * rng.standard_normal((samples, 3)) + [0.01, -0.02, 0.005],
        specific_force_unit="m/s^2",
        angular_rate_unit="rad/s",
        rate=RATE,
    )


def spoiled(recording: Recording, **changes: np.ndarray) -> Recording:
    return replace(recording, **changes)


def test_a_good_rest_is_taken_whole_and_without_a_word() -> None:
    found = judge_rest(RestEvidence.of(at_rest()))
    assert found.pieces == ((0, 30_000),)
    assert found.remarks == ()


def test_white_noise_is_found_in_every_channel_and_nothing_else() -> None:
    """N from 30,000 samples is known to 0.4 %; five of these sigmas."""
    found = characterise(at_rest())
    assert [channel.name for channel in found.channels] == ["ax", "ay", "az", "gx", "gy", "gz"]
    for channel in found.channels:
        expected = N_G if channel.is_gyro else N_A
        white = channel.term("N")
        assert white is not None
        assert white.value == pytest.approx(expected, rel=0.02)
        assert channel.unit == ("rad/s" if channel.is_gyro else "m/s²")
        assert "B" in channel.unseen


@pytest.mark.usefixtures("without_models")
@pytest.mark.parametrize(("unit", "factor"), [("deg/s", np.degrees(1.0)), ("mrad/s", 1e3)])
def test_the_files_unit_makes_no_difference(unit: str, factor: float) -> None:
    plain = at_rest()
    assert plain.angular_rate is not None
    other = spoiled(plain, angular_rate=factor * plain.angular_rate, angular_rate_unit=unit)  # type: ignore[arg-type]
    first, second = characterise(plain).channels[4], characterise(other).channels[4]
    assert second.curve.deviation == pytest.approx(first.curve.deviation, rel=1e-9)


def test_counts_stay_counts() -> None:
    plain = at_rest()
    assert plain.angular_rate is not None
    counts = spoiled(plain, angular_rate=np.round(1e6 * plain.angular_rate), angular_rate_unit="counts")  # type: ignore[arg-type]
    channel = characterise(counts).channels[3]
    white = channel.term("N")
    assert channel.unit == "counts"
    assert white is not None
    assert white.value == pytest.approx(1e6 * N_G, rel=0.02)


@pytest.mark.usefixtures("without_models")
def test_motion_is_cut_out_and_said() -> None:
    moved = at_rest()
    assert moved.angular_rate is not None
    moved.angular_rate[10_000:11_000] += np.random.default_rng(1).standard_normal((1000, 3))
    found = characterise(moved)
    assert "not at rest" in found.sentences[0]
    assert len(found.suitability.pieces) == 2
    assert all(stop <= 10_000 or start >= 11_000 for start, stop in found.suitability.pieces)
    assert found.channels[3].curve.deviation[0, 0] == pytest.approx(N_G * np.sqrt(RATE), rel=0.02)


def test_a_unit_that_moves_throughout_is_refused_in_words() -> None:
    """Smooth motion as of a hand, alike from the first second to the last."""
    moving = at_rest(20_000)
    assert moving.angular_rate is not None
    assert moving.specific_force is not None
    moving.angular_rate[:] += 0.8 * np.sin(np.outer(moving.time, [2.0, 3.1, 4.7]))
    moving.specific_force[:] += 3.0 * np.sin(np.outer(moving.time, [2.3, 1.1, 1.9]))
    with pytest.raises(RecordingError, match="never rests"):
        characterise(moving)


@pytest.mark.usefixtures("without_models")
def test_a_step_in_the_middle_parts_the_recording_where_it_is() -> None:
    stepped = at_rest()
    assert stepped.angular_rate is not None
    stepped.angular_rate[17_345:, 2] += 0.002
    found = characterise(stepped)
    [said] = [text for text in found.sentences if "steps by" in text]
    assert said.startswith("gz steps by 0.00")
    assert float(said.split("t = ")[1].split(" s")[0]) == pytest.approx(346.9, abs=0.2)
    (_, first), (second, _) = found.suitability.pieces
    assert first <= 17_345 <= second
    assert second - first < 100


def test_nothing_but_dead_channels_is_refused() -> None:
    dead = at_rest(100)
    dead = spoiled(dead, specific_force=np.ones((100, 3)), angular_rate=np.zeros((100, 3)))
    with pytest.raises(RecordingError, match="No channel ever changes"):
        characterise(dead)


@pytest.mark.usefixtures("without_models")
def test_repeated_rows_are_said_and_taken_once() -> None:
    slow = at_rest(10_000)
    assert slow.angular_rate is not None
    twice = Recording(
        np.arange(20_000) / (2.0 * RATE),
        None,
        np.repeat(slow.angular_rate, 2, axis=0),
        "m/s^2",
        "rad/s",
        2.0 * RATE,
    )
    found = characterise(twice)
    assert "50 % of the rows repeat" in found.sentences[0]
    assert "50 Hz" in found.sentences[0]
    # The sensor's own density, known to 0.7 %: four of these.
    assert found.channels[0].curve.deviation[0, 0] == pytest.approx(N_G * np.sqrt(RATE), rel=0.03)
    assert found.rate == pytest.approx(RATE, rel=1e-3)


def rows(recording: Recording, keep: np.ndarray) -> Recording:
    """Only the rows of `keep`."""
    force, rate = (np.asarray(part)[keep] for part in (recording.specific_force, recording.angular_rate))
    return replace(recording, time=recording.time[keep], specific_force=force, angular_rate=rate)


@pytest.mark.usefixtures("without_models")
def test_a_few_lost_samples_do_not_bound_the_averaging_times() -> None:
    whole = at_rest()
    keep = np.ones(len(whole), dtype=bool)
    keep[[700, 9000, 9001, 20_000]] = False
    holed = rows(whole, keep)
    gaps = tuple(int(i) + 1 for i in np.flatnonzero(np.diff(holed.time) > 1.5 / RATE))
    found = characterise(replace(holed, gaps=gaps))
    assert "4 lost sample(s) in 3 place(s) are filled in" in found.sentences[0]
    assert found.suitability.pieces == ((0, 30_000),)
    whole_curve = characterise(whole).channels[0].curve
    # Four samples of 30,000 take no more than that off the variance, and scatter as little.
    assert found.channels[0].curve.deviation[:20] == pytest.approx(whole_curve.deviation[:20], rel=1e-3)


@pytest.mark.usefixtures("without_models")
def test_many_gaps_are_pooled_and_said() -> None:
    whole = at_rest()
    keep = np.ones(len(whole), dtype=bool)
    keep[10_000:12_000] = False
    found = characterise(replace(rows(whole, keep), gaps=(10_000,)))
    assert "Samples are missing in 1 place(s)" in found.sentences[0]
    assert found.suitability.pieces == ((0, 10_000), (10_000, 28_000))


@pytest.mark.usefixtures("without_models")
def test_warm_up_is_said_with_the_seconds_to_skip() -> None:
    warming = at_rest(60_000)
    assert warming.angular_rate is not None
    warming.angular_rate[:, 0] += 0.003 * np.exp(-warming.time / 60.0)
    found = characterise(warming)
    said = [text for text in found.sentences if "warms up" in text]
    assert len(said) == 1
    assert said[0].startswith("gx: the level drifts")
    seconds = float(said[0].split("--skip ")[1].split("`")[0])
    assert 60.0 < seconds < 600.0
    assert not [text for text in characterise(warming, skip=600.0).sentences if "warms up" in text]


@pytest.mark.usefixtures("without_models")
def test_a_temperature_trend_is_said_and_can_be_taken_off() -> None:
    celsius = 25.0 + 8.0 * np.sin(np.arange(60_000) / 15_000.0)
    drifting = replace(at_rest(60_000), temperature=celsius)
    assert drifting.angular_rate is not None
    drifting.angular_rate[:, 1] += 1e-4 * celsius
    found = characterise(drifting)
    [said] = [text for text in found.sentences if "follows the temperature" in text]
    assert said.startswith("gy follows")
    assert float(said.split("(")[1].split(" rad/s per °C")[0]) == pytest.approx(1e-4, rel=0.02)
    freed = characterise(drifting, remove_temperature=True)
    assert not any("follows the temperature" in text for text in freed.sentences)
    assert freed.channels[4].curve.deviation[-8, 0] < 0.2 * found.channels[4].curve.deviation[-8, 0]


def test_three_seconds_are_enough_for_white_noise_and_it_is_said_what_they_are_not_enough_for() -> None:
    found = characterise(at_rest(150))
    white = found.channels[0].term("N")
    assert white is not None
    assert white.value == pytest.approx(N_A, rel=0.3)
    assert any("very short (3 s" in text for text in found.sentences)


def test_less_than_sixteen_samples_are_refused() -> None:
    with pytest.raises(RecordingError, match="16 samples"):
        characterise(at_rest(12))


def test_skipping_everything_is_refused() -> None:
    with pytest.raises(RecordingError, match="leaves nothing"):
        characterise(at_rest(100), skip=3600.0)


@pytest.mark.usefixtures("without_models")
def test_rounding_to_coarse_steps_is_said() -> None:
    coarse = at_rest()
    assert coarse.angular_rate is not None
    step = 5.0 * N_G * np.sqrt(RATE)
    found = characterise(spoiled(coarse, angular_rate=step * np.round(coarse.angular_rate / step)))
    assert any("less than one step of the converter" in text for text in found.sentences)


@pytest.mark.parametrize("period", [20.0, 120.0])
def test_a_unit_that_sways_slowly_is_said_not_to_rest(period: float) -> None:
    """A degree is 17 mrad of gravity, far below the scatter that stands for motion, second by second."""
    rest = at_rest()
    lean = np.radians(1.0) * np.sin(2.0 * np.pi * rest.time / period)
    swayed = rest.specific_force + 9.8 * np.column_stack([np.sin(lean), 0.0 * lean, np.cos(lean) - 1.0])
    found = judge_rest(RestEvidence.of(spoiled(rest, specific_force=swayed)))
    # a tenth of the time a sine is beyond 0.988 of its amplitude; its means of a second, about its median, by less
    said = next(
        text for text in found.remarks if text.startswith("Gravity goes to and fro in the unit's axes by ")
    )
    angle = re.search(r"([0-9.]+)°", said)
    assert angle is not None
    assert float(angle[1]) == pytest.approx(0.98, abs=0.015)


def test_a_bias_that_drifts_by_three_mg_is_no_sway() -> None:
    rest = at_rest()
    drift = 0.03 * np.linspace(-1.0, 1.0, len(rest))[:, None] * [1.0, -1.0, 0.5]
    found = judge_rest(RestEvidence.of(spoiled(rest, specific_force=rest.specific_force + drift)))
    assert not any("Gravity" in said for said in found.remarks)
