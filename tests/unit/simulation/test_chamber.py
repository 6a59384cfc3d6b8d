"""The chamber: surroundings, the unit's own temperature, and the thermometer."""

from __future__ import annotations

import numpy as np

from tumble.earth import Site
from tumble.protocol import HoldStep, Pose, Protocol, RampStep, SoakStep, TurnStep
from tumble.simulation import Chamber, find_grade, find_thermal_grade, play_protocol, simulate_chamber

SITE = Site.from_gravity(9.81)
TIME = np.asarray((np.arange(4000) + 0.5) * 0.5, dtype=np.float64)


def test_a_unit_follows_a_step_exponentially() -> None:
    # From the middle of the first sample the straight line between two samples is the step.
    around = np.where(TIME < 100.0, 0.0, 20.0)
    unit = Chamber(time_constant=60.0).unit(TIME, around)
    late = TIME > 101.0
    # A step between the samples at 99.75 and 100.25 s acts as one in their middle, to (0.5 / 60)² / 24.
    expected = 20.0 * (1.0 - np.exp(-(TIME[late] - 100.0) / 60.0))
    np.testing.assert_allclose(unit[late], expected, atol=1e-4)


def test_a_unit_is_behind_a_ramp_by_its_time_constant() -> None:
    unit = Chamber(time_constant=60.0).unit(TIME, 0.01 * TIME)
    late = TIME > 1500.0  # exp(-1500 / 60) = 1e-11 of the start is left
    np.testing.assert_allclose(unit[late], 0.01 * (TIME[late] - 60.0), atol=1e-8)


def test_soaks_and_ramps_make_the_surroundings() -> None:
    protocol = Protocol(
        "p", "thermal", (SoakStep(100.0, 10.0), RampStep(200.0, 10.0, 30.0), SoakStep(100.0, 20.0))
    )
    edges = np.array([[0.0, 100.0], [100.0, 300.0], [300.0, 400.0]])
    chamber = Chamber(rate=0.5)
    found = chamber.surroundings(protocol, edges, np.array([50.0, 150.0, 200.0, 310.0, 399.0]))
    np.testing.assert_allclose(found, [10.0, 15.0, 20.0, 25.0, 20.0], rtol=1e-12)


def test_soaks_prolong_the_hold_beside_them_and_keep_their_place() -> None:
    x_up, y_up = Pose(np.array([1.0, 0, 0])), Pose(np.array([0, 1.0, 0]))
    steps = (
        SoakStep(60.0, 20.0),
        HoldStep(10.0, x_up),
        TurnStep(3.0),
        HoldStep(10.0, y_up),
        SoakStep(60.0, 40.0),
    )
    played = play_protocol(Protocol("p", "thermal", steps), np.random.default_rng(1), placement=False)
    expected = [[0, 60], [60, 70], [70, 73], [73, 83], [83, 143]]
    np.testing.assert_allclose(played.step_edges, expected, rtol=1e-12)
    assert played.hold_steps == (1, 3)


def test_a_drawn_unit_changes_in_the_frame_of_its_accelerometers() -> None:
    rng = np.random.default_rng(2)
    reference = find_grade("consumer-mems").simulate_model(rng)
    thermal = find_thermal_grade("consumer-mems").simulate_model(reference, rng)
    there = thermal.at(25.0)
    assert there.accelerometer is not None
    assert reference.accelerometer is not None
    # Through the accelerometers' frame and back: round-off.
    np.testing.assert_allclose(there.accelerometer.matrix, reference.accelerometer.matrix, atol=1e-14)


def test_the_thermometer_has_steps_and_the_recording_its_temperature() -> None:
    rng = np.random.default_rng(3)
    thermal = find_thermal_grade("consumer-mems").simulate_model(
        find_grade("consumer-mems").simulate_model(rng), rng
    )
    chamber = Chamber(thermometer_noise=0.05, thermometer_resolution=0.25)
    steps = (HoldStep(20.0, Pose(np.array([0, 0, 1.0]))), SoakStep(20.0, 30.0))
    recording, _, truth = simulate_chamber(
        Protocol("p", "thermal", steps), 10.0, rng, site=SITE, thermal=thermal, chamber=chamber
    )
    assert recording.temperature is not None
    assert len(recording.temperature) == len(recording)
    np.testing.assert_allclose(
        recording.temperature / 0.25, np.round(recording.temperature / 0.25), atol=1e-9
    )
    assert np.max(np.abs(recording.temperature - truth.unit)) < 0.125 + 6.0 * 0.05
