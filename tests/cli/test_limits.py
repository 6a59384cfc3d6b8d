"""Limits on the command line: exit status, JSON, the terminal and the report say whether a unit is within them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

GRAVITY = 9.81


@pytest.fixture
def limits(tmp_path: Path) -> Any:
    def write(text: str) -> Path:
        path = tmp_path / "limits.yaml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_a_fit_calibration_of_a_unit_out_of_limits_is_not_accepted(
    tumble: Any, recording: Path, tmp_path: Path, limits: Any
) -> None:
    tight = limits("limits: {accelerometer bias: 0.001 mg}\n")
    answer = tumble("calibrate", recording, "--gravity", GRAVITY, "-o", tmp_path / "made", "--limits", tight)
    assert answer.status == 1
    assert "FIT FOR USE\n" in answer.out
    assert "NOT FIT FOR USE" not in answer.out
    assert "OUT OF LIMITS" in answer.out
    document = json.loads((tmp_path / "made" / "calibration.json").read_text(encoding="utf-8"))
    assert document["verdict"]["fit"] is True
    assert document["limits"]["decision"] == "failed"
    page = (tmp_path / "made" / "report.html").read_text(encoding="utf-8")
    assert "Out of limits" in page


def test_a_unit_within_limits_is_accepted(tumble: Any, recording: Path, tmp_path: Path, limits: Any) -> None:
    wide = limits("rule: guarded\nlimits: {accelerometer bias: 1 g, gyro scale factor error: 20 %}\n")
    answer = tumble("calibrate", recording, "--gravity", GRAVITY, "-o", tmp_path / "made", "--limits", wide)
    assert answer.status == 0
    assert "WITHIN LIMITS" in answer.out


def test_verify_says_both(tumble: Any, calibrated: Path, recording: Path, limits: Any) -> None:
    tight = limits("limits: {accelerometer bias: 0.001 mg}\n")
    answer = tumble("verify", calibrated, recording, "--limits", tight, "--json")
    assert answer.status == 1
    (result,) = json.loads(answer.out)
    assert result["fit"] is True
    assert result["limits"]["decision"] == "failed"


def test_unreadable_limits_are_refused_before_any_work(
    tumble: Any, recording: Path, tmp_path: Path, limits: Any
) -> None:
    answer = tumble(
        "calibrate", recording, "-o", tmp_path / "gone", "--limits", limits("limits: {bias: 1 mg}")
    )
    answer.is_told(2, "'bias' is no parameter")
    tumble("calibrate", recording, "-o", tmp_path / "gone", "--limits", tmp_path / "none.yaml").is_told(2)
    assert not (tmp_path / "gone").exists()
