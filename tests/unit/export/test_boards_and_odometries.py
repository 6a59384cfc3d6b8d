"""Targets whose form holds less than a matrix of each triad, and Arduino's, compiled: by their own formulas."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import yaml

from tumble.document.imported import calibration_from_model
from tumble.document.result import Calibration, RecordingName
from tumble.errors import UsageError
from tumble.export.subject import Wishes, prepare
from tumble.export.target import targets
from tumble.sensor import ImuModel, Triad

TARGETS = targets()

GRAVITY = 9.80665
M_A = np.array([[1.012, 0.004, -0.007], [-0.009, 0.991, 0.006], [0.003, -0.012, 1.011]])
M_G = np.array([[0.991, -0.006, 0.004], [0.003, 1.009, -0.002], [-0.007, 0.002, 1.004]])
B_A, B_G = np.array([0.11, -0.23, 0.34]), np.array([0.012, -0.034, 0.021])
G = np.array([[1.1e-3, -4e-4, 2e-4], [3e-4, -9e-4, 6e-4], [-7e-4, 5e-4, 8e-4]])
RAW_A = np.array([[1.0, 2.0, 9.5], [-8.0, 3.0, -4.0], [0.3, -9.9, 1.2]])
RAW_G = np.array([[0.1, -0.2, 0.3], [-1.5, 0.7, 0.2], [0.0, 2.0, -1.0]])


def document(model: ImuModel, units: tuple[str, str] = ("m/s^2", "rad/s")) -> Calibration:
    return calibration_from_model(model, units, ("fixture", "its axes"), [], procedure="by hand", remarks=[])


def text_of(name: str, model: ImuModel, units: tuple[str, str] = ("m/s^2", "rad/s"), **wishes: float) -> str:
    target = TARGETS[name]
    return next(iter(target.write(prepare(document(model, units), target, Wishes(**wishes))).values()))


def test_dlio_s_matrix_is_by_rows_and_its_biases_come_after_it() -> None:
    """callbackImu: lin_accel_corrected = imu_accel_sm * lin_accel - bias; ang_vel - bias."""
    model = ImuModel(Triad(M_A, B_A), Triad(np.eye(3), B_G))
    text = text_of("dlio", model)
    imu = yaml.safe_load(text)["dlio"]["imu"]
    assert imu["calibration"] is False
    sm = np.array(imu["intrinsics"]["accel"]["sm"]).reshape(3, 3)
    force = RAW_A @ sm.T - imu["intrinsics"]["accel"]["bias"]
    np.testing.assert_allclose(force, np.linalg.solve(M_A, (RAW_A - B_A).T).T, atol=1e-12)
    np.testing.assert_allclose(RAW_G - imu["intrinsics"]["gyro"]["bias"], RAW_G - B_G, atol=1e-15)
    turned = np.array(yaml.safe_load(text_of("dlio", ImuModel(Triad(M_A.T.copy(), B_A), Triad(np.eye(3), B_G))))
                      ["dlio"]["imu"]["intrinsics"]["accel"]["sm"])  # fmt: skip
    assert np.abs(turned - sm.ravel()).max() > 5e-3


def test_the_topic_is_the_recording_s_unless_another_is_asked_for() -> None:
    """Of recordings of two topics neither is."""
    model = ImuModel(Triad(M_A, B_A), Triad(M_G, B_G), G)

    def topic_of(*recorded: str | None, asked: str | None = None) -> str:
        names = [RecordingName(name="a.bag", sha256="0" * 64, topic=topic) for topic in recorded]
        made = document(model).model_copy(update={"recordings": names})
        return prepare(made, TARGETS["python"], Wishes(topic=asked)).topic

    assert topic_of("/left/imu") == topic_of("/left/imu", "/left/imu") == "/left/imu"
    assert topic_of() == topic_of(None) == topic_of("/left/imu", "/right/imu") == "/imu0"
    assert topic_of("/left/imu", asked="/mine") == "/mine"


def numbers(text: str, name: str) -> np.ndarray:
    found = re.search(rf"{name}\[3\] = \{{(.*?)\}};", text)
    assert found
    return np.array([int(part) for part in found[1].split(",")])


def register_after(there: int, add: int) -> int:
    """By the application note: the sum, with bit 0 of what stood there."""
    return (there + add) // 2 * 2 + there % 2


@pytest.mark.parametrize(("full", "counts"), [(2, 16384), (4, 8192), (8, 4096), (16, 2048)])
def test_mpu6050_s_registers_take_the_bias_out_in_any_range(full: int, counts: int) -> None:
    """The chip by the note: output = input + register - factory's, in the scale of ±8 g and ±1000 °/s."""
    per_dps = {2: 131.0, 4: 65.5, 8: 32.8, 16: 16.4}[full]
    bias_g, bias_dps = np.array([0.031, -0.052, 0.083]), np.array([1.7, -2.9, 0.6])
    per_rad = per_dps * 180 / np.pi
    model = ImuModel(
        Triad(counts / GRAVITY * np.eye(3), counts * bias_g), Triad(per_rad * np.eye(3), per_dps * bias_dps)
    )
    text = text_of("mpu6050", model, (f"{counts} LSB/g", f"{per_dps} LSB/(deg/s)"))
    add, gyro = numbers(text, "MPU6050_ACCEL_ADD"), numbers(text, "MPU6050_GYRO_ADD")
    factory = np.array([-2735, 1184, 987])
    made = np.array([register_after(int(f), int(a)) for f, a in zip(factory, add, strict=True)])
    assert np.array_equal(made % 2, factory % 2)
    true = np.array([0.1, -0.2, 0.95])
    output = true + bias_g + (made - factory) / 4096.0
    np.testing.assert_allclose(output, true, atol=2.5 / 4096.0)
    np.testing.assert_allclose(bias_dps + gyro / 32.8, 0.0, atol=0.51 / 32.8)
    assert np.all(add * bias_g < 0.0)


def test_mpu6050_refuses_what_no_register_holds() -> None:
    text = text_of("mpu6050", ImuModel(Triad(M_A, B_A), Triad(M_G, B_G)), largest_loss=0.05)
    assert "loss: biases are rounded to the registers" in text
    with pytest.raises(UsageError, match="does not fit into the MPU-6050's registers"):
        text_of("mpu6050", ImuModel(Triad(np.eye(3), 1000 * B_A), Triad(np.eye(3), B_G)), largest_loss=0.05)


@pytest.mark.parametrize("name", ["arduino", "mpu6050"])
@pytest.mark.parametrize("compiler", ["gcc", "g++"])
def test_the_headers_compile_and_correct(name: str, compiler: str, tmp_path: Path) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    model = ImuModel(Triad(M_A, B_A), Triad(M_G, B_G), G if name == "arduino" else None)
    header = {"arduino": "tumble_arduino.h", "mpu6050": "mpu6050_offsets.h"}[name]
    (tmp_path / header).write_text(text_of(name, model, largest_loss=0.05))
    if name == "arduino":
        rows = ",".join(
            "{" + ",".join(f"{v}f" for v in np.r_[a, g]) + "}" for a, g in zip(RAW_A, RAW_G, strict=True)
        )
        body = (
            f"static const float rows[3][6] = {{{rows}}}; int main(void) {{ int k; for (k = 0; k < 3; ++k) {{"
            " float f[3], w[3]; tumble_correct(rows[k], rows[k] + 3, f, w);"
            ' printf("%.9g %.9g %.9g %.9g %.9g %.9g\\n", f[0], f[1], f[2], w[0], w[1], w[2]); } return 0; }'
        )
    else:
        two = "mpu6050_accel_register(-2735, 0), mpu6050_accel_register(1184, 1)"
        body = f'int main(void) {{ printf("%d %d\\n", {two}); return 0; }}'
    source = tmp_path / ("a.c" if compiler == "gcc" else "a.cpp")
    source.write_text(f'#include <stdio.h>\n#include "{header}"\n{body}\n')
    command = [
        compiler,
        "-Wall",
        "-Wextra",
        "-Werror",
        "-Wno-unused-variable",
        str(source),
        "-o",
        str(tmp_path / "a"),
    ]
    subprocess.run([*command, *(["-std=c99"] if compiler == "gcc" else [])], check=True)
    said = subprocess.run([str(tmp_path / "a")], check=True, capture_output=True, text=True).stdout
    made = np.array([line.split() for line in said.splitlines()], dtype=float)
    if name == "arduino":
        force = np.linalg.solve(M_A, (RAW_A - B_A).T).T
        rate = np.linalg.solve(M_G, (RAW_G - B_G - force @ G.T).T).T
        np.testing.assert_allclose(made, np.hstack([force, rate]), atol=3e-6)
    else:
        add = numbers((tmp_path / header).read_text(), "MPU6050_ACCEL_ADD")
        assert made.ravel().tolist() == [
            register_after(-2735, int(add[0])),
            register_after(1184, int(add[1])),
        ]
