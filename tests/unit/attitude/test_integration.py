"""Raw rates integrated to attitude, and means at the edge of a hold, against closed forms."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation

from tumble.attitude import (
    IntegratedTurns,
    Inverse,
    integrate_turns,
    matrix_from_rotation_vector,
    rotation_vector_from_matrix,
    skew,
)
from tumble.attitude.integration import average_at_edge

Array = npt.NDArray[np.float64]

# Corrected = inverse @ (raw - bias [- G f]); nothing symmetric, nothing near one.
GYRO_INVERSE = np.array([[0.9, 0.03, -0.05], [0.02, 1.1, 0.04], [-0.06, 0.01, 0.8]]) * 1e-3
GYRO_BIAS = np.array([40.0, -70.0, 25.0])
FORCE_INVERSE = np.array([[1.2, -0.02, 0.04], [0.05, 0.9, 0.01], [-0.03, 0.06, 1.1]]) * 1e-2
FORCE_BIAS = np.array([-11.0, 5.0, 8.0])
G_SENSITIVITY = np.array([[0.5, -0.2, 0.1], [0.3, 0.4, -0.6], [-0.1, 0.2, 0.7]])
BOTH = Inverse(GYRO_INVERSE, GYRO_BIAS, FORCE_INVERSE, FORCE_BIAS)


def raw_of(rate: Array, force: Array) -> tuple[Array, Array]:
    """What the sensors put out, by the forward matrices."""
    raw_force = force @ np.linalg.inv(FORCE_INVERSE).T + FORCE_BIAS
    raw_rate = rate @ np.linalg.inv(GYRO_INVERSE).T + GYRO_BIAS + force @ G_SENSITIVITY.T
    return raw_rate, raw_force


def integrated(
    time: Array,
    rate: Array,
    force: Array | None = None,
    starts: Any = None,
    stops: Any = None,
) -> IntegratedTurns:
    force = np.tile([1.0, -2.0, 9.0], (time.size, 1)) if force is None else force
    raw_rate, raw_force = raw_of(rate, force)
    inverse = BOTH._replace(g_sensitivity=G_SENSITIVITY)
    starts = np.array([0]) if starts is None else starts
    stops = np.array([time.size]) if stops is None else stops
    return integrate_turns(time, raw_rate, raw_force, starts, stops, inverse)


def wobble(time: Array) -> tuple[Array, Array]:
    """A rate and a specific force that change on all axes."""
    t = time[:, None]
    rate = np.hstack([1.5 * np.sin(2 * t), 0.8 * np.cos(3 * t) + 0.4, -1.2 * np.sin(t + 0.5)])
    force = np.hstack([3.0 * np.cos(t), 9.0 - 2.0 * t, -4.0 * np.sin(2 * t)])
    return rate, force


def test_a_constant_rate_is_integrated_exactly_whatever_the_steps() -> None:
    rng = np.random.default_rng(3)
    # Uneven stamps with a gap of a second among them: the step is taken from the stamps.
    time = np.sort(np.concatenate([rng.uniform(0.0, 2.0, 60), rng.uniform(3.0, 4.0, 40)]))
    omega = np.array([0.7, -1.3, 2.1])
    turns = integrated(time, np.tile(omega, (time.size, 1)))
    expected = Rotation.from_rotvec(omega * (time[-1] - time[0])).as_matrix()
    # 100 products of round-off, with rates that carry the round-off of a matrix solved
    np.testing.assert_allclose(turns.C_start_end[0], expected, atol=2e-13)
    assert turns.duration[0] == time[-1] - time[0]


def test_ranges_are_half_open_and_turns_are_independent() -> None:
    time = np.arange(50) / 10.0
    rate, force = wobble(time)
    starts, stops = np.array([5, 0, 30]), np.array([21, 1, 50])
    many = integrated(time, rate, force, starts, stops)
    for k in range(3):
        cut = slice(starts[k], stops[k])
        one = integrated(time[cut], rate[cut], force[cut])
        np.testing.assert_allclose(many.C_start_end[k], one.C_start_end[0], atol=1e-15)
        np.testing.assert_allclose(many.sums[k], one.sums[0], atol=1e-14)
    # A range of one sample has no time to turn.
    assert np.array_equal(many.C_start_end[1], np.eye(3))
    assert many.duration[1] == 0.0
    assert many.duration[0] == pytest.approx(1.5)


def coning(time: Array, half_angle: float, frequency: float) -> tuple[Array, Array]:
    """The rate and the end attitude of a cone, known in closed form (Savage 1998)."""
    phase = frequency * time
    rate = np.column_stack(
        [
            -frequency * np.sin(half_angle) * np.sin(phase),
            frequency * np.sin(half_angle) * np.cos(phase),
            -2.0 * frequency * np.sin(half_angle / 2) ** 2 * np.ones_like(time),
        ]
    )
    rotations = Rotation.from_rotvec(
        half_angle * np.column_stack([np.cos(phase), np.sin(phase), np.zeros_like(phase)])
    )
    return rate, (rotations[0].inv() * rotations[-1]).as_matrix()


def test_coning_follows_its_closed_form_to_the_second_order_of_the_step() -> None:
    errors: list[float] = []
    for count in (200, 400, 800):
        time = np.linspace(0.0, 1.3, count + 1)
        rate, expected = coning(time, 0.4, 9.0)
        C = integrated(time, rate).C_start_end[0]
        errors.append(float(np.linalg.norm(rotation_vector_from_matrix(expected.T @ C))))
    # A sine between samples is not a straight line: (frequency * step)² / 12 of the swing is lost, and
    # the cone gathers it; without the coning term, step²/12 of the cross product, as much again:
    # 0.4 * 0.39 * 9 rad/s * 0.0585² / 12 * 1.3 s.
    assert errors[0] == pytest.approx(5.2e-4, rel=0.05)
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.02)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.02)


def test_the_sums_of_a_constant_rate_are_the_integral_of_the_rotation() -> None:
    time = np.linspace(0.0, 1.7, 3401)
    omega = np.array([0.7, -1.3, 2.1])
    force = np.array([1.0, -2.0, 9.0])
    turns = integrated(time, np.tile(omega, (time.size, 1)))
    # Closed form of the integral of exp(skew(omega t)) over T.
    speed, end = float(np.linalg.norm(omega)), 1.7
    S = skew(omega)
    integral = (
        end * np.eye(3)
        + (1.0 - np.cos(speed * end)) / speed**2 * S
        + (speed * end - np.sin(speed * end)) / speed**3 * S @ S
    )
    # the middle of a step for its mean: (rate * step)² / 24 of the integral, 7e-8
    for j, regressor in enumerate([*omega, 1.0, *force]):
        np.testing.assert_allclose(
            turns.sums[0, :, :, j], regressor * integral, atol=1e-7 * abs(regressor) * 2
        )


@pytest.mark.parametrize("small", [1e-12, 0.9e-2, 1.1e-2, 3.0])
def test_both_branches_of_the_step_are_exact_at_its_end_and_at_its_middle(small: float) -> None:
    # the series is used below a hundredth of a radian a step
    time = np.array([0.0, 1.0])
    vector = small * np.array([2.0, -3.0, 6.0]) / 7.0
    turns = integrate_turns(
        time, np.tile(vector, (2, 1)), np.zeros((2, 3)), np.array([0]), np.array([2]), Inverse()
    )
    np.testing.assert_allclose(turns.C_start_end[0], matrix_from_rotation_vector(vector), atol=1e-15)
    # one second of the regressor one, at the middle's attitude
    middle = matrix_from_rotation_vector(0.5 * vector)
    np.testing.assert_allclose(turns.sums[0, :, :, 3], middle, atol=1e-15)


@pytest.mark.parametrize("edge", ["first", "last"])
def test_a_mean_at_the_edge_of_a_hold_turns_every_sample_there_by_its_window_s_own_bias(
    edge: Literal["first", "last"],
) -> None:
    windows, time, omega = (
        np.array([(0, 200), (200, 400)]),
        np.arange(400) / 100.0,
        np.array([0.02, -0.05, 0.03]),
    )
    biases = np.array([[300.0, -100.0, 200.0], [-200.0, 400.0, 100.0]])
    force = Rotation.from_rotvec(time[:, None] * omega).inv().apply([2.0, -3.0, 9.0])
    raw_force = force @ np.linalg.inv(FORCE_INVERSE).T + FORCE_BIAS
    raw_rate = np.tile(omega, (400, 1)) @ np.linalg.inv(GYRO_INVERSE).T + np.repeat(biases, 200, axis=0)
    index = windows[:, 0] if edge == "first" else windows[:, 1] - 1

    def averaged(biases: Array, windows: npt.NDArray[np.int64] = windows) -> Array:
        inverse = Inverse(GYRO_INVERSE, biases, FORCE_INVERSE, FORCE_BIAS)
        return average_at_edge(time, raw_rate, raw_force, windows, inverse, edge)

    np.testing.assert_allclose(averaged(biases), force[index], atol=1e-12)
    assert np.all(np.linalg.norm(averaged(biases[::-1].copy()) - force[index], axis=1) > 0.1)
    for window in [(-1, 5), (390, 401), (5, 5)]:
        with pytest.raises(IndexError, match="inside 0 to 400"):
            averaged(biases[:1], np.array([window]))
    with pytest.raises(ValueError, match="2 windows want as many gyro biases"):
        averaged(biases[:1])


@pytest.mark.parametrize(
    ("starts", "stops", "rates", "said"),
    [
        *(([start], [stop], 5, "inside 0 to 5") for start, stop in [(-1, 3), (0, 6), (3, 3), (4, 2), (5, 6)]),
        ([0, 2], [5, 2], 5, "inside 0 to 5"),
        ([0], [5], 4, "5 stamps want as many rates and forces"),
        ([0, 1], [5], 5, "2 starts and 1 stops"),
    ],
)
def test_ranges_outside_the_samples_and_lengths_that_differ_are_refused(
    starts: list[int], stops: list[int], rates: int, said: str
) -> None:
    with pytest.raises((IndexError, ValueError), match=said):
        integrate_turns(
            np.arange(5.0), np.zeros((rates, 3)), np.zeros((5, 3)), np.array(starts), np.array(stops), BOTH
        )
