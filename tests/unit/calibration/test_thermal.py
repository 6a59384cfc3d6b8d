"""The thermal procedure on simulated units whose dependence on temperature is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tumble.attitude.rotations import twenty_six_directions
from tumble.calibration.estimate import Estimate
from tumble.calibration.evidence import ThermalCurves
from tumble.calibration.thermal.procedure import calibrate_thermal
from tumble.earth import Site
from tumble.errors import ObservabilityError
from tumble.protocol import HoldStep, Pose, Protocol, RampStep, SoakStep, Step
from tumble.recording import Recording
from tumble.segmentation import find_thermal_timeline
from tumble.sensor import ImuModel, Triad
from tumble.sensor.thermal import TemperatureBasis, ThermalModel
from tumble.simulation import Chamber, find_grade, simulate_chamber

SITE = Site.from_latitude(np.radians(48.0))
RATE = 5.0
NINE = (0, 1, 2, 3, 4, 5, 6, 7, 10)


def unit(*, lag: float = 0.0, rate: bool = False, bend: float = 1.0) -> ThermalModel:
    """A unit in the frame accelerometer-x; its matrix changes along straight lines."""
    force = Triad(
        np.array([[1.01, 0, 0], [0.004, 0.98, 0], [-0.003, 0.002, 1.02]]), np.array([0.1, -0.2, 0.05])
    )
    gyro = Triad(np.eye(3), np.array([0.01, -0.02, 0.03]))
    matrix = np.zeros((2, 3, 3))
    matrix[0] = [[1e-4, 0, 0], [2e-5, -1.5e-4, 0], [1e-5, -3e-5, 0.5e-4]]
    return ThermalModel(
        ImuModel(force, gyro),
        TemperatureBasis("polynomial", 25.0, order=2),
        {
            "accelerometer.bias": np.array([[2e-3, -1e-3, 3e-3], [1e-5 * bend, 2e-5 * bend, -1e-5 * bend]]),
            "accelerometer.matrix": matrix,
            "gyroscope.bias": np.array([[1e-4, -2e-4, 3e-4], [1e-6 * bend, 2e-6 * bend, -2e-6 * bend]]),
        },
        {
            "accelerometer.bias": np.array([0.02, 0.05, -0.03]),
            "gyroscope.bias": np.array([0.004, -0.006, 0.002]),
        }
        if rate
        else {},
        {
            "accelerometer.bias": np.array([4e-3, -3e-3, 2e-3]),
            "gyroscope.bias": np.array([2e-4, 3e-4, -1e-4]),
        },
        lag=lag,
    )


def soaks(
    seconds: float = 600.0, celsius: tuple[float, ...] = (0.0, 20.0, 40.0, 60.0, 40.0, 20.0, 0.0)
) -> Protocol:
    steps: list[Step] = []
    for at in celsius:
        steps.append(SoakStep(seconds, at))
        steps += [HoldStep(20.0, Pose(twenty_six_directions()[k], None, 0.05)) for k in NINE]
    return Protocol("soaks", "thermal", tuple(steps), SITE)


def sweep() -> Protocol:
    z_up = Pose(np.array([0.0, 0.0, 1.0]))
    steps = (HoldStep(10.0, z_up), SoakStep(300.0, 0.0), RampStep(1500.0, 0.0, 30.0), SoakStep(300.0, 30.0))
    return Protocol("sweep", "thermal", (*steps, RampStep(1500.0, 30.0, 0.0)), SITE)


def recorded(
    protocol: Protocol, thermal: ThermalModel, *, noise: bool, time_constant: float = 60.0
) -> Recording:
    chamber = Chamber(rate=0.2, time_constant=time_constant, thermometer_noise=0.03 if noise else 0.0)
    grade = find_grade("tactical") if noise else None
    rng = np.random.default_rng(5)
    return simulate_chamber(protocol, RATE, rng, site=SITE, thermal=thermal, chamber=chamber, grade=grade)[0]


def calibrated(protocol: Protocol, recording: Recording) -> Estimate:
    return calibrate_thermal(recording, find_thermal_timeline(recording), SITE, protocol=protocol)


@pytest.fixture(scope="module")
def noisy_sweep() -> Recording:
    return recorded(sweep(), unit(lag=40.0), noise=True)


@pytest.fixture(scope="module")
def noisy_soaks() -> Estimate:
    return calibrated(soaks(), recorded(soaks(), unit(), noise=True))


def test_soaks_without_noise_give_the_unit_back() -> None:
    true = unit()
    found = calibrated(soaks(), recorded(soaks(), true, noise=False)).thermal
    found = found.model
    for celsius, state in ((0.0, -1.0), (20.0, 1.0), (37.0, 0.0), (60.0, 1.0)):
        here, there = found.at(celsius, 0.0, state), true.at(celsius, 0.0, state)
        # What is left is the unit's remaining 0.02 K between soak and poses, which means over a rest do not see.
        np.testing.assert_allclose(here.accelerometer.bias, there.accelerometer.bias, atol=2e-5)
        np.testing.assert_allclose(here.accelerometer.matrix, there.accelerometer.matrix, atol=3e-6)
        # The Earth rate's horizontal part, 5e-5 rad/s, is not known in any pose.
        np.testing.assert_allclose(here.gyroscope.bias, there.gyroscope.bias, atol=5e-5)


def test_soaks_with_noise_are_recovered_within_their_uncertainties(noisy_soaks: Estimate) -> None:
    true, found, evidence = unit(), noisy_soaks.thermal, noisy_soaks.shown(ThermalCurves)
    found = found.model
    assert evidence.basis.startswith("polynomial")
    for celsius in (0.0, 30.0, 60.0):
        here, there = found.at(celsius), true.at(celsius)
        for name in ("accelerometer", "gyroscope"):
            curve = evidence.curves[name]
            sigma = np.array([np.interp(celsius, curve.celsius, curve.sigma[:, k]) for k in range(3)])
            error = getattr(here, name).bias - getattr(there, name).bias
            # 18 numbers of one seed: one beyond 4.5 sigmas happens in 10 000 seeds.
            assert np.all(np.abs(error) < 4.5 * sigma)


def test_what_soaks_cannot_tell_is_named(noisy_soaks: Estimate) -> None:
    told = " ".join(noisy_soaks.not_determined)
    assert "Lag between the sensors and the thermometer" in told


@pytest.fixture(scope="module")
def swept(noisy_sweep: Recording) -> Estimate:
    return calibrated(sweep(), noisy_sweep)


def test_a_sweep_tells_lag_and_hysteresis(swept: Estimate) -> None:
    estimate = swept
    evidence, told = estimate.shown(ThermalCurves), estimate.thermal
    assert evidence.kind == "ramp"
    lag = next(p for p in estimate.parameters if p.name.startswith("thermal lag"))
    assert abs(evidence.lag - 40.0) < 4.0 * lag.standard_uncertainty < 40.0
    sigma = dict(zip(told.model.names, np.sqrt(np.diag(told.covariance)), strict=True))
    for axis, true in enumerate(unit().hysteresis["gyroscope.bias"]):
        error = told.model.hysteresis["gyroscope.bias"][axis] - true
        assert abs(error) < 4.5 * sigma[f"gyroscope.bias.hysteresis[{axis}]"]


def test_one_pose_leaves_scale_factors_untold_and_says_so(swept: Estimate) -> None:
    estimate = swept
    assert not any(name.startswith("accelerometer") for name in estimate.names)
    assert "scale factors and non-orthogonalities" in estimate.not_determined[0]
    assert "cannot be separated from a bias" in estimate.not_determined[0]


def test_a_soak_that_has_not_settled_is_left_out_with_its_rate() -> None:
    # With a time constant of 240 s ten minutes are too short for the first poses.
    protocol = soaks(seconds=900.0, celsius=(0.0, 30.0, 60.0))
    estimate = calibrated(protocol, recorded(protocol, unit(), noise=True, time_constant=200.0))
    evidence = estimate.shown(ThermalCurves)
    assert evidence.rejected
    assert all("not settled" in why and "K/min" in why for _, _, why in evidence.rejected)
    assert np.all(np.abs(evidence.celsius_rate) < 0.11 / 60.0)


def with_temperature(recording: Recording, celsius: np.ndarray | None) -> Recording:
    return replace(recording, temperature=celsius)


def test_stamps_that_cannot_be_the_base_of_a_sweep_are_refused(noisy_sweep: Recording) -> None:
    too_short = replace(noisy_sweep, time=noisy_sweep.time * 1e-3, rate=noisy_sweep.rate * 1e3)
    with pytest.raises(ObservabilityError, match="stamps are too short"):
        calibrate_thermal(too_short, find_thermal_timeline(noisy_sweep), SITE)


def test_a_thermometer_that_cannot_be_one_is_refused(noisy_sweep: Recording) -> None:
    celsius = noisy_sweep.temperature
    middle = len(celsius) // 3
    cases = {
        "no temperature": None,
        "is constant": np.full(len(celsius), 25.0),
        "kelvins": celsius + 273.15,
        "jumps from": np.concatenate([celsius[:middle], celsius[middle:] + 9.0]),
        "changes by 0.": 25.0 + 0.01 * celsius,
        "nobody knows the sensor's temperature": np.where(
            np.arange(len(celsius)) < len(celsius) // 2, celsius, np.nan
        ),
    }
    timeline = find_thermal_timeline(noisy_sweep)
    for said, column in cases.items():
        with pytest.raises(ObservabilityError, match=said):
            calibrate_thermal(with_temperature(noisy_sweep, column), timeline, SITE)


@pytest.mark.parametrize("kicked", [False, True])
def test_a_model_that_a_tenth_of_the_rests_contradict_is_not_fit(
    noisy_sweep: Recording, kicked: bool
) -> None:
    """Kicks of 0.1 °/s for a minute out of seven, as from something that is loose in the chamber."""
    minute = (noisy_sweep.time // 60.0) % 7.0 == 2.0
    rate = noisy_sweep.angular_rate + kicked * minute[:, None] * np.array([0.0, 0.002, -0.002])
    estimate = calibrated(sweep(), replace(noisy_sweep, angular_rate=rate))
    assert (
        any("rests contradict the model and were left out" in text for text in estimate.objections) == kicked
    )
