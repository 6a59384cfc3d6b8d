"""Savage's inversion on recordings of rotation sequences: the truth, the stated uncertainty, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from second_simulator.calibrating import played
from tumble.calibration.session import Session
from tumble.earth import Site
from tumble.errors import ObservabilityError
from tumble.protocol import HoldStep, Protocol, Step, named_protocol
from tumble.protocol.strapdown_rotation import sequence_steps
from tumble.sensor import ImuModel
from tumble.sensor.conventions.savage import GROUPS, NAMES, SavageErrors, savage_from_model
from tumble.simulation import simulate_protocol
from tumble.simulation.two_axis import FixtureErrors
from tumble_papers.savage.methods import ESTIMATORS, inversion_covariance
from unit.papers.recovered import assert_within_statement, session_of, square_sum, white

SITE = replace(Site.from_latitude(np.radians(40.0), 300.0), gravity_sigma=0.0)
PROTOCOL = replace(named_protocol("strapdown-rotation"), site=SITE)
# 1 mrad in everything that a fixture may be off by.
FIXTURE = FixtureErrors(
    tilt=(1e-3, -7e-4), orthogonality=8e-4, inner_zero=-1e-3, outer_zero=6e-4, mounting=(5e-4, -9e-4, 1e-3),
    execution=3e-4,
)  # fmt: skip
# No two alike: one that shows as another is seen.
ERRORS = 1e-3 * np.array(
    [1.1, -0.7, 0.4, 0.2, -0.3, 0.15, 1.3, -0.9, 0.6, 20.0, -30.0, 50.0,
     0.8, -1.2, 1.7, -0.1, 0.25, 0.35, 2.1, -1.6, 0.3, 1.9, -2.4, 0.75]
)  # fmt: skip
GYRO_BIAS = np.array([2e-5, -3e-5, 1e-5])
# Biases count against gravity.
SCALE = np.where(np.isin(np.arange(24), np.arange(24)[GROUPS["lambda_bias"]]), SITE.gravity, 1.0)
ESTIMATE = ESTIMATORS["savage-inversion"].estimate
RUNS = 24


def recorded(
    fixture: FixtureErrors, protocol: Protocol = PROTOCOL, units: str = "SI", errors: np.ndarray = ERRORS
) -> Session:
    model = SavageErrors.from_vector(errors, GYRO_BIAS).model()
    recording, _ = simulate_protocol(
        protocol, 50.0, np.random.default_rng(5), site=SITE, model=model, fixture=fixture, units=units
    )
    return Session(recording, protocol)


def off(model: ImuModel, units: str = "SI") -> np.ndarray:
    """Of the 24 errors, each by itself, in the frame mean-gyro."""
    force, rate = (1e4, 1e6) if units == "counts" else (1.0, 1.0)
    assert model.accelerometer is not None
    assert model.gyroscope is not None
    in_si = ImuModel(model.accelerometer.in_raw_unit(1.0 / force), model.gyroscope.in_raw_unit(1.0 / rate))
    found, U = savage_from_model(in_si)
    np.testing.assert_allclose(U, np.eye(3), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.gyro_bias, GYRO_BIAS, rtol=0, atol=1e-7)
    return (found.vector - ERRORS) / SCALE


def without(*gone: str) -> Protocol:
    sequences = [s for s in sequence_steps(PROTOCOL) if s.name not in gone]
    kept = {k for s in sequences for k in range(s.start, s.end + 1)}
    ends = {s.end for s in sequences}
    steps = tuple(s for k, s in enumerate(PROTOCOL.steps) if k in kept or k - 1 in ends)
    return replace(PROTOCOL, steps=steps)


@pytest.mark.parametrize("units", ["SI", "counts"])
def test_without_noise_all_errors_come_back(units: str) -> None:
    """To 5e-8: the Earth's turn of 2 mrad over a sequence meets errors of 1e-3 and angles of samples."""
    estimate = ESTIMATE(recorded(FixtureErrors(), units=units))
    np.testing.assert_allclose(off(estimate.model, units), 0.0, rtol=0, atol=5e-8)
    assert estimate.frame == "mean-gyro"


def test_a_fixture_off_by_a_milliradian_everywhere_moves_no_error_by_a_millionth() -> None:
    """What is left is the Earth rate taken out 1 mrad beside: 7e-5 rad/s for 27 s times 1 mrad is 2 µrad at most."""
    left = np.abs(off(ESTIMATE(recorded(FIXTURE)).model))
    assert 1e-8 < np.max(left) < 1e-6


def test_without_the_sequences_turned_back_the_gyros_have_no_asymmetry() -> None:
    """(14): of a gyro that has one, the scale factor is off by it."""
    estimate = ESTIMATE(recorded(FixtureErrors(), without("1a", "2a", "3a")))
    left = off(estimate.model)
    kappa, asymmetry = GROUPS["kappa_lin"], GROUPS["kappa_asym"]
    np.testing.assert_allclose(left[asymmetry], -ERRORS[asymmetry], rtol=0, atol=1e-12)
    np.testing.assert_allclose(left[kappa], ERRORS[asymmetry], rtol=0, atol=1e-6)
    assert not any(name.startswith("gyroscope.asymmetry") for name in estimate.names)


def test_the_covariance_is_that_of_13_by_hand() -> None:
    """Sequences of independent components of sizes of their own; of each group one error."""
    g, names = 9.81, [s.name for s in sequence_steps(PROTOCOL)]
    sigma = {name: 1e-5 * np.arange(1.0, 6.0) * (k + 1) for k, name in enumerate(names)}
    found = inversion_covariance({n: np.diag(s**2) for n, s in sigma.items()}, g, asymmetry=True)
    variance = dict(zip(NAMES, np.diag(found), strict=True))
    full = 4.0 * np.pi * g
    expected = {
        "kappa xx": (sigma["2"][1] ** 2 + sigma["2a"][1] ** 2) / full**2,
        "upsilon yz": (sigma["4"][1] / (4.0 * g)) ** 2,
        "lambda x": (0.5 * sigma["14"][0]) ** 2 + (0.25 * sigma["5"][0]) ** 2,
        "lambda xx": (sigma["9"][3] ** 2 + sigma["9"][4] ** 2) / (2.0 * g) ** 2,
        "mu xy": (sigma["7"][0] / (2.0 * g)) ** 2 + (sigma["6"][1] / (8.0 * g)) ** 2,
    }
    for name, value in expected.items():
        assert variance[name] == pytest.approx(value, rel=1e-9)


def test_the_truth_is_within_the_stated_uncertainty_over_many_units() -> None:
    """On a fixture off by 0.1 mrad, which makes 0.2 µrad of the Earth rate, a hundredth of the noise."""
    found: list[tuple[float, int]] = []
    for seed in range(RUNS):
        made = played("strapdown-rotation", white(asymmetry=True), seed, error=1e-4, azimuth=1e-5, rate=50.0)
        found.append(square_sum(ESTIMATE(session_of(made)), made))
    assert {degrees for _, degrees in found} == {27}
    assert_within_statement(found)


# What is refused -----------------------------------------------------------------------------------


def test_a_sequence_that_is_missing_is_named() -> None:
    with pytest.raises(ObservabilityError, match="need all sequences, and 9 are missing"):
        ESTIMATE(recorded(FixtureErrors(), without("9")))


def headless(step: Step) -> Step:
    return (
        replace(step, pose=replace(step.pose, heading=None))
        if isinstance(step, HoldStep) and step.pose
        else step
    )


@pytest.mark.parametrize(
    "protocol",
    [replace(PROTOCOL, site=None), replace(PROTOCOL, steps=tuple(headless(step) for step in PROTOCOL.steps))],
    ids=["latitude", "heading"],
)
def test_an_earth_rate_that_nobody_knows_is_asked_for(protocol: Protocol) -> None:
    session = recorded(FixtureErrors())
    session.protocol = protocol
    with pytest.raises(ObservabilityError, match=r"a latitude \(--site\) and for .*`heading_deg`"):
        ESTIMATE(session)


def test_samples_that_are_missing_in_a_sequence_are_refused() -> None:
    session = recorded(FixtureErrors())
    whole, stop = session.recording, session.timeline.holds[0].stop
    assert whole.specific_force is not None
    assert whole.angular_rate is not None
    kept = np.delete(np.arange(len(whole.time)), slice(stop + 10, stop + 13))
    force, rate = whole.specific_force[kept], whole.angular_rate[kept]
    told = replace(whole, time=whole.time[kept], specific_force=force, angular_rate=rate)
    with pytest.raises(ObservabilityError, match="Samples are missing in sequence 1"):
        ESTIMATE(Session(told, PROTOCOL))
