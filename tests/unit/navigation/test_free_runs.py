"""Many short free navigations at once are what each is by itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tumble.navigation import (
    FilterSetup,
    InertialSamples,
    NavigationState,
    TriadSpread,
    navigate,
    plan_filter,
)
from tumble.navigation.filter.kernels import gather_sensors
from tumble.navigation.mechanisation import navigate_from_each
from tumble.noise.terms import NoiseModel

START = NavigationState.from_angles(
    0.0, (0.8, -2.0, 300.0), np.array([20.0, -30.0, 4.0]), np.array([0.3, -0.4, 2.0])
)


def made(means: bool) -> InertialSamples:
    rng = np.random.default_rng(3)
    rate, force = 0.2 * rng.standard_normal((500, 3)), rng.normal([0.3, 1.0, -9.0], 1.0, (500, 3))
    return InertialSamples(np.cumsum(rng.uniform(0.005, 0.02, 500)), force, rate, means)


def corrected_samples(samples: InertialSamples, setup: FilterSetup, estimates: np.ndarray) -> InertialSamples:
    """Samples with a filter's estimates of its sensor states taken out."""
    force_matrix, rate_matrix, coupling = np.eye(3), np.eye(3), np.zeros((3, 3))
    force_bias, rate_bias = np.zeros(3), np.zeros(3)
    for state, value in zip(setup.states, estimates, strict=True):
        if state.kind == "g-sensitivity":
            coupling[state.row, state.column] += value
        elif state.kind in ("accelerometer", "gyroscope"):
            accelerometer = state.kind == "accelerometer"
            if state.column < 0:
                (force_bias if accelerometer else rate_bias)[state.row] += value
            else:
                (force_matrix if accelerometer else rate_matrix)[state.row, state.column] += value
    force = np.linalg.solve(force_matrix, (samples.specific_force_b - force_bias).T).T
    rate = samples.angular_rate_ib_b - rate_bias - force @ coupling.T
    rate = np.linalg.solve(rate_matrix, rate.T).T
    return replace(
        samples,
        specific_force_b=np.ascontiguousarray(force, dtype=np.float64),
        angular_rate_ib_b=np.ascontiguousarray(rate, dtype=np.float64),
    )


@pytest.mark.parametrize("means", [False, True])
def test_each_goal_is_reached_as_by_navigation_to_it_alone(means: bool) -> None:
    samples = made(means)
    begins = samples.time[0] + np.array([0.0, 1.234, 2.5])
    goals = begins[:, None] + [0.5, 0.5777, 2.0]
    goals[1, 1] = np.nan
    found = navigate_from_each(samples, np.vstack([START.packed] * 3), begins, goals)
    assert np.isnan(found[1, 1]).all()
    for one, begin in enumerate(begins.tolist()):
        for at in (0, 2):
            part = samples.between(begin, float(goals[one, at]))
            state = NavigationState(
                begin, START.latitude, START.longitude, START.height, START.velocity_n, START.C_nb
            )
            alone = navigate(part, state).state(-1).packed
            # rounding over 200 samples
            assert found[one, at, 3:6] == pytest.approx(alone[3:6], abs=1e-11)
            assert found[one, at, :2] == pytest.approx(alone[:2], abs=1e-12)


def test_estimates_of_sensor_states_are_taken_out_of_the_samples() -> None:
    samples, rng = made(False), np.random.default_rng(4)
    spread = TriadSpread(0.1, 0.01, misalignment=0.01)
    others = {"g_sensitivity": 1e-4, "lever_arm_sigma": 0.1, "time_offset_sigma": 0.01}
    noise, arm = NoiseModel(random_walk=0.01), np.array([1.0, 2.0, 3.0])
    setup = plan_filter(noise, noise, accelerometer=spread, gyroscope=spread, lever_arm_b=arm, **others)
    estimates = rng.normal(0.0, 0.02, len(setup.states))
    made_of = np.empty((1, 37))
    gather_sensors(estimates, setup.places, setup.nominal, made_of[0])
    begin, end = float(samples.time[0]), float(samples.time[-1])
    found = navigate_from_each(samples, START.packed[None], np.array([begin]), np.array([[end]]), made_of)
    start = NavigationState(
        begin, START.latitude, START.longitude, START.height, START.velocity_n, START.C_nb
    )
    alone = navigate(corrected_samples(samples, setup, estimates), start).state(-1).packed
    # rounding over 500 samples
    assert found[0, 0, 3:] == pytest.approx(alone[3:], abs=1e-10)
    value = {(state.kind, state.row): x for state, x in zip(setup.states, estimates, strict=True)}
    assert made_of[0, 36] == value["time offset", 0]
    assert made_of[0, 33:36].tolist() == [
        own + value["lever arm", i] for i, own in enumerate((1.0, 2.0, 3.0))
    ]
