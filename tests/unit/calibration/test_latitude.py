"""A vertical Earth rate that stands in the g-sensitivity is told from a sensor's own by its one number."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import tumble
from second_simulator import GRADES, PROCEDURES
from tumble.calibration.estimate import Estimate, Figures
from tumble.calibration.objections import find_other_latitude
from tumble.earth import Site
from tumble.sensor import ImuModel, Triad

GYRO = np.array([[1.1, 0.2, -0.1], [0.05, 0.9, 0.3], [-0.25, 0.15, 1.05]])
SIGMA = 1e-7
GRAVITY = 9.81
NAMES = [f"gyroscope.g_sensitivity[{i},{j}]" for i in range(3) for j in range(3)]


def said_of(sensitivity: np.ndarray, latitude: float = 52.0) -> str:
    """Of entries with independent errors."""
    model = ImuModel(None, Triad(GYRO, np.zeros(3)), g_sensitivity=sensitivity)
    figures = Figures(1.0, 1.0, 9, 2.0, 1.0, {})
    estimate = Estimate("joint", model, NAMES, SIGMA**2 * np.eye(9), [], np.zeros((0, 0)), *figures)
    return find_other_latitude(estimate, Site(GRAVITY, 0.0, float(np.radians(latitude))))


def test_a_rate_along_the_vertical_is_another_latitudes() -> None:
    """At 42° the Earth turns by 7.292e-5 (sin 42° - sin 52°) less upwards than at 52°, -8.67e-6 rad/s."""
    upward = 7.292115e-5 * (np.sin(np.radians(42.0)) - np.sin(np.radians(52.0)))
    noise = SIGMA * np.random.default_rng(3).standard_normal((3, 3))
    said = said_of(upward / GRAVITY * GYRO + noise)
    found = re.search(r"show -8\.\de-06 .* latitude 52\.0° gives, as at (4\d\.\d)°", said)
    # 1e-7 rad/s per m/s² over the root of three are 5.7e-7 rad/s, 0.6° of latitude there
    assert float(found[1]) == pytest.approx(42.0, abs=2.0)


def test_a_sensors_own_sensitivity_is_no_latitudes() -> None:
    own = 1e-6 * np.random.default_rng(4).standard_normal((3, 3))
    assert said_of(own) == ""
    # one axis alone, the same with another sign, a rate that the Earth has nowhere, and none that is certain
    assert said_of(np.diag([3e-6, 0.0, 0.0])) == ""
    assert said_of(1e-6 * GYRO @ np.diag([1.0, -1.0, 1.0])) == ""
    assert said_of(3e-5 * GYRO) == ""
    assert said_of(1e-7 * GYRO) == ""
    assert said_of(-1e-6 * GYRO, -30.0)


def test_a_latitude_that_is_10_degrees_off_is_said_of_a_quiet_unit(tmp_path: Path) -> None:
    """Its g-sensitivity was stated 12 sigmas off, and fit; the gravity was surveyed and right."""
    made = PROCEDURES["laboratory"](GRADES["tactical"], np.random.default_rng(90001), "wrong-latitude")
    file = tmp_path / "protocol.yaml"
    file.write_text(made.protocol, encoding="utf-8")
    verdict = tumble.calibrate(
        pl.DataFrame(made.columns()), protocol=file, rate="50±0.0025"
    ).calibration.verdict
    assert not verdict.fit
    (said,) = [reason for reason in verdict.reasons if "Earth's rotation" in reason]
    shown = re.search(r"as at (-?[\d.]+)°", said)
    assert float(shown[1]) == pytest.approx(np.degrees(made.place.latitude), abs=2.0)
