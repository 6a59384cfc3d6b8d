"""Targets whose form holds less than a matrix of each triad: by their own formulas."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import yaml
from msgspec import structs
from tests.unit.export.a_unit import B_A, B_G, M_A, M_G, RAW_A, RAW_G, G, document

from tumble.document.result import RecordingName
from tumble.errors import UsageError
from tumble.export.subject import Wishes, prepare
from tumble.export.target import targets
from tumble.sensor import ImuModel, Triad

TARGETS = targets()

GRAVITY = 9.80665


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


def test_the_topic_is_the_recording_s_unless_another_is_asked_for() -> None:
    """Of recordings of two topics neither is."""
    model = ImuModel(Triad(M_A, B_A), Triad(M_G, B_G), G)

    def topic_of(*recorded: str | None, asked: str | None = None) -> str:
        names = [RecordingName(name="a.bag", sha256="0" * 64, topic=topic) for topic in recorded]
        made = structs.replace(document(model), recordings=names)
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


def test_mpu6050_s_header_compiles_and_works_a_register_out(tmp_path: Path) -> None:
    if shutil.which("g++") is None:
        pytest.skip("g++ is not installed")
    header = text_of("mpu6050", ImuModel(Triad(M_A, B_A), Triad(M_G, B_G)), largest_loss=0.05)
    (tmp_path / "mpu6050_offsets.h").write_text(header)
    (tmp_path / "a.cpp").write_text(
        '#include <stdio.h>\n#include "mpu6050_offsets.h"\nint main() { printf("%d %d\\n",'
        " mpu6050_accel_register(-2735, 0), mpu6050_accel_register(1184, 1)); }\n"
    )
    flags = ["-Wall", "-Wextra", "-Werror", "-Wno-unused-variable"]
    subprocess.run(["g++", *flags, "a.cpp", "-o", "a"], check=True, cwd=tmp_path)
    said = subprocess.run([tmp_path / "a"], check=True, capture_output=True, text=True).stdout
    add = numbers(header, "MPU6050_ACCEL_ADD")
    assert said.split() == [str(register_after(there, int(add[i]))) for i, there in enumerate((-2735, 1184))]
