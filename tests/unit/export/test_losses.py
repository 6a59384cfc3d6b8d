"""What a target cannot hold is told with its size: the size is what the corrected vectors are off by."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec import structs
from tests.unit.export.a_unit import B_A, B_G, M_A, M_G, document

from tumble.document.result import Calibration
from tumble.document.thermal_block import thermal_block
from tumble.errors import UsageError
from tumble.export.subject import Subject, Wishes, prepare
from tumble.export.target import targets
from tumble.sensor import ImuModel, Triad
from tumble.sensor.thermal import TemperatureBasis, ThermalModel

TARGETS = targets()

ACCELEROMETER = Triad(M_A, B_A)
GYROSCOPE = Triad(M_G, B_G)
STANDARD_GRAVITY = 9.80665


def thermal_document(model: ThermalModel) -> Calibration:
    block = thermal_block(model, model.names, 1e-12 * np.eye(len(model.names)))
    update = {"thermal": block, "temperature_celsius": model.basis.reference_celsius}
    return structs.replace(document(model.reference), **update)


def losses(subject: Subject) -> str:
    return "\n".join(loss.text for loss in subject.losses)


def between(text: str, before: str, after: str) -> float:
    assert before in text, text
    return float(text.partition(before)[2].partition(after)[0])


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
    assert between(text, "hold at 20 °C: up to ", " mg") == round(0.04 / STANDARD_GRAVITY * 1e3, 1)
    assert between(text, " mg and ", " °/s") == round(np.degrees(4e-3), 2)


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
    reference = ImuModel(Triad(np.diag([1.01, 0.99, 1.02]), np.zeros(3)), Triad(np.eye(3), np.zeros(3)))
    terms = {"accelerometer.bias": np.array([[1e-3, 0.0, 0.0]])}
    basis = TemperatureBasis("polynomial", 20.0, order=1)
    warm = thermal_document(ThermalModel(reference, basis, terms, span_celsius=(0.0, 40.0)))
    with pytest.raises(UsageError, match="written in its own frame: leave --frame accelerometer-z out"):
        prepare(warm, TARGETS["px4"], Wishes(frame="accelerometer-z"))
