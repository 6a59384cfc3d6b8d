"""Temperature for autopilots: their own polynomials, evaluated as their sources do, follow the thermal model."""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from tumble.document import read_calibration
from tumble.document.imported import calibration_from_model
from tumble.document.result import Calibration
from tumble.document.thermal_block import thermal_block
from tumble.errors import CalibrationFileError, UsageError
from tumble.export.subject import Wishes, prepare
from tumble.export.target import targets
from tumble.sensor import ImuModel, Triad
from tumble.sensor.thermal import TemperatureBasis, ThermalModel
from tumble.workflows.convert import convert_from

TARGETS = targets()

REFERENCE = ImuModel(
    Triad(np.diag([1.01, 0.99, 1.02]), np.array([0.1, -0.2, 0.05])),
    Triad(np.eye(3), np.array([0.01, 0.0, -0.02])),
)
CUBIC = {
    "accelerometer.bias": np.array([[2e-3, -1e-3, 5e-4], [1e-5, 2e-5, -3e-5], [4e-7, -3e-7, 1e-7]]),
    "gyroscope.bias": np.array([[3e-4, 1e-4, -2e-4], [-2e-6, 3e-6, 1e-6], [5e-8, 0.0, -4e-8]]),
}
RAW_A, RAW_G = np.array([1.0, 2.0, 9.5]), np.array([0.1, -0.2, 0.3])


def document(model: ThermalModel) -> Calibration:
    block = thermal_block(model, model.names, 1e-12 * np.eye(len(model.names)))
    bare = calibration_from_model(
        model.reference, ("m/s^2", "rad/s"), ("fixture", "axes"), [], procedure="by hand", remarks=[]
    )
    return structs.replace(bare, thermal=block, temperature_celsius=model.basis.reference_celsius)


def cubic(lowest: float = -20.0, **more: object) -> Calibration:
    basis = TemperatureBasis("polynomial", 22.0, order=3)
    return document(ThermalModel(REFERENCE, basis, CUBIC, span_celsius=(lowest, 60.0), **more))  # type: ignore[arg-type]


def truth(calibration: Calibration, celsius: float) -> tuple[np.ndarray, np.ndarray]:
    thermal = calibration.thermal_model
    there = thermal.at(celsius)
    force, rate = there.correct(RAW_A[None], RAW_G[None])
    return force[0], rate[0]


def by_px4(text: str, celsius: float, force: np.ndarray = RAW_A) -> tuple[np.ndarray, np.ndarray]:
    """TemperatureCompensation.h: offset by Horner in the clipped difference; then offset and scale."""
    p = {w[2]: float(w[3]) for line in text.splitlines() if len(w := line.split("\t")) == 5}
    assert p["TC_A_ENABLE"] == p["TC_G_ENABLE"] == 1
    out = []
    for letter, raw, off, scale in (("A", force, "CAL_ACC0", True), ("G", RAW_G, "CAL_GYRO0", False)):
        t = min(max(celsius, p[f"TC_{letter}0_TMIN"]), p[f"TC_{letter}0_TMAX"]) - p[f"TC_{letter}0_TREF"]
        x = [np.array([p[f"TC_{letter}0_X{k}_{axis}"] for axis in range(3)]) for k in range(4)]
        offset = ((x[3] * t + x[2]) * t + x[1]) * t + x[0]
        value = raw - offset - np.array([p[f"{off}_{axis}OFF"] for axis in "XYZ"])
        out.append(value * np.array([p[f"{off}_{axis}SCALE"] for axis in "XYZ"]) if scale else value)
    return out[0], out[1]


def by_ardupilot(text: str, celsius: float, force: np.ndarray = RAW_A) -> tuple[np.ndarray, np.ndarray]:
    """AP_InertialSensor_tempcal.cpp: v -= P(T - 35), v += P(T_cal - 35), P(d) = (c1 + (c2 + c3 d) d) d 1e-6."""
    p = {n: float(v) for n, v in (line.split(",") for line in text.splitlines() if not line.startswith("#"))}
    assert p["INS_TCAL1_ENABLE"] == 1
    out = []
    for kind, raw, off in (("ACC", force, "INS_ACCOFFS"), ("GYR", RAW_G, "INS_GYROFFS")):
        c = [np.array([p[f"INS_TCAL1_{kind}{k}_{axis}"] for axis in "XYZ"]) for k in (1, 2, 3)]

        def P(T: float, c: list[np.ndarray] = c) -> np.ndarray:
            d = min(max(T, p["INS_TCAL1_TMIN"]), p["INS_TCAL1_TMAX"]) - 35.0
            return (c[0] + (c[1] + c[2] * d) * d) * d * 1e-6

        value = (
            raw - P(celsius) + P(p[f"INS_{kind}1_CALTEMP"]) - np.array([p[f"{off}_{axis}"] for axis in "XYZ"])
        )
        out.append(value * np.array([p[f"INS_ACCSCAL_{axis}"] for axis in "XYZ"]) if kind == "ACC" else value)
    return out[0], out[1]


by_each = pytest.mark.parametrize(("name", "evaluate"), [("px4", by_px4), ("ardupilot", by_ardupilot)])


@pytest.mark.parametrize(
    ("low", "celsius"), [*product([-20.0], [-20.0, 3.0, 22.0, 41.0, 60.0]), (30.0, 41.0)]
)
@by_each
def test_the_autopilot_s_polynomials_follow_the_model(
    name: str, evaluate: Any, low: float, celsius: float
) -> None:
    """Single precision of parameters: 6e-8 of terms up to 10 m/s² (scale) and of their sums."""
    calibration = cubic(low)  # about 22 °C, within the span or not
    target = TARGETS[name]
    text = "".join(target.write(prepare(calibration, target)).values())
    force, rate = evaluate(text, celsius)
    expected = truth(calibration, celsius)
    assert np.allclose(force, expected[0], rtol=0, atol=3e-6)
    assert np.allclose(rate, expected[1], rtol=0, atol=1e-7)


def test_other_targets_take_one_temperature_of_those_that_were_calibrated() -> None:
    subject = prepare(cubic(), TARGETS["matlab"], Wishes(temperature=40.0))
    force, rate = subject.model.correct(RAW_A[None], RAW_G[None])
    assert np.allclose((force[0], rate[0]), truth(cubic(), 40.0), rtol=0, atol=1e-13)
    for taken, why in ((cubic(), "taken at 90"), (structs.replace(cubic(), thermal=None), "no thermal")):
        with pytest.raises(UsageError, match=why):
            prepare(taken, TARGETS["matlab"], Wishes(temperature=90.0))


def test_hysteresis_rate_and_lag_are_said_to_be_left_out() -> None:
    calibration = cubic(hysteresis={"accelerometer.bias": np.array([5e-3, 0.0, -2e-3])}, lag=30.0)
    text = "".join(TARGETS["px4"].write(prepare(calibration, TARGETS["px4"])).values())
    assert f"hysteresis of temperature is left out: up to {5e-3 / 9.80665 * 1e6:.0f} µg" in text
    assert "lag are left out" in text


@by_each
def test_lines_are_fitted_by_a_cubic_whose_misfit_is_said(name: str, evaluate: Any) -> None:
    """What is said of it, and the test vector, are those of the file's own numbers in the firmware's formula."""
    basis = TemperatureBasis("linear", 20.0, np.array([-20.0, 20.0, 60.0]))
    lines = np.array([[0.1, 0.0, 0.0], [0.1, 0.0, 0.0]])
    terms = {"accelerometer.bias": lines, "gyroscope.bias": 1e-3 * lines}
    calibration = document(ThermalModel(REFERENCE, basis, terms, span_celsius=(-20.0, 60.0)))
    text = "".join(TARGETS[name].write(prepare(calibration, TARGETS[name])).values())
    found = text.partition("cubic polynomials here: off by up to ")[2].partition(" mg")[0]
    # |t| on [-1, 1] by a parabola in least squares: 15/16 t² + 3/16, off by 3/16 at the kink.
    assert abs(float(found) - 0.1 * 3 / 16 / 9.80665 * 1e3) < 0.06
    off = max(abs(evaluate(text, c)[0] - truth(calibration, c)[0]).max() for c in np.linspace(-20, 60, 81))
    assert 1.01 * off * 1e3 / 9.80665 == pytest.approx(float(found), abs=0.05)  # two digits
    raw, true = (
        json.loads(text.partition(f" {what} ")[2].partition("],")[0] + "]")
        for what in ("raw specific force", "corrected to")
    )
    assert np.allclose(evaluate(text, 20.0, np.array(raw))[0], true, rtol=0, atol=3e-6)


@pytest.mark.parametrize("name", ["px4", "ardupilot"])
def test_what_was_exported_reads_back_with_its_temperatures(tmp_path: Path, name: str) -> None:
    """Single precision of the parameters, as above; the round trip goes through the command's own function."""
    calibration = cubic()
    target = TARGETS[name]
    ((file, text),) = target.write(prepare(calibration, target)).items()
    (tmp_path / file).write_text(text)
    convert_from(tmp_path / file, name, output=tmp_path / "back.json")
    back = read_calibration(tmp_path / "back.json")
    assert back.thermal is not None
    assert back.thermal.span_celsius == (-20.0, 60.0)
    assert back.temperature_celsius == pytest.approx(22.0)
    for celsius in (-20.0, 3.0, 22.0, 41.0, 60.0):
        expected, found = truth(calibration, celsius), truth(back, celsius)
        assert np.allclose(found[0], expected[0], rtol=0, atol=3e-6)
        assert np.allclose(found[1], expected[1], rtol=0, atol=1e-7)


PX4 = """1\t1\tCAL_ACC0_ID\t1310988\t6
1\t1\tCAL_ACC0_XOFF\t0.5\t9\n1\t1\tCAL_ACC0_YOFF\t0\t9\n1\t1\tCAL_ACC0_ZOFF\t0\t9
1\t1\tTC_A_ENABLE\t1\t6
"""


def px4_curve(number: int, identity: int, x1: float) -> str:
    rows = {"ID": identity, "TREF": 40, "TMIN": 20, "TMAX": 60}
    rows |= {f"X{power}_{axis}": x1 * (power == 1) for power in range(4) for axis in range(3)}
    return "".join(f"1\t1\tTC_A{number}_{name}\t{value}\t9\n" for name, value in rows.items())


def test_px4_s_curve_is_that_of_the_sensor_with_the_same_number(tmp_path: Path) -> None:
    path = tmp_path / "a.params"
    path.write_text(PX4 + px4_curve(0, 7, 0.1) + px4_curve(1, 1310988, 0.01))
    convert_from(path, "px4", output=tmp_path / "a.json")
    model = read_calibration(tmp_path / "a.json").thermal_model
    assert model is not None
    warm = model.at(50.0).accelerometer
    assert np.allclose(warm.bias, [0.6, 0.1, 0.1])
    path.write_text(PX4 + px4_curve(0, 7, 0.1))
    found = convert_from(path, "px4", output=tmp_path / "b.json")
    assert read_calibration(tmp_path / "b.json").thermal is None
    assert any("is for other sensors" in remark for remark in found.remarks)


def test_a_compensation_that_lacks_a_number_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.params"
    path.write_text(PX4 + px4_curve(0, 1310988, 0.1).replace("TC_A0_X2_1", "TC_A0_OTHER"))
    with pytest.raises(CalibrationFileError, match="switches TC_A_ENABLE on but lacks TC_A0_X2_1"):
        convert_from(path, "px4", output=tmp_path / "a.json")
    path.write_text(PX4 + px4_curve(0, 1310988, 0.1).replace("TMAX\t60", "TMAX\t10"))
    with pytest.raises(CalibrationFileError, match=r"spans nothing \(20 to 10 °C\)"):
        convert_from(path, "px4", output=tmp_path / "a.json")


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
    model = read_calibration(tmp_path / "a.json").thermal_model
    there = model.at(60.0)
    # 1e-3 ((60 - 35)² - (T_cal - 35)²)
    assert np.allclose(there.accelerometer.bias, np.array([0.5, 0, 0]) + 1e-3 * (625 - 225))
    assert np.allclose(there.gyroscope.bias, np.array([0.01, 0, 0]) + 1e-3 * (625 - 100))
