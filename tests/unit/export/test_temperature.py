"""Temperature for autopilots: their own polynomials, evaluated as their sources do, follow the thermal model."""

import json
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import structs
from tests.unit.export.a_unit import (
    GRAVITY_UNIT,
    TARGETS,
    ardupilot,
    parameters,
    px4,
    px4_thermal,
    thermal_document,
)

from tumble.document import Calibration, read_calibration
from tumble.errors import CalibrationFileError, UsageError
from tumble.export.preparing import prepare
from tumble.export.subject import Wishes
from tumble.sensor import ImuModel, TemperatureBasis, ThermalModel, Triad
from tumble.workflows import convert_from

REFERENCE = ImuModel(
    Triad(np.diag([1.01, 0.99, 1.02]), np.array([0.1, -0.2, 0.05])),
    Triad(np.eye(3), np.array([0.01, 0.0, -0.02])),
)
CUBIC = {
    "accelerometer.bias": np.array([[2e-3, -1e-3, 5e-4], [1e-5, 2e-5, -3e-5], [4e-7, -3e-7, 1e-7]]),
    "gyroscope.bias": np.array([[3e-4, 1e-4, -2e-4], [-2e-6, 3e-6, 1e-6], [5e-8, 0.0, -4e-8]]),
}
RAW_A, RAW_G = np.array([[1.0, 2.0, 9.5]]), np.array([[0.1, -0.2, 0.3]])


def cubic(lowest: float = -20.0, **more: Any) -> Calibration:
    basis = TemperatureBasis("polynomial", 22.0, order=3)
    return thermal_document(ThermalModel(REFERENCE, basis, CUBIC, span_celsius=(lowest, 60.0), **more))


def text_of(name: str, calibration: Calibration) -> str:
    return "".join(TARGETS[name].write(prepare(calibration, TARGETS[name])).values())


def truth(calibration: Any, celsius: float) -> tuple[np.ndarray, np.ndarray]:
    return calibration.thermal_model.at(celsius).correct(RAW_A, RAW_G)


def by_firmware(name, text, celsius, force=RAW_A) -> tuple[np.ndarray, np.ndarray]:
    p = parameters(text)
    if name == "px4":
        thermal = [px4_thermal(letter, p, celsius) for letter in "AG"]
        return px4("ACC", force, p, thermal[0]), px4("GYRO", RAW_G, p, thermal[1])
    assert p["INS_TCAL1_ENABLE"] == 1
    return ardupilot("ACC", force, p, celsius), ardupilot("GYR", RAW_G, p, celsius)


def assert_close(found: tuple[np.ndarray, np.ndarray], expected: tuple[np.ndarray, np.ndarray]) -> None:
    """Single precision of parameters: 6e-8 of terms up to 10 m/s² (scale) and of their sums."""
    np.testing.assert_allclose(found[0], expected[0], rtol=0, atol=3e-6)
    np.testing.assert_allclose(found[1], expected[1], rtol=0, atol=1e-7)


@pytest.mark.parametrize("name", ["px4", "ardupilot"])
class TestAutopilot:
    @pytest.mark.parametrize("low", [-20.0, 30.0])
    def test_its_polynomials_follow_the_model_and_read_back(self, name, low, tmp_path) -> None:
        """About 22 °C, within the span or not."""
        calibration = cubic(low)
        temperatures = (-20.0, 3.0, 22.0, 41.0, 60.0) if low < 22.0 else (41.0,)
        for celsius in temperatures:
            assert_close(by_firmware(name, text_of(name, calibration), celsius), truth(calibration, celsius))
        (tmp_path / TARGETS[name].file).write_text(text_of(name, calibration))
        convert_from(tmp_path / TARGETS[name].file, name, output=tmp_path / "back.json")
        back = read_calibration(tmp_path / "back.json")
        assert back.thermal.span_celsius == (low, 60.0)
        for celsius in temperatures:
            assert_close(truth(back, celsius), truth(calibration, celsius))
        if low < 22.0:
            assert back.temperature_celsius == pytest.approx(22.0)

    def test_lines_are_fitted_by_a_cubic_whose_misfit_is_said(self, name: str) -> None:
        """What is said of it, and the test vector, are those of the file's own numbers in the firmware's formula."""
        basis = TemperatureBasis("linear", 20.0, np.array([-20.0, 20.0, 60.0]))
        lines = np.array([[0.1, 0.0, 0.0], [0.1, 0.0, 0.0]])
        terms = {"accelerometer.bias": lines, "gyroscope.bias": 1e-3 * lines}
        calibration = thermal_document(ThermalModel(REFERENCE, basis, terms, span_celsius=(-20.0, 60.0)))
        text = text_of(name, calibration)
        found = text.partition("cubic polynomials here: off by up to ")[2].partition(" mg")[0]
        # |t| on [-1, 1] by a parabola in least squares: 15/16 t² + 3/16, off by 3/16 at the kink.
        assert abs(float(found) - 0.1 * 3 / 16 / GRAVITY_UNIT * 1e3) < 0.06
        everywhere = np.linspace(-20, 60, 81)
        off = max(abs(by_firmware(name, text, c)[0] - truth(calibration, c)[0]).max() for c in everywhere)
        assert 1.01 * off * 1e3 / GRAVITY_UNIT == pytest.approx(float(found), abs=0.05)  # two digits
        raw, true = (
            json.loads(text.partition(f" {what} ")[2].partition("],")[0] + "]")
            for what in ("raw specific force", "corrected to")
        )
        assert np.allclose(by_firmware(name, text, 20.0, np.array([raw]))[0], true, rtol=0, atol=3e-6)


def test_other_targets_take_one_temperature_of_those_that_were_calibrated() -> None:
    subject = prepare(cubic(), TARGETS["matlab"], Wishes(temperature=40.0))
    assert np.allclose(subject.model.correct(RAW_A, RAW_G), truth(cubic(), 40.0), rtol=0, atol=1e-13)
    bare = structs.replace(cubic(), thermal=None)
    for taken, name, wishes, why in (
        (cubic(), "matlab", {"temperature": 90.0}, "taken at 90"),
        (bare, "matlab", {"temperature": 90.0}, "no thermal"),
        (cubic(), "px4", {"frame": "accelerometer-z"}, "in its own frame: leave --frame accelerometer-z out"),
    ):
        with pytest.raises(UsageError, match=why):
            prepare(taken, TARGETS[name], Wishes(**wishes))


def test_hysteresis_rate_and_lag_are_said_to_be_left_out() -> None:
    text = text_of("px4", cubic(hysteresis={"accelerometer.bias": np.array([5e-3, 0.0, -2e-3])}, lag=30.0))
    assert f"hysteresis of temperature is left out: up to {5e-3 / GRAVITY_UNIT * 1e6:.0f} µg" in text
    assert "lag are left out" in text


def test_temperature_that_is_left_out_is_as_large_as_the_farthest_end() -> None:
    """1 mm/s² and 1e-4 rad/s a kelvin along one axis of a unit matrix, from 20 to 60 °C: forty of each."""
    ideal = ImuModel(Triad(np.eye(3), np.zeros(3)), Triad(np.eye(3), np.zeros(3)))
    slopes = {"accelerometer.bias": np.diag([0, 1e-3, 0])[1:2], "gyroscope.bias": np.diag([0, 0, -1e-4])[2:]}
    basis = TemperatureBasis("polynomial", 20.0, order=1)
    made = thermal_document(ThermalModel(ideal, basis, slopes, span_celsius=(-10.0, 60.0)))
    said = "\n".join(loss.text for loss in prepare(made, TARGETS["matlab"]).losses)
    size = f"{0.04 / GRAVITY_UNIT * 1e3:.1f} mg and {np.degrees(4e-3):.2f} °/s"
    assert f"hold at 20 °C: up to {size}" in said


PX4 = """1\t1\tCAL_ACC0_ID\t1310988\t6
1\t1\tCAL_ACC0_XOFF\t0.5\t9\n1\t1\tCAL_ACC0_YOFF\t0\t9\n1\t1\tCAL_ACC0_ZOFF\t0\t9
1\t1\tTC_A_ENABLE\t1\t6
"""


def px4_curve(number: int, identity: int, x1: float) -> str:
    rows = {"ID": identity, "TREF": 40, "TMIN": 20, "TMAX": 60}
    rows |= {f"X{power}_{axis}": x1 * (power == 1) for power in range(4) for axis in range(3)}
    return "".join(f"1\t1\tTC_A{number}_{name}\t{value}\t9\n" for name, value in rows.items())


def test_px4_s_curve_is_that_of_the_sensor_with_the_same_number_and_whole(tmp_path: Path) -> None:
    path, made = tmp_path / "a.params", tmp_path / "a.json"
    path.write_text(PX4 + px4_curve(0, 7, 0.1) + px4_curve(1, 1310988, 0.01))
    convert_from(path, "px4", output=made)
    assert np.allclose(read_calibration(made).thermal_model.at(50.0).accelerometer.bias, [0.6, 0.1, 0.1])
    path.write_text(PX4 + px4_curve(0, 7, 0.1))
    assert "is for other sensors" in " ".join(convert_from(path, "px4", output=made).remarks)
    assert read_calibration(made).thermal is None
    for change, words in (
        (("TC_A0_X2_1", "TC_A0_OTHER"), "switches TC_A_ENABLE on but lacks TC_A0_X2_1"),
        (("TMAX\t60", "TMAX\t10"), r"spans nothing \(20 to 10 °C\)"),
    ):
        path.write_text(PX4 + px4_curve(0, 1310988, 0.1).replace(*change))
        with pytest.raises(CalibrationFileError, match=words):
            convert_from(path, "px4", output=tmp_path / "b.json")


def test_ardupilot_s_curves_may_be_of_two_temperatures(tmp_path: Path) -> None:
    """Accelerometers calibrated at 20 °C, gyros at 45 °C: P is about 35 °C for both."""
    lines = "INS_ACCOFFS_X,0.5 INS_ACCOFFS_Y,0 INS_ACCOFFS_Z,0 INS_GYROFFS_X,0.01 INS_GYROFFS_Y,0 INS_GYROFFS_Z,0 "
    lines += "INS_TCAL1_ENABLE,1 INS_TCAL1_TMIN,0 INS_TCAL1_TMAX,70 INS_ACC1_CALTEMP,20 INS_GYR1_CALTEMP,45"
    lines += " STAT_RUNTIME,5,@READONLY"
    for kind, n, axis in product(("ACC", "GYR"), (1, 2, 3), "XYZ"):
        lines += f" INS_TCAL1_{kind}{n}_{axis},{1e3 if n == 2 else 0}"
    for enabled in (2, 1):  # 2 learns, and compensates nothing
        (tmp_path / "a.parm").write_text(lines.replace("ENABLE,1", f"ENABLE,{enabled}").replace(" ", "\n"))
        convert_from(tmp_path / "a.parm", "ardupilot", output=tmp_path / "a.json")
        assert (read_calibration(tmp_path / "a.json").thermal is None) == (enabled == 2)
    there = read_calibration(tmp_path / "a.json").thermal_model.at(60.0)
    # 1e-3 ((60 - 35)² - (T_cal - 35)²)
    assert np.allclose(there.accelerometer.bias, np.array([0.5, 0, 0]) + 1e-3 * (625 - 225))
    assert np.allclose(there.gyroscope.bias, np.array([0.01, 0, 0]) + 1e-3 * (625 - 100))
