"""`tumble predict`, and `tumble calibrate --monte-carlo`, as a user meets them."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from tumble.document.part import read_part
from tumble.report.predictions import FilterDocument


def test_predict_answers_in_words_and_for_machines(tumble: Any, calibrated: Path) -> None:
    answer = tumble("predict", calibrated, "--seconds", 30, "--data-sheet", "tactical")
    assert answer.status == 0, answer
    assert "30 s at rest" in answer.out.replace("\n", " ")
    assert "come on top" in answer.out
    told = json.loads(tumble("predict", calibrated, "--seconds", 30, "--seconds", 60, "--json").out)[
        "answers"
    ]
    after = {row["question"]: row["standard_uncertainty"] for row in told}
    assert len(told) == 7
    # Between t² and t³: twice the time is four to eight times the error.
    assert 4.0 < after["60 s at rest, rms of 26 poses"] / after["30 s at rest, rms of 26 poses"] < 8.0


def test_a_prediction_names_the_states_of_a_filter(tumble: Any, calibrated: Path, tmp_path: Path) -> None:
    answer = tumble("predict", calibrated, "--seconds", 60, "-o", tmp_path, "--json")
    assert answer.status == 0, answer
    told = json.loads(answer.out)
    error = told["straight_course"][0]
    parts = error["horizontal_of_calibration"], error["horizontal_of_noise"]
    # independent of one another; the digits are of round-off
    assert error["horizontal"] == pytest.approx(math.hypot(*parts), rel=1e-9)
    written = json.loads((tmp_path / "filter.json").read_text(encoding="utf-8"))
    assert written == told["filter"]
    assert read_part(FilterDocument, written).seconds == [60.0]
    assert {state["column"] for state in written["states"]} == {None, 0, 1, 2}
    carried = {state["name"]: state for state in written["states"] if state["carry"]}
    assert {"gyroscope bias x", "gyroscope bias y"} <= set(carried)
    assert all(state["sigma"] > 0.0 for state in carried.values())


def test_biases_that_moved_count_and_states_are_in_the_words_of_the_report(
    tumble: Any, calibrated: Path
) -> None:
    options = ("predict", calibrated, "--seconds", 60, "--turn-on-bias", "5,100")
    told = json.loads(tumble(*options, "--json").out)["filter"]["states"]
    sigma = {state["name"]: state["sigma"] for state in told}
    assert sigma["accelerometer bias y"] > 5.0 * 9.80665e-3
    assert sigma["gyroscope bias y"] > math.radians(100.0 / 3600.0)
    answer = tumble(*options)
    assert answer.status == 0, answer
    assert "States for a filter" in answer.out
    assert "gyro bias x" in answer.out
    assert "gyroscope." not in answer.out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--seconds", "3600"), "at most 600"),
        (("--seconds", "0"), "at least 0.1"),
        (("--turn-on-bias", "1"), "--turn-on-bias takes 2 numbers"),
        (("--turn-on-bias=-1,10",), "not negative"),
        (("--data-sheet", "nonsense"), "nonsense"),
    ],
)
def test_what_cannot_be_predicted_is_one_sentence(
    tumble: Any, calibrated: Path, arguments: tuple[str, ...], words: str
) -> None:
    tumble("predict", calibrated, *arguments).is_told(2, words)


def test_predict_wants_a_calibration(tumble: Any, tmp_path: Path) -> None:
    tumble("predict", tmp_path / "none.json").is_told(2, "no calibration")


def test_too_few_draws_are_refused_before_anything_is_read(tumble: Any, tmp_path: Path) -> None:
    answer = tumble("calibrate", tmp_path / "none.csv", "--monte-carlo", 10, "-o", tmp_path / "out")
    answer.is_told(2, "from 1000 to 1000000")
    assert not (tmp_path / "out").exists()
