"""What numbers of data sheets and other programs' files are said to be."""

from __future__ import annotations

from math import isnan, log, pi, sqrt

import pytest

from tumble.errors import UsageError
from tumble.workflows.given.data_sheet import UnitExplanation, explain_unit


def of(answer: UnitExplanation, name: str, unit: str) -> list[float]:
    return [line.value for line in answer.equals if (line.name, line.unit) == (name, unit)]


def test_a_random_walk_in_other_units_and_files() -> None:
    answer = explain_unit(0.15, "deg/√h", 100.0)
    assert (answer.letter, answer.sensor) == ("N", "gyro")
    assert of(answer, "N", "deg/s/√Hz") == pytest.approx([0.0025])
    assert of(answer, "kalibr:gyroscope_noise_density", "rad/s/√Hz") == pytest.approx([0.0025 * pi / 180])
    assert of(answer, "imu_utils:gyr_n", "rad/s") == pytest.approx([0.025 * pi / 180])
    assert of(answer, "a sheet's noise density", "deg/s/√Hz") == pytest.approx([0.0025 * sqrt(2)])


def test_a_bias_instability_has_two_readings_and_is_no_k() -> None:
    answer = explain_unit(2.5, "deg/h")
    floor = sqrt(2 * log(2) / pi)
    assert of(answer, "floor of the Allan deviation", "deg/h") == pytest.approx([2.5 * floor])
    assert of(answer, "B", "deg/h") == pytest.approx([2.5, 2.5 / floor])
    assert "does not follow" in answer.not_convertible[0]


def test_imu_utils_numbers_are_a_sample_s_sigma_and_the_curve_s_floor() -> None:
    assert explain_unit(0.02, "imu_utils:acc_n", 100.0).si == pytest.approx(0.002)
    assert explain_unit(0.664, "imu_utils:gyr_w").si == pytest.approx(1.0, rel=1e-3)  # 0.664 is rounded
    with pytest.raises(UsageError, match="--sample-rate"):
        explain_unit(0.02, "imu_utils:gyr_n")


def test_without_a_rate_a_sample_s_sigma_is_refused_in_a_sentence() -> None:
    assert any("--sample-rate" in sentence for sentence in explain_unit(1.0, "ug/√Hz").not_convertible)


@pytest.mark.parametrize(
    ("value", "unit", "rate"), [(1.0, "bananas", None), (-1.0, "mg", None), (1.0, "mg", 0.0)]
)
def test_what_is_no_noise_is_refused(value: float, unit: str, rate: float | None) -> None:
    with pytest.raises(UsageError):
        explain_unit(value, unit, rate)


@pytest.mark.parametrize("sensor", ["gyroscope", "accelerometer"])
def test_a_line_through_the_whole_curve_is_no_random_walk(sensor: str) -> None:
    answer = explain_unit(2e-5, f"allan_variance_ros:{sensor}_random_walk")
    assert "is none" in answer.meaning
    assert (answer.letter, answer.equals) == ("", ())
    assert isnan(answer.si)
    assert "`tumble noise`" in answer.not_convertible[0]


def test_a_density_may_be_a_sheets_one_sided_one_and_both_readings_are_shown() -> None:
    answer = explain_unit(60.0, "ug/√Hz")
    assert "one-sided" in answer.meaning
    readings = [line for line in answer.equals if line.name == "N" and line.unit == "ug/√Hz"]
    assert [line.value for line in readings] == pytest.approx([60.0, 60.0 / sqrt(2.0)])
    assert "one-sided" in readings[1].assumption
    assert "one-sided" not in explain_unit(0.3, "deg/√h").meaning
