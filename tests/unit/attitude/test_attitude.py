"""Rotations against scipy and closed forms, and raw rates integrated to attitude."""

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation

from tumble.attitude import (
    Inverse,
    angle_between,
    find_nearest_rotation,
    integrate_turns,
    matrix_from_rotation_vector,
    rotation_between,
    rotation_vector_from_matrix,
    skew,
    tangent_basis,
)
from tumble.attitude.integration import average_at_edge
from tumble.attitude.rotations import (
    angles_from_matrices,
    matrices_from_quaternions,
    matrix_from_angles,
    matrix_from_turn,
    quaternion_from_matrix,
    rotation_angle,
    rotation_vectors_from_matrices,
)

# A few units in the last place of numbers near one.
ROUND_OFF = 4e-15


def test_skew_is_the_cross_product():
    a, b = np.array([1.0, -2.0, 5.0]), np.array([3.0, 7.0, -11.0])
    assert np.array_equal(skew(a) @ b, np.cross(a, b))


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.99e-4, 1.01e-4, 1e-3, 1.0, 3.0, np.pi, 5.0])
def test_the_exponential_agrees_with_scipy_on_both_sides_of_the_series(angle):
    vector = angle * np.array([2.0, -3.0, 6.0]) / 7.0
    expected = Rotation.from_rotvec(vector).as_matrix()
    np.testing.assert_allclose(matrix_from_rotation_vector(vector), expected, atol=ROUND_OFF)


def test_the_logarithm_keeps_the_axis_near_a_half_turn_and_all_digits_of_a_tiny_one():
    for short_of in (1e-3, 1e-6, 1e-9):
        vector = (np.pi - short_of) * np.array([2.0, -3.0, 6.0]) / 7.0
        again = rotation_vector_from_matrix(Rotation.from_rotvec(vector).as_matrix())
        np.testing.assert_allclose(again, vector, atol=2e-14)
    vector = np.array([1e-10, -3e-11, 7e-12])
    again = rotation_vector_from_matrix(matrix_from_rotation_vector(vector))
    # off-diagonal elements are the vector itself: relative round-off survives
    np.testing.assert_allclose(again, vector, rtol=1e-14)
    assert np.array_equal(rotation_vector_from_matrix(np.eye(3)), np.zeros(3))


def test_the_angle_between_directions_is_accurate_where_the_cosine_is_not():
    x = np.array([3.0, 0.0, 0.0])
    assert angle_between(x, np.array([1.0, 1e-9, 0.0])) == pytest.approx(1e-9, rel=1e-14)
    assert angle_between(x, np.array([-1.0, 1e-9, 0.0])) == pytest.approx(np.pi - 1e-9, abs=1e-15)
    assert angle_between(x, np.array([0.0, 0.0, -7.0])) == pytest.approx(np.pi / 2, abs=ROUND_OFF)


def test_a_tangent_basis_is_a_right_handed_frame_with_its_direction():
    direction = np.array([1.0, -8.0, 4.0]) / 9.0
    basis = tangent_basis(17.0 * direction)
    frame = np.column_stack([direction, basis])
    np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=ROUND_OFF)
    assert np.linalg.det(frame) == pytest.approx(1.0, abs=ROUND_OFF)


def test_the_nearest_rotation_is_the_polar_factor_and_never_a_reflection():
    C = Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()
    stretch = np.array([[2.0, 0.3, 0.1], [0.3, 1.5, -0.2], [0.1, -0.2, 1.1]])  # symmetric, positive
    # C times a positive symmetric matrix is its polar decomposition, whose rotation is the nearest
    np.testing.assert_allclose(find_nearest_rotation(C @ stretch), C, atol=ROUND_OFF)
    mirrored = find_nearest_rotation(C @ np.diag([1.0, 1.0, -0.5]))
    np.testing.assert_allclose(mirrored, C, atol=ROUND_OFF)


def test_the_rotation_between_two_directions_is_the_shortest_and_takes_one_to_the_other():
    one, other = np.array([1.0, -2.0, 2.0]) / 3.0, np.array([0.0, 0.6, 0.8])
    C = rotation_between(2.0 * one, other)
    np.testing.assert_allclose(C @ one, other, atol=ROUND_OFF)
    assert rotation_angle(C) == pytest.approx(angle_between(one, other), abs=ROUND_OFF)


@pytest.mark.parametrize("function", [rotation_between, angle_between])
def test_a_zero_vector_has_no_direction(function):
    with pytest.raises(ValueError, match="a zero vector has no direction"):
        function(np.array([1.0, 0.0, 0.0]), np.zeros(3))
    with pytest.raises(ValueError, match="a zero vector has no direction"):
        tangent_basis(np.zeros(3))


@pytest.mark.parametrize("angle", [0.0, 1e-13, 1e-9, 1e-3, 1.0, 2.0, 2.2, 3.1, np.pi - 1e-9])
def test_many_rotation_vectors_at_once_are_those_of_scipy(angle):
    directions = np.random.default_rng(3).normal(size=(50, 3))
    vectors = angle * directions / np.linalg.norm(directions, axis=1)[:, None]
    made = rotation_vectors_from_matrices(Rotation.from_rotvec(vectors).as_matrix())
    np.testing.assert_allclose(made, vectors, rtol=1e-12, atol=4e-15)
    assert rotation_vectors_from_matrices(np.zeros((0, 3, 3))).shape == (0, 3)


@pytest.mark.parametrize("angle", [0.0, 1e-9, -0.7, 3.0, 7.5])
def test_a_turn_about_an_axis_of_any_length_is_scipy_s(angle):
    axis = np.array([0.3, -2.0, 1.1])
    expected = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))
    C = matrix_from_turn(axis, angle)
    np.testing.assert_allclose(C, expected.as_matrix(), rtol=0.0, atol=ROUND_OFF)
    assert rotation_angle(C) == pytest.approx(expected.magnitude(), rel=1e-12, abs=ROUND_OFF)


ANYHOW = Rotation.from_quat(np.random.default_rng(1).standard_normal((300, 4)))
HALF_TURNS = Rotation.from_rotvec(np.pi * np.vstack([np.eye(3), -np.eye(3), np.full((1, 3), 3.0**-0.5)]))


def test_quaternions_are_scipy_s_up_to_their_sign_and_lead_back_whatever_their_length():
    every = Rotation.concatenate([ANYHOW, HALF_TURNS, Rotation.identity()])
    for matrix, expected in zip(every.as_matrix(), every.as_quat(), strict=True):
        found = quaternion_from_matrix(matrix)
        # round-off of numbers of order one
        assert found * np.sign(found @ expected) == pytest.approx(expected, abs=1e-14)
    np.testing.assert_allclose(
        matrices_from_quaternions(3.0 * every.as_quat()), every.as_matrix(), atol=1e-15
    )


def test_angles_are_scipy_s_and_lead_back():
    angles = angles_from_matrices(ANYHOW.as_matrix())
    np.testing.assert_allclose(angles, ANYHOW.as_euler("ZYX")[:, ::-1], atol=1e-12)
    for matrix, three in zip(ANYHOW.as_matrix(), angles, strict=True):
        np.testing.assert_allclose(matrix_from_angles(three), matrix, atol=1e-15)


@pytest.mark.parametrize("pitch", [0.5 * np.pi, -0.5 * np.pi])
def test_upright_roll_is_zero_and_yaw_has_all_of_the_turn(pitch):
    matrix = matrix_from_angles(np.array([0.4, pitch, 1.1]))
    (three,) = angles_from_matrices(matrix[None])
    assert three[0] == 0.0
    assert three[1] == pytest.approx(pitch, abs=1e-12)
    np.testing.assert_allclose(matrix_from_angles(three), matrix, atol=1e-12)


Array = npt.NDArray[np.float64]


# Corrected = inverse @ (raw - bias [- G f]); nothing symmetric, nothing near one.
GYRO_INVERSE = np.array([[0.9, 0.03, -0.05], [0.02, 1.1, 0.04], [-0.06, 0.01, 0.8]]) * 1e-3


GYRO_BIAS = np.array([40.0, -70.0, 25.0])
FORCE_INVERSE = np.array([[1.2, -0.02, 0.04], [0.05, 0.9, 0.01], [-0.03, 0.06, 1.1]]) * 1e-2
FORCE_BIAS = np.array([-11.0, 5.0, 8.0])
G_SENSITIVITY = np.array([[0.5, -0.2, 0.1], [0.3, 0.4, -0.6], [-0.1, 0.2, 0.7]])
BOTH = Inverse(GYRO_INVERSE, GYRO_BIAS, FORCE_INVERSE, FORCE_BIAS)


def raw_of(rate, force):
    """What the sensors put out, by the forward matrices."""
    raw_force = force @ np.linalg.inv(FORCE_INVERSE).T + FORCE_BIAS
    raw_rate = rate @ np.linalg.inv(GYRO_INVERSE).T + GYRO_BIAS + force @ G_SENSITIVITY.T
    return raw_rate, raw_force


def integrated(time, rate, force=None, starts=None, stops=None):
    force = np.tile([1.0, -2.0, 9.0], (time.size, 1)) if force is None else force
    raw_rate, raw_force = raw_of(rate, force)
    inverse = BOTH._replace(g_sensitivity=G_SENSITIVITY)
    starts = np.array([0]) if starts is None else starts
    stops = np.array([time.size]) if stops is None else stops
    return integrate_turns(time, raw_rate, raw_force, starts, stops, inverse)


def wobble(time):
    """A rate and a specific force that change on all axes."""
    t = time[:, None]
    rate = np.hstack([1.5 * np.sin(2 * t), 0.8 * np.cos(3 * t) + 0.4, -1.2 * np.sin(t + 0.5)])
    force = np.hstack([3.0 * np.cos(t), 9.0 - 2.0 * t, -4.0 * np.sin(2 * t)])
    return rate, force


def test_a_constant_rate_is_integrated_exactly_whatever_the_steps():
    rng = np.random.default_rng(3)
    # Uneven stamps with a gap of a second among them: the step is taken from the stamps.
    time = np.sort(np.concatenate([rng.uniform(0.0, 2.0, 60), rng.uniform(3.0, 4.0, 40)]))
    omega = np.array([0.7, -1.3, 2.1])
    turns = integrated(time, np.tile(omega, (time.size, 1)))
    expected = Rotation.from_rotvec(omega * (time[-1] - time[0])).as_matrix()
    # 100 products of round-off, with rates that carry the round-off of a matrix solved
    np.testing.assert_allclose(turns.C_start_end[0], expected, atol=2e-13)
    assert turns.duration[0] == time[-1] - time[0]


def test_ranges_are_half_open_and_turns_are_independent():
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


def coning(time, half_angle, frequency):
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


def test_coning_follows_its_closed_form_to_the_second_order_of_the_step():
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


def test_the_sums_of_a_constant_rate_are_the_integral_of_the_rotation():
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
def test_both_branches_of_the_step_are_exact_at_its_end_and_at_its_middle(small):
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
def test_a_mean_at_the_edge_of_a_hold_turns_every_sample_there_by_its_window_s_own_bias(edge):
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

    def averaged(biases, windows=windows):
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
def test_ranges_outside_the_samples_and_lengths_that_differ_are_refused(starts, stops, rates, said):
    with pytest.raises((IndexError, ValueError), match=said):
        integrate_turns(
            np.arange(5.0), np.zeros((rates, 3)), np.zeros((5, 3)), np.array(starts), np.array(stops), BOTH
        )
