"""`tumble denoise` as a user meets it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble.recording import read_recording

RATE = 100.0


@pytest.fixture(scope="module")
def moved() -> np.ndarray:
    """60 s at rest, a swing of 5 s in two channels, 60 s at rest."""
    rng = np.random.default_rng(21)
    count = 12_500
    time = np.arange(count) / RATE
    force = 0.02 * rng.standard_normal((count, 3)) + [0.05, -0.1, 9.81]
    turn = 0.002 * rng.standard_normal((count, 3)) + [0.001, 0.002, -0.003]
    swing = np.where((time >= 60.0) & (time < 65.0), np.sin(2.0 * np.pi * 0.8 * (time - 60.0)), 0.0)
    turn[:, 2] += 1.5 * swing
    force[:, 0] += 3.0 * swing
    return np.column_stack([time, force, turn])


def test_the_noise_goes_the_motion_stays_and_a_statement_says_so(
    tumble: Any, written: Any, moved: np.ndarray, tmp_path: Path
) -> None:
    path = written(tmp_path / "moved.csv", moved)
    answer = tumble("denoise", path, "-o", tmp_path / "quiet.csv")
    assert (answer.status, answer.err) == (0, "")
    for words in (
        "does not know motion from noise",
        "Do not calibrate",
        "left exactly as they were",
        "delay",
        "Allan",
    ):
        assert words in answer.out
    before, after = read_recording(path), read_recording(tmp_path / "quiet.csv")
    assert after.time == pytest.approx(before.time, abs=0.0)
    assert after.angular_rate is not None
    assert before.angular_rate is not None
    swing = slice(6005, 6495)
    assert after.angular_rate[swing] == pytest.approx(before.angular_rate[swing], abs=0.0)
    document = json.loads((tmp_path / "quiet.denoise.json").read_text(encoding="utf-8"))
    assert (document["format"], document["version"]) == ("tumble denoise", 1)
    channel = document["channels"]["ay"]
    scatter = channel["scatter_at_rest"]
    # 12,000 samples know a standard deviation to 0.65 %.
    assert scatter["before"] == pytest.approx(0.02, rel=0.03)
    assert 0.3 < scatter["before_standard_uncertainty"] / (0.02 / np.sqrt(2 * 12_000)) < 3.0
    level = channel["settings"]["level"]
    assert level >= 5
    assert scatter["after"] < 1.5 * 0.02 * 2.0 ** (-0.5 * level)
    assert channel["bandwidth_hz"] == RATE / 2.0 ** (level + 1)
    curve = channel["allan_deviation"]
    assert len(curve["tau_s"]) == len(curve["before"]) == len(curve["after"])
    # The means of the rests stay where they were, against what they are known to.
    for part in (slice(0, 6000), slice(6500, 12_500)):
        moved_mean = after.angular_rate[part].mean(axis=0) - before.angular_rate[part].mean(axis=0)
        assert np.abs(moved_mean).max() < 0.5 * 0.002 / np.sqrt(6000)


def test_motion_may_be_filtered_too_and_survives(
    tumble: Any, written: Any, moved: np.ndarray, tmp_path: Path
) -> None:
    path = written(tmp_path / "moved.csv", moved)
    answer = tumble("denoise", path, "-o", tmp_path / "quiet.parquet", "--motion", "filter")
    assert answer.status == 0
    assert "99.9 % of the motion's power is below" in answer.out
    truth = np.where(
        (moved[:, 0] >= 60.0) & (moved[:, 0] < 65.0),
        1.5 * np.sin(2.0 * np.pi * 0.8 * (moved[:, 0] - 60.0)),
        0.0,
    )
    after = read_recording(tmp_path / "quiet.parquet").angular_rate
    assert after is not None
    off = after[:, 2] + 0.003 - truth
    # In the swing the scatter falls too, and is no more than the sensor's anywhere.
    assert off[6010:6490].std() < 0.7 * 0.002
    assert off.std() < 0.7 * 0.002


def test_an_autoregression_follows_the_level_and_says_its_delay(
    tumble: Any, written: Any, moved: np.ndarray, tmp_path: Path
) -> None:
    path = written(tmp_path / "moved.csv", moved)
    answer = tumble("denoise", path, "--method", "ar", "-o", tmp_path / "quiet.csv", "--json")
    assert answer.status == 0
    channel = json.loads(answer.out)["channels"]["gy"]
    assert channel["delay_s"] > 0.0
    assert channel["settings"]["order_by"] == "BIC"
    assert channel["settings"]["residuals_white_probability"] > 1e-4
    assert channel["scatter_at_rest"]["after"] < 0.2 * channel["scatter_at_rest"]["before"]


def test_nothing_is_ever_written_over(
    tumble: Any, written: Any, moved: np.ndarray, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path / "moved.csv", moved)
    content = path.read_bytes()
    (tmp_path / "a.denoise.json").write_text("mine", encoding="utf-8")
    for target, why in ((path, "is one of the inputs"), (tmp_path / "a.csv", "is there already")):
        answer = tumble("denoise", path, "-o", target)
        assert answer.status == 2
        assert why in answer.err
    assert path.read_bytes() == content
    assert (tmp_path / "a.denoise.json").read_text(encoding="utf-8") == "mine"
    assert not (tmp_path / "a.csv").exists()
    monkeypatch.chdir(tmp_path)
    assert tumble("denoise", "moved.csv", "-q").status == 0
    assert tumble("denoise", "moved.csv", "-q").status == 2
    assert (tmp_path / "moved-denoised.csv").exists()


def test_a_dead_channel_a_gap_and_lost_numbers_are_lived_with(
    tumble: Any, written: Any, moved: np.ndarray, tmp_path: Path
) -> None:
    broken = moved.copy()
    broken[:, 2] = -0.1
    broken[3000:3050, 5] = np.nan
    broken = np.delete(broken, slice(9000, 9400), axis=0)
    path = written(tmp_path / "broken.csv", broken)
    for method in ("wavelet", "ar"):
        answer = tumble("denoise", path, "--method", method, "-o", tmp_path / f"{method}.csv")
        assert answer.status == 0, answer.err
        assert "never changes at rest" in answer.out
        assert "No filter reaches across" in answer.out
        assert read_recording(tmp_path / f"{method}.csv").gaps


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--method", "kalman"], "wavelet or ar"),
        (["--level", "0"], "1 or more"),
        (["--level", "25"], "No rest is long enough"),
        (["--order", "2"], "--method ar"),
        (["--method", "ar", "--order", "-1"], "from 0 to 100"),
        (["--method", "ar", "--level", "3"], "of --method wavelet"),
        (["--method", "ar", "--motion", "filter"], "knows no motion"),
        (["--motion", "both"], "keep or filter"),
        (["--threshold", "best"], "sure, universal or remove"),
        (["--threshold", "sure", "--shape", "hard"], "Stein"),
        (["--wavelet", "mexh"], "no orthogonal wavelet"),
        (["-o", "out.txt"], ".csv or .parquet"),
        (["-o", "."], "is a folder"),
    ],
)
def test_wrong_options_end_in_a_sentence(
    tumble: Any,
    written: Any,
    moved: np.ndarray,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    options: list[str],
    words: str,
) -> None:
    written(tmp_path / "moved.csv", moved[:2000])
    monkeypatch.chdir(tmp_path)
    answer = tumble("denoise", "moved.csv", *options)
    assert answer.status == 2
    assert words in answer.err
    assert len(answer.err.splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["moved.csv"]


def test_a_recording_that_never_rests_ends_in_a_sentence(
    tumble: Any, written: Any, moved: np.ndarray, tmp_path: Path
) -> None:
    moving = moved[:3000].copy()
    moving[:, 4:] += 0.9 * np.sin(np.outer(moving[:, 0], [2.0, 3.0, 5.0]))
    moving[:, 1:4] += 2.0 * np.sin(np.outer(moving[:, 0], [1.3, 2.9, 2.1]))
    answer = tumble("denoise", written(tmp_path / "moving.csv", moving), "-o", tmp_path / "out.csv")
    assert answer.status == 2
    assert "No rest was found" in answer.err
    assert len(answer.err.splitlines()) == 1
    assert not (tmp_path / "out.csv").exists()


def test_rows_that_repeat_are_taken_once_and_said(
    tumble: Any, written: Any, moved: np.ndarray, tmp_path: Path
) -> None:
    held = np.column_stack([moved[:3000, 0], np.repeat(moved[:750, 1:], 4, axis=0)])
    answer = tumble("denoise", written(tmp_path / "held.csv", held), "-o", tmp_path / "quiet.csv")
    assert (answer.status, answer.err) == (0, "")
    assert "each value stands 4 times" in answer.out
    assert len(read_recording(tmp_path / "quiet.csv")) == 750


def test_channels_that_never_change_are_refused_and_nothing_is_written(
    tumble: Any, written: Any, moved: np.ndarray, tmp_path: Path
) -> None:
    dead = moved[:500].copy()
    dead[:, 1:] = [0.1, 0.2, 9.8, 0.01, 0.02, 0.03]
    answer = tumble("denoise", written(tmp_path / "dead.csv", dead), "-o", tmp_path / "quiet.csv")
    assert answer.status == 2
    assert "No channel ever changes" in answer.err
    assert [path.name for path in tmp_path.iterdir()] == ["dead.csv"]
