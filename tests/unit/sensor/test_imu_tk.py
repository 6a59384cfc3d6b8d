"""imu_tk's convention, with the numbers that imu_tk itself printed for the Xsens recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tumble.sensor import ImuModel, Triad, change_frame, frame_rotation
from tumble.sensor.conventions.imu_tk import MISALIGNMENTS, matrix_from_imu_tk

# Far from the biases on every axis, by different amounts: a transposed or swapped term shows.
RAW_FORCE = (34500.0, 31200.0, 35100.0)
RAW_RATE = (40100.0, 30500.0, 29000.0)


@pytest.fixture
def printed(reference_data: Path) -> dict[str, float]:
    lines = (reference_data / "xsens_mti_hand" / "imu_tk-result.txt").read_text().split("\n")
    return {name: float(value) for name, value in (line.split() for line in lines if line)}


def triad(printed: dict[str, float], kind: str) -> Triad:
    misalignments = np.array([printed[f"{kind}.{name}"] for name in MISALIGNMENTS])
    scale, bias = (
        np.array([printed[f"{kind}.{what}{axis}"] for axis in "XYZ"]) for what in ("scale", "bias")
    )
    return Triad(matrix_from_imu_tk(misalignments, scale), bias)


def by_hand(p: dict[str, float], kind: str, raw: tuple[float, float, float]) -> tuple[float, float, float]:
    """T K (raw - B), scalar by scalar, from imu_tk's calibration.h."""
    x = p[f"{kind}.scaleX"] * (raw[0] - p[f"{kind}.biasX"])
    y = p[f"{kind}.scaleY"] * (raw[1] - p[f"{kind}.biasY"])
    z = p[f"{kind}.scaleZ"] * (raw[2] - p[f"{kind}.biasZ"])
    return (
        x - p[f"{kind}.misYZ"] * y + p[f"{kind}.misZY"] * z,
        p[f"{kind}.misXZ"] * x + y - p[f"{kind}.misZX"] * z,
        -p[f"{kind}.misXY"] * x + p[f"{kind}.misYX"] * y + z,
    )


@pytest.mark.parametrize(("kind", "raw"), [("acc", RAW_FORCE), ("gyro", RAW_RATE)])
def test_our_triad_corrects_as_imu_tk_s_formula_does(
    printed: dict[str, float], kind: str, raw: tuple[float, float, float]
) -> None:
    ours = triad(printed, kind)
    expected = by_hand(printed, kind, raw)
    # round-off of one 3x3 solve
    np.testing.assert_allclose(ours.correct(np.array([raw]))[0], expected, rtol=1e-13)
    transposed = Triad(ours.matrix.T, ours.bias)
    assert np.abs(transposed.correct(np.array([raw]))[0] - expected).max() > 1e-3


def test_in_our_default_frame_the_vectors_are_turned_by_1_3_degrees_and_back(
    printed: dict[str, float],
) -> None:
    imu_tk = ImuModel(triad(printed, "acc"), triad(printed, "gyro"))
    ours = change_frame(imu_tk, "accelerometer-x")
    force, rate = ours.correct(np.array([RAW_FORCE]), np.array([RAW_RATE]))
    expected_force, expected_rate = by_hand(printed, "acc", RAW_FORCE), by_hand(printed, "gyro", RAW_RATE)
    C_zx = frame_rotation(ours.accelerometer.matrix, "accelerometer-z")
    np.testing.assert_allclose(C_zx @ force[0], expected_force, rtol=1e-12)
    np.testing.assert_allclose(C_zx @ rate[0], expected_rate, rtol=1e-12)
    # Not turned, or turned the wrong way, they are not the same.
    for wrong in (np.eye(3), C_zx.T):
        assert np.abs(wrong @ force[0] - expected_force).max() > 0.1
        assert np.abs(wrong @ rate[0] - expected_rate).max() > 0.01
    angle = np.degrees(np.arccos(0.5 * (np.trace(C_zx) - 1.0)))
    assert angle == pytest.approx(1.3, abs=0.05)
