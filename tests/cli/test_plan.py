"""`tumble plan` as a user meets it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

COMMAND = ("plan", "strapdown-rotation", "--imu", "ring-laser", "--site", "48.1")


def is_told(answer: Any, status: int, *words: str) -> None:
    assert answer.status == status, answer
    assert len(answer.err.splitlines()) == 1, answer.err
    assert "fault of tumble" not in answer.err
    for word in words:
        assert word in answer.err


def test_a_tenth_of_a_degree_suffices_for_a_navigation_unit_and_it_is_said_in_words(tumble: Any) -> None:
    answer = tumble(*COMMAND, "--fixture-mrad", 1.75)
    assert answer.status == 0, answer
    said = " ".join(answer.out.split())
    assert "A fixture good to 0.10° (1.75 mrad)" in said
    assert "suffices" in said
    for words in ("gyro noise", "heading × Earth rate", "total", "ppm", "µrad", "µg", "What would help"):
        assert words in said


def test_every_parameter_is_listed_on_request(tumble: Any) -> None:
    """The x gyro's scale factor has the gyro's noise among its largest sources."""
    answer = tumble(*COMMAND, "-v")
    line = next(line for line in answer.out.splitlines() if "kappa xx " in line)
    assert "ppm" in line
    assert "accelerometer noise" in line
    assert "mu zy" in answer.out


def test_a_heading_that_is_lost_does_not_suffice(tumble: Any) -> None:
    answer = tumble(*COMMAND, "--heading-mrad", 90, "-q")
    assert "does not suffice" in " ".join(answer.out.split())


def test_the_file_is_the_answer_for_machines(tumble: Any, tmp_path: Path) -> None:
    target = tmp_path / "budget.json"
    answer = tumble(*COMMAND, "--monte-carlo", 50, "-o", target, "--json")
    document = json.loads(answer.out)
    assert document == json.loads(target.read_text(encoding="utf-8"))
    assert len(document["parameters"]) == 24
    for parameter in document["parameters"]:
        total = np.sqrt(sum(value**2 for value in parameter["by_source"].values()))
        assert parameter["standard_uncertainty"] == pytest.approx(total)
        # 50 draws: an rms within a factor of two
        assert 0.5 < parameter["drawn_rms"] / total < 2.0
    assert document["settings"]["fixture"]["heading"] == 1e-3
    assert document["settings"]["site"]["latitude_deg"] == pytest.approx(48.1)


def test_longer_rests_and_own_numbers_of_a_data_sheet_count(tumble: Any) -> None:
    def totals(*options: object) -> np.ndarray:
        document = json.loads(tumble(*COMMAND, "--json", *options).out)
        return np.array([parameter["standard_uncertainty"] for parameter in document["parameters"]])

    before = totals()
    assert np.all(totals("--hold", 40) < before)
    assert np.all(totals("--accelerometer-noise-ug", 500)[18:] > 3.0 * before[18:])
    assert np.all(
        totals("--gyro-walk-deg-per-root-hour", 0.02, "--gyro-pulse-arcsec", 2)[:9] > 2.0 * before[:9]
    )


def test_the_same_seed_draws_the_same_tests(tumble: Any) -> None:
    runs = [tumble(*COMMAND, "--monte-carlo", 20, "--seed", seed, "--json").out for seed in (1, 1, 2)]
    assert runs[0] == runs[1]
    assert runs[0] != runs[2]


def test_wrong_input_is_refused_in_one_sentence(tumble: Any, tmp_path: Path) -> None:
    is_told(tumble("plan", "turntable"), 2, "strapdown-rotation", "multi-position")
    is_told(tumble("plan", "strapdown-rotation", "--imu", "ringlaser"), 2, "ring-laser")
    is_told(tumble(*COMMAND, "--fixture-mrad", -1), 2, "mounting", "0 to 100 mrad")
    is_told(tumble(*COMMAND, "--heading-mrad", 500), 2, "heading")
    is_told(tumble(*COMMAND, "--hold", 0), 2, "--hold")
    is_told(tumble(*COMMAND, "--turn-rate", 0), 2, "--turn-rate")
    is_told(tumble(*COMMAND, "--pause", -1), 2, "--pause")
    is_told(tumble(*COMMAND, "--play-backs", -1), 2, "play-backs")
    is_told(tumble(*COMMAND, "--monte-carlo", 1), 2, "--monte-carlo")
    is_told(tumble(*COMMAND, "--gyro-pulse-arcsec", "nan"), 2, "--gyro-pulse-arcsec")
    is_told(tumble(*COMMAND, "--azimuth-deg", "inf"), 2, "--azimuth-deg")
    is_told(tumble("plan", "strapdown-rotation", "--gravity", 9.81), 2, "--site")
    is_told(tumble(*COMMAND, "-o", tmp_path), 3, "is a folder")
