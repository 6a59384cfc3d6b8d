"""What a target cannot hold is told with its size: the size is what the corrected vectors are off by."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tumble.document.imported import calibration_from_model
from tumble.document.result import Calibration
from tumble.document.thermal_block import thermal_block
from tumble.errors import UsageError
from tumble.export.subject import Subject, Wishes, prepare
from tumble.export.target import targets
from tumble.sensor import ImuModel, Triad
from tumble.sensor.thermal import TemperatureBasis, ThermalModel

TARGETS = targets()

M_A = np.array([[1.012, 0.004, -0.007], [-0.009, 0.991, 0.006], [0.003, -0.012, 1.021]])
M_G = np.array([[0.985, -0.011, 0.008], [0.006, 1.017, -0.004], [-0.013, 0.005, 1.008]])
G = np.array([[1.1e-3, -4e-4, 2e-4], [3e-4, -9e-4, 6e-4], [-7e-4, 5e-4, 8e-4]])
ACCELEROMETER = Triad(M_A, np.array([0.11, -0.23, 0.34]))
GYROSCOPE = Triad(M_G, np.array([0.012, -0.034, 0.021]))
STANDARD_GRAVITY = 9.80665


def document(model: ImuModel, units: tuple[str, str] = ("m/s^2", "rad/s"), **update: Any) -> Calibration:
    bare = calibration_from_model(model, units, ("fixture", "axes"), [], procedure="by hand", remarks=[])
    return bare.model_copy(update=update)


def thermal_document(model: ThermalModel) -> Calibration:
    block = thermal_block(model, model.names, 1e-12 * np.eye(len(model.names)))
    return document(model.reference, thermal=block, temperature_celsius=model.basis.reference_celsius)


def losses(subject: Subject) -> str:
    return "\n".join(loss.text for loss in subject.losses)


def between(text: str, before: str, after: str) -> float:
    assert before in text, text
    return float(text.partition(before)[2].partition(after)[0])


def directions(count: int) -> np.ndarray:
    drawn = np.random.default_rng(2).normal(size=(count, 3))
    return drawn / np.linalg.norm(drawn, axis=1, keepdims=True)


def test_a_g_sensitivity_that_is_left_out_is_as_large_as_its_worst_pose() -> None:
    """Of 20,000 poses at 1 g the worst is within 0.1 % of what is told (its square falls off from a maximum)."""
    subject = prepare(document(ImuModel(ACCELEROMETER, GYROSCOPE, G)), TARGETS["basalt"])
    assert subject.model.g_sensitivity is None
    off = np.linalg.solve(M_G, G @ (STANDARD_GRAVITY * directions(20_000)).T)
    worst = float(np.degrees(np.linalg.norm(off, axis=0).max())) * 3600.0
    told = between(losses(subject), "the gyros' g-sensitivity is left out: up to ", " deg/h")
    assert worst * 0.999 < told < worst * 1.006  # three digits


def test_asymmetry_and_quadratic_terms_that_are_left_out_are_no_less_than_the_worst_error() -> None:
    """``x (1 + a |x| / x + q x)`` at 1 g along each axis, both ways, against the correction without a and q."""
    asymmetry, quadratic = np.array([0.0, 8e-4, -3e-4]), np.array([0.0, 0.0, 5e-5])
    bent = replace(ACCELEROMETER, asymmetry=asymmetry, quadratic=quadratic)
    subject = prepare(document(ImuModel(bent, GYROSCOPE)), TARGETS["kalibr"])
    told = between(
        losses(subject), "the accelerometers' asymmetry and quadratic terms are left out: up to ", " ppm"
    )
    # The unit's axes as they stand: rows of M that are one long are on its axis.
    force = STANDARD_GRAVITY * np.vstack([np.eye(3), -np.eye(3)])
    seen = force @ M_A.T
    raw = seen + asymmetry * np.abs(seen) + quadratic * seen**2 + ACCELEROMETER.bias
    straight = ACCELEROMETER.correct(raw)
    bent_back = bent.correct(raw)
    assert np.allclose(bent_back, force, rtol=0, atol=1e-9)
    worst = 1e6 * np.abs(straight - force).max() / STANDARD_GRAVITY
    assert 0.9 * worst < told < 3.0 * worst
    assert "at 1 g" in losses(subject)
    gyros = replace(GYROSCOPE, asymmetry=np.array([1e-4, -4e-4, 0.0]))
    about = losses(prepare(document(ImuModel(ACCELEROMETER, gyros)), TARGETS["kalibr"]))
    assert "the gyros' asymmetry and quadratic terms are left out: up to 400 ppm at 1 rad/s" in about
    # and terms that are there and zero lose nothing
    nothing = replace(ACCELEROMETER, asymmetry=np.zeros(3), quadratic=np.zeros(3))
    assert losses(prepare(document(ImuModel(nothing, GYROSCOPE)), TARGETS["kalibr"])) == ""


def test_lever_arms_that_are_left_out_are_told_by_the_largest_distance() -> None:
    """Of 3, 4 and 12 mm along the axes: x and z are sqrt(9 + 144) mm apart, w² r at 1 rad/s is that in mm/s²."""
    arms = ((0.003, 0.0, 0.0), (0.0, 0.004, 0.0), (0.0, 0.0, 0.012))
    subject = prepare(document(ImuModel(ACCELEROMETER, GYROSCOPE), lever_arms=arms), TARGETS["kalibr"])
    assert "they are up to 13 mm apart, which is 13 mm/s² at 1 rad/s" in losses(subject)


def test_temperature_that_is_left_out_is_as_large_as_the_farthest_end() -> None:
    """1 mm/s² and 1e-4 rad/s a kelvin along one axis of a unit matrix, from 20 to 60 °C: forty of each."""
    reference = ImuModel(Triad(np.eye(3), np.zeros(3)), Triad(np.eye(3), np.zeros(3)))
    slopes = {
        "accelerometer.bias": np.array([[0.0, 1e-3, 0.0]]),
        "gyroscope.bias": np.array([[0.0, 0.0, -1e-4]]),
    }
    basis = TemperatureBasis("polynomial", 20.0, order=1)
    both = thermal_document(ThermalModel(reference, basis, slopes, span_celsius=(-10.0, 60.0)))
    text = losses(prepare(both, TARGETS["matlab"]))
    assert between(text, "-10 to 60 °C up to ", " µg") == round(0.04 / STANDARD_GRAVITY * 1e6)
    assert between(text, " µg and ", " deg/h") == pytest.approx(np.degrees(4e-3) * 3600, rel=3e-3)
    alone = ThermalModel(
        ImuModel(reference.accelerometer, None),
        basis,
        {"accelerometer.bias": slopes["accelerometer.bias"]},
        span_celsius=(-10.0, 60.0),
    )
    text = losses(prepare(thermal_document(alone), TARGETS["matlab"]))
    assert "and 0 deg/h" in text
    assert "the gyros are not calibrated: nominal numbers stand in their place" in text


@pytest.mark.parametrize("units", [("m/s^2", "rad/s"), ("g", "deg/s")])
def test_a_triad_that_is_not_calibrated_is_one_unit_for_one(units: tuple[str, str]) -> None:
    """The numbers that come out are those of the raw units turned to SI, and nothing else."""
    factors = {"m/s^2": 1.0, "g": STANDARD_GRAVITY, "rad/s": 1.0, "deg/s": np.pi / 180.0}
    raw = np.array([[0.3, -0.5, 0.8], [-1.0, 0.2, 0.1]])
    without = prepare(document(ImuModel(None, GYROSCOPE), units), TARGETS["matlab"])
    assert without.model.accelerometer is not None
    force = without.model.accelerometer.correct(
        raw * (factors[units[0]] if without.units[0] == "m/s^2" else 1.0)
    )
    assert np.allclose(force, raw * factors[units[0]], rtol=1e-12)
    assert "the accelerometers are not calibrated" in losses(without)
    without = prepare(document(ImuModel(ACCELEROMETER, None), units), TARGETS["matlab"])
    assert without.model.gyroscope is not None
    rate = without.model.gyroscope.correct(raw * (factors[units[1]] if without.units[1] == "rad/s" else 1.0))
    assert np.allclose(rate, raw * factors[units[1]], rtol=1e-12)
    assert "the gyros are not calibrated" in losses(without)


def test_what_a_conversion_cannot_be_asked_is_said() -> None:
    calibration = document(ImuModel(ACCELEROMETER, GYROSCOPE))
    with pytest.raises(UsageError, match="can only be in the frame accelerometer-x, not in mean-gyro"):
        prepare(calibration, TARGETS["kalibr"], Wishes(frame="mean-gyro"))
    with pytest.raises(UsageError, match="name its calibration"):
        prepare(None, TARGETS["kalibr"])
    reference = ImuModel(Triad(np.diag([1.01, 0.99, 1.02]), np.zeros(3)), Triad(np.eye(3), np.zeros(3)))
    terms = {"accelerometer.bias": np.array([[1e-3, 0.0, 0.0]])}
    basis = TemperatureBasis("polynomial", 20.0, order=1)
    warm = thermal_document(ThermalModel(reference, basis, terms, span_celsius=(0.0, 40.0)))
    with pytest.raises(UsageError, match="written in its own frame: leave --frame accelerometer-z out"):
        prepare(warm, TARGETS["px4"], Wishes(frame="accelerometer-z"))
