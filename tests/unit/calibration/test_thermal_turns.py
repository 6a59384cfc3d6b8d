"""The gyros' matrix over temperature, from turns between the rests of a soak test."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tumble.attitude.rotations import twenty_six_directions
from tumble.calibration.estimate import Estimate
from tumble.calibration.thermal.procedure import calibrate_thermal
from tumble.earth import Site
from tumble.protocol import HoldStep, Pose, Protocol, SoakStep, Step, TurnStep
from tumble.segmentation import find_thermal_timeline
from tumble.sensor import ImuModel, Triad
from tumble.sensor.thermal import TemperatureBasis, ThermalModel
from tumble.simulation import Chamber, find_grade, simulate_chamber

SITE = Site.from_latitude(np.radians(48.0))
# What rotates the gyros against the accelerometers with temperature is in it: the part that is not symmetric.
CHANGE = np.array([[2e-4, 3e-5, -2e-5], [-5e-5, -1e-4, 4e-5], [6e-5, -1e-5, 3e-4]])
MATRIX = np.array([[1.01, 0.004, -0.003], [-0.002, 0.98, 0.006], [0.005, -0.001, 1.02]])


def unit() -> ThermalModel:
    force = Triad(
        np.array([[1.01, 0, 0], [0.004, 0.98, 0], [-0.003, 0.002, 1.02]]), np.array([0.1, -0.2, 0.05])
    )
    return ThermalModel(
        ImuModel(force, Triad(MATRIX, np.array([0.01, -0.02, 0.03]))),
        TemperatureBasis("polynomial", 25.0, order=1),
        {
            "accelerometer.bias": np.array([[2e-3, -1e-3, 3e-3]]),
            "accelerometer.matrix": np.array([[[1e-4, 0, 0], [2e-5, -1.5e-4, 0], [1e-5, -3e-5, 5e-5]]]),
            "gyroscope.bias": np.array([[1e-4, -2e-4, 3e-4]]),
            "gyroscope.matrix": CHANGE[None],
        },
    )


@pytest.fixture(scope="module")
def estimate() -> Estimate:
    steps: list[Step] = []
    for celsius in (0.0, 20.0, 40.0, 60.0):
        steps.append(SoakStep(600.0, celsius))
        for k in (0, 2, 4, 1, 3, 5, 6, 7, 10, 14, 17, 12):
            steps += [TurnStep(2.0), HoldStep(8.0, Pose(twenty_six_directions()[k], None, 0.1))]
    protocol = Protocol("soaks", "thermal", tuple(steps[:1] + steps[2:]), SITE)
    chamber, rng = Chamber(rate=0.2, time_constant=60.0, thermometer_noise=0.02), np.random.default_rng(7)
    recording, _, _ = simulate_chamber(
        protocol, 25.0, rng, site=SITE, thermal=unit(), chamber=chamber, grade=find_grade("tactical")
    )
    return calibrate_thermal(recording, find_thermal_timeline(recording), SITE, protocol=protocol)


def test_scale_misalignment_and_rotation_are_recovered_within_their_uncertainties(estimate: Estimate) -> None:
    told = estimate.thermal
    found = told.model
    sigma = dict(zip(estimate.names, np.sqrt(np.diag(estimate.covariance)), strict=True))
    own = np.array([[sigma[f"gyroscope.matrix[{i},{j}]"] for j in range(3)] for i in range(3)])
    error = found.reference.gyroscope.matrix - replace(unit().reference).gyroscope.matrix  # type: ignore[union-attr]
    # 18 numbers of one seed: one beyond 4.5 sigmas happens in 10 000 seeds.
    assert np.all(np.abs(error) < 4.5 * own)
    thermal = dict(zip(told.model.names, np.sqrt(np.diag(told.covariance)), strict=True))
    own = np.array(
        [[thermal[f"gyroscope.matrix.temperature[0,{i},{j}]"] for j in range(3)] for i in range(3)]
    )
    assert np.all(np.abs(found.coefficients["gyroscope.matrix"][0] - CHANGE) < 4.5 * own)
    # A tenth of the change over the test at most: it was really measured.
    assert np.all(own < 1e-5)


def test_it_is_said_where_the_matrix_comes_from(estimate: Estimate) -> None:
    assert any("gyros' matrix is from" in remark for remark in estimate.remarks)
    assert not any("gyros' scale factors" in words for words in estimate.not_determined)
