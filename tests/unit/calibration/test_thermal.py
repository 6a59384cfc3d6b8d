"""The thermal procedure on simulated units whose dependence on temperature is known."""

from dataclasses import replace

import numpy as np
import pytest

from tumble.attitude import twenty_six_directions
from tumble.calibration.estimate import Estimate
from tumble.calibration.evidence import ThermalCurves
from tumble.calibration.thermal.coverage import check_unit
from tumble.calibration.thermal.points import white_variance
from tumble.calibration.thermal.procedure import calibrate_thermal
from tumble.earth import Site
from tumble.errors import ObservabilityError
from tumble.protocol import HoldStep, Pose, Protocol, RampStep, SoakStep, Step, TurnStep, named_protocol
from tumble.recording import Recording
from tumble.segmentation import Timeline, find_thermal_timeline
from tumble.sensor import ImuModel, TemperatureBasis, ThermalModel, Triad, frame_rotation
from tumble.simulation import (
    Chamber,
    TriadNoise,
    find_grade,
    find_thermal_grade,
    simulate_chamber,
    simulate_noise,
)

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


def soaks(seconds=600.0, celsius=(0.0, 20.0, 40.0, 60.0, 40.0, 20.0, 0.0)) -> Protocol:
    steps: list[Step] = []
    for at in celsius:
        steps.append(SoakStep(seconds, at))
        steps += [HoldStep(20.0, Pose(twenty_six_directions()[k], None, 0.05)) for k in NINE]
    return Protocol("soaks", "thermal", tuple(steps), SITE)


def sweep() -> Protocol:
    z_up = Pose(np.array([0.0, 0.0, 1.0]))
    steps = (HoldStep(10.0, z_up), SoakStep(300.0, 0.0), RampStep(1500.0, 0.0, 30.0), SoakStep(300.0, 30.0))
    return Protocol("sweep", "thermal", (*steps, RampStep(1500.0, 30.0, 0.0)), SITE)


def recorded(protocol, thermal, *, noise, time_constant=60.0) -> Recording:
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
    assert "Lag between the sensors and the thermometer" in " ".join(noisy_soaks.not_determined)


def test_a_sweep_tells_lag_and_hysteresis_and_one_pose_no_scale_factors(noisy_sweep: Recording) -> None:
    estimate = calibrated(sweep(), noisy_sweep)
    evidence, told = estimate.shown(ThermalCurves), estimate.thermal
    assert evidence.kind == "ramp"
    lag = next(p for p in estimate.parameters if p.name.startswith("thermal lag"))
    assert abs(evidence.lag - 40.0) < 4.0 * lag.standard_uncertainty < 40.0
    sigma = dict(zip(told.model.names, np.sqrt(np.diag(told.covariance)), strict=True))
    for axis, true in enumerate(unit().hysteresis["gyroscope.bias"]):
        error = told.model.hysteresis["gyroscope.bias"][axis] - true
        assert abs(error) < 4.5 * sigma[f"gyroscope.bias.hysteresis[{axis}]"]
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


def test_stamps_and_thermometers_that_cannot_be_right_are_refused(noisy_sweep: Recording) -> None:
    celsius, timeline = noisy_sweep.temperature, find_thermal_timeline(noisy_sweep)
    samples = np.arange(len(celsius))
    cases = {
        "no temperature": None,
        "is constant": np.full(len(celsius), 25.0),
        "kelvins": celsius + 273.15,
        "jumps from": celsius + 9.0 * (samples >= len(celsius) // 3),
        "changes by 0.": 25.0 + 0.01 * celsius,
        "nobody knows the sensor's temperature": np.where(samples < len(celsius) // 2, celsius, np.nan),
    }
    for said, column in cases.items():
        with pytest.raises(ObservabilityError, match=said):
            calibrate_thermal(replace(noisy_sweep, temperature=column), timeline, SITE)
    with pytest.raises(ObservabilityError, match="stamps are too short"):
        calibrate_thermal(
            replace(noisy_sweep, time=noisy_sweep.time * 1e-3, rate=noisy_sweep.rate * 1e3), timeline, SITE
        )


@pytest.mark.parametrize("kicked", [False, True])
def test_a_model_that_a_tenth_of_the_rests_contradict_is_not_fit(noisy_sweep, kicked) -> None:
    """Kicks of 0.1 °/s for a minute out of seven, as from something that is loose in the chamber."""
    minute = (noisy_sweep.time // 60.0) % 7.0 == 2.0
    rate = noisy_sweep.angular_rate + kicked * minute[:, None] * np.array([0.0, 0.002, -0.002])
    estimate = calibrated(sweep(), replace(noisy_sweep, angular_rate=rate))
    assert (
        any("rests contradict the model and were left out" in text for text in estimate.objections) == kicked
    )


# The gyros' matrix, from turns between the rests ----------------------------------------------------

# What rotates the gyros against the accelerometers with temperature is in it: the part that is not symmetric.
CHANGE = np.array([[2e-4, 3e-5, -2e-5], [-5e-5, -1e-4, 4e-5], [6e-5, -1e-5, 3e-4]])
MATRIX = np.array([[1.01, 0.004, -0.003], [-0.002, 0.98, 0.006], [0.005, -0.001, 1.02]])


def turning_unit() -> ThermalModel:
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
def turned() -> Estimate:
    steps: list[Step] = []
    for celsius in (0.0, 20.0, 40.0, 60.0):
        steps.append(SoakStep(600.0, celsius))
        for k in (0, 2, 4, 1, 3, 5, 6, 7, 10, 14, 17, 12):
            steps += [TurnStep(2.0), HoldStep(8.0, Pose(twenty_six_directions()[k], None, 0.1))]
    protocol = Protocol("soaks", "thermal", tuple(steps[:1] + steps[2:]), SITE)
    chamber, rng = Chamber(rate=0.2, time_constant=60.0, thermometer_noise=0.02), np.random.default_rng(7)
    recording, _, _ = simulate_chamber(
        protocol, 25.0, rng, site=SITE, thermal=turning_unit(), chamber=chamber, grade=find_grade("tactical")
    )
    return calibrate_thermal(recording, find_thermal_timeline(recording), SITE, protocol=protocol)


def test_scale_misalignment_and_rotation_are_recovered_within_their_uncertainties(turned: Estimate) -> None:
    told = turned.thermal
    found = told.model
    sigma = dict(zip(turned.names, np.sqrt(np.diag(turned.covariance)), strict=True))
    own = np.array([[sigma[f"gyroscope.matrix[{i},{j}]"] for j in range(3)] for i in range(3)])
    error = found.reference.gyroscope.matrix - replace(turning_unit().reference).gyroscope.matrix  # type: ignore[union-attr]
    # 18 numbers of one seed: one beyond 4.5 sigmas happens in 10 000 seeds.
    assert np.all(np.abs(error) < 4.5 * own)
    thermal = dict(zip(told.model.names, np.sqrt(np.diag(told.covariance)), strict=True))
    own = np.array(
        [[thermal[f"gyroscope.matrix.temperature[0,{i},{j}]"] for j in range(3)] for i in range(3)]
    )
    assert np.all(np.abs(found.coefficients["gyroscope.matrix"][0] - CHANGE) < 4.5 * own)
    # A tenth of the change over the test at most: it was really measured.
    assert np.all(own < 1e-5)
    assert any("gyros' matrix is from" in remark for remark in turned.remarks)
    assert not any("gyros' scale factors" in words for words in turned.not_determined)


# Out of the fridge onto the table ------------------------------------------------------------------

UP = np.array([0.0, 0.0, 9.80665])
Warmed = tuple[Timeline, Estimate, ThermalModel]


@pytest.fixture(scope="module")
def warmed() -> Warmed:
    rng = np.random.default_rng(3)
    kind, drift = find_grade("consumer-mems"), find_thermal_grade("consumer-mems")
    unit = drift.simulate_model(kind.simulate_model(rng), rng)
    chamber = Chamber(
        thermometer_noise=drift.thermometer_noise, thermometer_resolution=drift.thermometer_resolution
    )
    site, protocol = Site.from_latitude(np.radians(48.0)), named_protocol("thermal-fridge")
    recording, _, _ = simulate_chamber(
        protocol, 5.0, rng, site=site, thermal=unit, chamber=chamber, grade=kind
    )
    timeline = find_thermal_timeline(recording)
    turned = unit.turned(np.real(frame_rotation(unit.reference.accelerometer.matrix, "accelerometer-x")))
    return timeline, calibrate_thermal(recording, timeline, site, protocol=protocol), turned


def test_warming_out_of_a_fridge_is_no_motion_and_recovered(warmed: Warmed) -> None:
    timeline, estimate, true = warmed
    assert len(timeline.holds) == 2
    assert not any("nothing was measured" in caution for caution in estimate.cautions)
    found, evidence = estimate.thermal.model, estimate.shown(ThermalCurves)
    reference = found.basis.reference_celsius
    for celsius in (5.0, 20.0):
        for name, at_rest in (("accelerometer", UP), ("gyroscope", np.zeros(3))):
            curve = evidence.curves[name]
            here, base = getattr(found.at(celsius), name), getattr(found.at(reference), name)
            there, beneath = getattr(true.at(celsius), name), getattr(true.at(reference), name)
            change = there.bias - beneath.bias + (there.matrix - beneath.matrix) @ at_rest
            sigma = np.array([np.interp(celsius, curve.celsius, curve.sigma[:, k]) for k in range(3)])
            # 12 numbers of one seed: what one branch cannot show (hysteresis, lag, rate) is in the uncertainties.
            assert np.all(np.abs(here.bias - base.bias - change) < 3.5 * sigma)
            # It is a calibration: most of the change is told.
            assert np.linalg.norm(here.bias - base.bias - change) < 0.5 * np.linalg.norm(change)
    # The pose adds a g-sensitivity of 0.05 °/s, some 20 times what the mean of an hour is known to.
    off = found.reference.gyroscope.bias - true.at(reference).gyroscope.bias
    at = [estimate.names.index(f"gyroscope.bias[{k}]") for k in range(3)]
    assert np.all(np.abs(off) < 3.5 * np.sqrt(np.diag(estimate.covariance)[at]))


def test_what_one_branch_cannot_show_is_named_with_what_was_added(warmed: Warmed) -> None:
    _, estimate, _ = warmed
    told = " ".join(estimate.not_determined)
    for said in (
        "a single branch cannot show it",
        "of half the loop, and is in the standard uncertainties",
        "Lag between the sensors and the thermometer",
        "a g-sensitivity, believed to be 25 times",
    ):
        assert said in told
    assert not any("lag" in parameter.name for parameter in estimate.parameters)


# What a thermometer shows, and what a rest's mean has ----------------------------------------------

FRIDGE, SWEEP = np.linspace(4.0, 22.0, 500), np.linspace(-20.0, 60.0, 500)


def fahrenheit(celsius: np.ndarray) -> np.ndarray:
    return 1.8 * celsius + 32.0


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (FRIDGE + 273.15, "kelvins, as it looks: add K to the --units"),
        (SWEEP + 273.15, "kelvins, as it looks"),
        ((SWEEP - 36.53) * 340.0, "raw counts"),
        (SWEEP * 10.0, "raw counts"),
        (fahrenheit(SWEEP), r"as °F it would be -19\.\d to 59\.\d °C"),
        (fahrenheit(FRIDGE), "never comes near that of a room"),
    ],
)
def test_another_scale_is_refused_with_the_option_that_says_it(values: np.ndarray, said: str) -> None:
    with pytest.raises(ObservabilityError, match=said):
        check_unit(values, None)


@pytest.mark.parametrize(("name", "values"), [("thermal-fridge", FRIDGE), ("thermal-ramp", SWEEP)])
def test_a_protocol_shows_degrees_fahrenheit(name: str, values: np.ndarray) -> None:
    protocol = named_protocol(name)
    assert check_unit(values, None, protocol) == []
    with pytest.raises(ObservabilityError, match="that fits if the column is in °F"):
        check_unit(fahrenheit(values), None, protocol)


def test_usual_tests_in_celsius_pass_without_a_word() -> None:
    for values in (FRIDGE, SWEEP, np.linspace(20.0, 45.0, 100), np.linspace(-40.0, 85.0, 100)):
        assert check_unit(values, None) == []


def test_what_is_usual_on_both_scales_is_told_and_a_said_unit_is_believed() -> None:
    values = np.linspace(0.0, 75.0, 100)
    assert "in °F it would be -17.7 to 23.8 °C" in check_unit(values, None)[0]
    for hot in (values, np.linspace(40.0, 110.0, 100)):
        assert check_unit(hot, "degC") == []


def rests(white: float, flicker: float) -> list[np.ndarray]:
    drawn = simulate_noise(TriadNoise(white, flicker), 60_000, RATE, np.random.default_rng(2))
    return [part - part.mean(axis=0) for part in np.split(drawn, 100)]


@pytest.mark.parametrize("flicker", [0.0, 1.5])
def test_flicker_inside_the_rests_is_not_taken_for_white_noise(flicker: float) -> None:
    # A gyro's white noise and flicker are alike at one second: batches of ten seconds show five times the white noise.
    # 60 000 samples tell it to a few per cent beside flicker.
    np.testing.assert_allclose(white_variance(rests(1.0, flicker)), RATE, rtol=0.12)
