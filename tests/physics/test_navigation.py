"""Strapdown navigation held against physics, and against integrations that share nothing with it."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from tumble.earth import (
    EARTH_RATE,
    curvature_radii,
    geodetic_position,
    gravity_vectors_n,
    normal_gravity,
    position_in_earth_frame,
    rotations_to_earth_frame,
)
from tumble.errors import RecordingError, UsageError
from tumble.navigation import InertialSamples, NavigationState, Trajectory, navigate
from tumble.simulation import SplineTrajectory, simulate_drive

HERE = (0.83, 0.15, 400.0)


def earth_from_local(latitude, longitude):
    return rotations_to_earth_frame(np.array([latitude]), np.array([longitude]))[0]


def truth_of(states):
    return Trajectory(
        states.time, states.latitude, states.longitude, states.height, states.velocity_n, states.quaternion_nb
    )


def worst(trajectory, truth):
    return [float(np.abs(errors).max()) for errors in trajectory.errors_against(truth)]


def test_rest_stays_at_rest():
    body = SplineTrajectory.at_rest(HERE, np.array([0.3, -0.2, 2.0]), 600.0)
    time = np.arange(0.0, 600.1, 0.1)
    states = body.states(time)
    truth = truth_of(states)
    samples = InertialSamples(time, states.specific_force_b, states.angular_rate_ib_b)
    position, velocity, attitude = worst(navigate(samples, truth.state(0)), truth)
    # 10 Hz of a body that turns with the Earth by 7 µrad a step: the square of that times gravity, 5e-10 m/s²,
    # is what a step of the second order leaves, integrated twice over ten minutes
    assert position < 1e-4
    assert velocity < 1e-6
    # the level follows the velocity's error over the Earth's radius, 1e-6 / 6e6 rad/s
    assert attitude < 1e-9


def test_increments_of_a_drive_lead_along_it():
    drive = simulate_drive(np.random.default_rng(3), 120.0)
    edges = np.arange(12_001) / 100.0
    samples = InertialSamples.from_increments(edges, *drive.increments(edges))
    truth = truth_of(drive.states(edges))
    position, velocity, attitude = worst(navigate(samples, truth.state(0)), truth)
    # the fourth order of coning and sculling at 100 Hz; a factor of ten above what is left
    assert position < 1e-4
    assert velocity < 3e-6
    assert attitude < 2e-9


def test_increments_and_instants_err_by_the_second_order_of_the_step():
    drive = simulate_drive(np.random.default_rng(5), 60.0)
    errors = []
    for rate in (50, 100):
        time = np.arange(60 * rate + 1) / rate
        states = drive.states(time)
        samples = InertialSamples(time, states.specific_force_b, states.angular_rate_ib_b)
        truth = truth_of(states)
        errors.append(worst(navigate(samples, truth.state(0)), truth)[2])
    # halving the step divides an error of the second order by four
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)


def test_an_independent_integration_of_the_equations_of_motion_agrees():
    """In the Earth frame, by an adaptive method of eighth order, with gravity as the gradient of a potential."""

    def rate(t):
        return np.array([0.3 * np.sin(1.1 * t), 0.2 * np.cos(0.7 * t), 0.1 + 0.05 * np.sin(0.3 * t)])

    def force(t):
        return np.array([1.0 * np.sin(0.5 * t), 0.5 * np.cos(0.9 * t), -9.8 + 0.3 * np.sin(1.3 * t)])

    start = NavigationState.from_angles(0.0, HERE, np.array([12.0, -7.0, 1.0]), np.array([0.1, -0.05, 1.0]))
    C_en = earth_from_local(start.latitude, start.longitude)
    position = position_in_earth_frame(*(np.array([x]) for x in HERE))[0]
    spin = np.array([0.0, 0.0, EARTH_RATE])

    def slope(t, y):
        r, v, C = y[:3], y[3:6], y[6:].reshape(3, 3)
        turning = np.array([np.cross(rate(t), axis) for axis in np.eye(3)]).T
        earth = np.array([np.cross(spin, axis) for axis in np.eye(3)]).T
        acceleration = C @ force(t) + potential_gravity(r) - 2.0 * np.cross(spin, v)
        return np.concatenate([v, acceleration, (C @ turning - earth @ C).ravel()])

    y = np.concatenate([position, C_en @ start.velocity_n, (C_en @ start.C_nb).ravel()])
    solution = solve_ivp(slope, (0.0, 30.0), y, method="DOP853", rtol=1e-12, atol=1e-10).y[:, -1]
    time = np.arange(0.0, 30.0005, 0.001)
    samples = InertialSamples(time, np.array([force(t) for t in time]), np.array([rate(t) for t in time]))
    end = navigate(samples, start).state(-1)
    at = position_in_earth_frame(*(np.array([x]) for x in (end.latitude, end.longitude, end.height)))[0]
    C_end = earth_from_local(end.latitude, end.longitude)
    # linear signals between samples 1 ms apart: f'' dt²/12 of 2 m/s⁴ is 2e-7 m/s², 1e-4 m in 30 s;
    # gravity of the potential and of Somigliana's series differ by 1e-8 m/s² at 400 m
    assert np.linalg.norm(at - solution[:3]) < 2e-4
    assert np.linalg.norm(C_end @ end.velocity_n - solution[3:6]) < 1e-5
    assert np.abs(C_end @ end.C_nb - solution[6:].reshape(3, 3)).max() < 1e-7


def potential_gravity(r):
    """Gravity of WGS 84 by its zonal harmonics to the eighth degree (NGA.STND.0036), centrifugal part included."""
    GM, a = 3.986004418e14, 6378137.0
    zonal = {2: 1.082629821e-3, 4: -2.370911200e-6, 6: 6.083464989e-9, 8: -1.426810879e-11}
    distance = float(np.linalg.norm(r))
    s = r[2] / distance
    radial, along = -GM / distance**2, 0.0
    for degree, J in zonal.items():
        coefficients = np.zeros(degree + 1)
        coefficients[degree] = 1.0
        P = np.polynomial.legendre.legval(s, coefficients)
        dP = np.polynomial.legendre.legval(s, np.polynomial.legendre.legder(coefficients))
        part = GM / distance**2 * J * (a / distance) ** degree
        radial += (degree + 1) * part * P
        along -= part * dP
    unit = r / distance
    return (
        radial * unit
        + along * (np.array([0.0, 0.0, 1.0]) - s * unit)
        + EARTH_RATE**2 * np.array([r[0], r[1], 0.0])
    )


@pytest.mark.parametrize("latitude", [-1.2, -0.3, 0.0, 0.83, 1.5])
@pytest.mark.parametrize("height", [0.0, 1600.0, 9000.0])
def test_gravity_with_height_is_the_gradient_of_the_normal_potential(latitude, height):
    r = position_in_earth_frame(np.array([latitude]), np.array([0.4]), np.array([height]))[0]
    expected = earth_from_local(latitude, 0.4).T @ potential_gravity(r)
    found = gravity_vectors_n(np.array([latitude]), np.array([height]))[0]
    # the series in height is good to 1e-6 m/s² at 10 km, the plumb line's curvature to a hundredth of itself
    assert found == pytest.approx(expected, abs=2e-6)
    assert found[2] == normal_gravity(latitude, height)


def test_a_velocity_error_swings_with_the_schuler_period():
    body = SplineTrajectory.at_rest((0.0, 0.3, 0.0), np.zeros(3), 6000.0)
    time = np.arange(0.0, 6001.0, 1.0)
    states = body.states(time)
    truth = truth_of(states)
    begin = truth.state(0)
    pushed = NavigationState(0.0, 0.0, 0.3, 0.0, np.array([0.1, 0.0, 0.0]), begin.C_nb)
    # on the equator, with an error of velocity along the meridian, Coriolis and the vertical channel stay away
    run = navigate(InertialSamples(time, states.specific_force_b, states.angular_rate_ib_b), pushed)
    north = run.errors_against(truth)[0][:, 0]
    crossings = time[1:][(north[1:] < 0.0) & (north[:-1] >= 0.0)]
    radius = float(curvature_radii(0.0)[0])
    period = 2.0 * np.pi * np.sqrt(radius / normal_gravity(0.0))
    # half a period to the first return to zero; instants are a second apart
    assert crossings[0] == pytest.approx(0.5 * period, abs=2.0)
    # its amplitude is v / w
    assert north.max() == pytest.approx(0.1 * period / (2.0 * np.pi), rel=2e-3)


def test_position_goes_to_the_earth_frame_and_back():
    latitude = np.array([-1.5707, -0.9, 0.0, 0.4, 1.2, np.pi / 2])
    longitude = np.array([0.1, 3.0, -3.1, 0.0, 2.2, 0.3])
    height = np.array([-400.0, 0.0, 9000.0, 1e5, 1.0, 20.0])
    found = geodetic_position(position_in_earth_frame(latitude, longitude, height))
    for value, expected, tolerance in zip(
        found, (latitude, longitude, height), (1e-14, 1e-9, 1e-8), strict=True
    ):
        assert value == pytest.approx(expected, abs=tolerance)


def test_a_spline_trajectory_s_rate_is_that_of_its_attitude():
    drive = simulate_drive(np.random.default_rng(8), 60.0)
    step = 1e-4
    time = np.array([20.0, 33.3, 47.7])
    middle, before, after = (drive.states(time + shift) for shift in (0.0, -step, step))

    def against_space(states):
        C_en = Rotation.from_matrix(rotations_to_earth_frame(states.latitude, states.longitude))
        C_ie = Rotation.from_rotvec(np.outer(EARTH_RATE * states.time, [0.0, 0.0, 1.0]))
        return C_ie * C_en * Rotation.from_quat(states.quaternion_nb)

    turned = (against_space(before).inv() * against_space(after)).as_rotvec() / (2.0 * step)
    # central differences: 1e-8 of the third derivative, and round-off of 1e-16 over 2e-4 s
    assert turned == pytest.approx(middle.angular_rate_ib_b, abs=1e-8)


def test_the_local_level_refuses_the_pole():
    body = SplineTrajectory.at_rest((0.5 * np.pi - 1e-4, 0.0, 0.0), np.zeros(3), 10.0)
    time = np.arange(0.0, 10.1, 0.1)
    states = body.states(time)
    samples = InertialSamples(time, states.specific_force_b, states.angular_rate_ib_b)
    truth = truth_of(states)
    with pytest.raises(UsageError, match="no north"):
        navigate(samples, truth.state(0))


def test_samples_that_are_no_recording_are_refused_in_words():
    time = np.array([0.0, 0.1, 0.1])
    with pytest.raises(RecordingError, match="does not increase"):
        InertialSamples(time, np.zeros((3, 3)), np.zeros((3, 3)))
    bad = np.zeros((3, 3))
    bad[1, 2] = np.nan
    with pytest.raises(RecordingError, match="Sample 2"):
        InertialSamples(np.array([0.0, 0.1, 0.2]), bad, np.zeros((3, 3)))
    samples = InertialSamples(np.array([0.0, 0.1, 0.2]), np.zeros((3, 3)), np.zeros((3, 3)))
    with pytest.raises(RecordingError, match="not inside"):
        navigate(samples, NavigationState(5.0, 0.1, 0.2, 0.0, np.zeros(3), np.eye(3)))


def test_keeping_every_so_many_changes_nothing_but_the_rows():
    drive = simulate_drive(np.random.default_rng(9), 30.0)
    time = np.arange(0.0, 30.0, 0.01)
    states = drive.states(time)
    samples = InertialSamples(time, states.specific_force_b, states.angular_rate_ib_b)
    start = truth_of(states).state(0)
    whole, thin = navigate(samples, start), navigate(samples, start, every=7)
    rows = np.append(np.arange(0, len(time) - 1, 7), len(time) - 1)
    assert np.array_equal(thin.time, whole.time[rows])
    assert np.array_equal(thin.velocity_n, whole.velocity_n[rows])
