"""`tumble predict`, and `tumble calibrate --monte-carlo`, as a user meets them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest


def test_predict_answers_in_words_and_for_machines(tumble: Any, calibrated: Path) -> None:
    answer = tumble("predict", calibrated, "--seconds", 30, "--turn", 180, "--data-sheet", "tactical")
    assert answer.status == 0, answer
    assert "30 s at rest" in answer.out.replace("\n", " ")
    assert "come on top" in answer.out
    told = json.loads(
        tumble("predict", calibrated, "--seconds", 30, "--seconds", 60, "--turn", 180, "--json").out
    )
    after = {row["question"]: row["standard_uncertainty"] for row in told}
    assert len(told) == 7
    # Between t² and t³: twice the time is four to eight times the error.
    assert 4.0 < after["60 s at rest, rms of 26 poses"] / after["30 s at rest, rms of 26 poses"] < 8.0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--seconds", "3600"), "at most 600"),
        (("--seconds", "0"), "more than 0"),
        (("--turn", "-90"), "--turn -90"),
        (("--turn-rate", "0"), "--turn-rate 0"),
        (("--data-sheet", "nonsense"), "nonsense"),
    ],
)
def test_what_cannot_be_predicted_is_one_sentence(
    tumble: Any, calibrated: Path, arguments: tuple[str, ...], words: str
) -> None:
    answer = tumble("predict", calibrated, *arguments)
    assert answer.status == 2
    assert words in answer.err
    assert "Traceback" not in answer.err
    assert not answer.out


def test_predict_wants_a_calibration(tumble: Any, tmp_path: Path) -> None:
    answer = tumble("predict", tmp_path / "none.json")
    assert answer.status == 2
    assert "no calibration" in answer.err


def test_too_few_draws_are_refused_before_anything_is_read(tumble: Any, tmp_path: Path) -> None:
    answer = tumble("calibrate", tmp_path / "none.csv", "--monte-carlo", 10, "-o", tmp_path / "out")
    assert answer.status == 2
    assert "from 1000 to 1000000" in answer.err
    assert not (tmp_path / "out").exists()


def test_draws_need_the_joint_estimator(tumble: Any, recording: Path, tmp_path: Path) -> None:
    answer = tumble(
        *("calibrate", recording, "--procedure", "multi-position", "--gravity", 9.81),
        *("--monte-carlo", 1000, "-o", tmp_path / "out"),
    )
    assert answer.status == 2
    assert "--procedure joint" in answer.err
    assert not (tmp_path / "out" / "calibration.json").exists()
