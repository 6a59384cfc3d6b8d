"""What physics promises: at rest the specific force is minus gravity, and a closed turn leads home."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.attitude import Inverse, integrate_turns
from tumble.earth import EARTH_RATE, Site
from tumble.sensor import ImuModel, Triad

IMU = ImuModel(
    Triad(
        np.array([[410.0, 3.0, -7.0], [9.0, 420.0, 5.0], [-4.0, 11.0, 430.0]]),
        np.array([33000.0, 32500.0, 32900.0]),
    ),
    Triad(
        np.array([[4700.0, 30.0, -20.0], [-50.0, 4800.0, 10.0], [70.0, 40.0, 4750.0]]),
        np.array([60.0, -20.0, 5.0]),
    ),
    np.array([[1.0, -0.5, 0.2], [0.3, 0.8, -0.6], [-0.1, 0.4, 0.9]]),
)


def test_a_level_unit_with_its_z_axis_up_reads_plus_g_on_z():
    gravity_n = np.array([0.0, 0.0, 9.8])  # down is positive
    C_nb = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])  # x north, y west, z up
    assert np.linalg.det(C_nb) == 1.0
    specific_force_b = C_nb.T @ -gravity_n
    assert np.array_equal(specific_force_b, [0.0, 0.0, 9.8])
    plain = Triad(np.eye(3), np.zeros(3))
    assert plain.distort(specific_force_b[None, :])[0, 2] == 9.8
    # the third column of the matrix, not its third row: 430 * 9.8 + 32900, 5 * 9.8 + 32500, ...
    assert IMU.accelerometer is not None
    raw = IMU.accelerometer.distort(specific_force_b[None, :])[0]
    np.testing.assert_allclose(raw, [33000.0 - 68.6, 32500.0 + 49.0, 32900.0 + 4214.0], rtol=1e-15)


def test_at_rest_in_any_attitude_the_corrected_force_is_minus_gravity_and_the_rate_the_earth_s():
    site = Site.from_latitude(math.radians(-33.0))
    attitudes_nb = Rotation.random(50, random_state=np.random.default_rng(5))
    force = attitudes_nb.inv().apply([0.0, 0.0, -site.gravity])
    rate = attitudes_nb.inv().apply(site.earth_rate_n)
    corrected_force, corrected_rate = IMU.correct(*IMU.distort(force, rate))
    # round-off of raw counts of 37000 at 410 a m/s²; and of 60 counts at 4700 a rad/s plus the force's
    np.testing.assert_allclose(corrected_force, force, atol=1e-12)
    np.testing.assert_allclose(corrected_rate, rate, atol=1e-15 * 60)
    assert np.linalg.norm(corrected_force, axis=1) == pytest.approx(site.gravity, abs=1e-12)
    assert np.linalg.norm(corrected_rate, axis=1) == pytest.approx(EARTH_RATE, abs=1e-13)
    # gravity is along minus the specific force, and the Earth's axis 33 degrees below the horizon there
    slope = np.einsum("ki,ki->k", -corrected_force, corrected_rate) / (site.gravity * EARTH_RATE)
    np.testing.assert_allclose(slope, math.sin(math.radians(33.0)), atol=1e-9)


def turned(time, rate):
    raw_force, raw_rate = IMU.distort(np.tile([1.0, -3.0, 9.0], (time.size, 1)), rate)
    assert IMU.gyroscope is not None
    assert IMU.accelerometer is not None
    gyro, force = IMU.gyroscope, IMU.accelerometer
    straight = np.linalg.inv(gyro.matrix), gyro.bias, np.linalg.inv(force.matrix), force.bias
    inverse = Inverse(*straight, np.zeros((3, 3)) if IMU.g_sensitivity is None else IMU.g_sensitivity)
    return integrate_turns(
        time,
        raw_rate,
        raw_force,
        np.array([0]),
        np.array([time.size]),
        inverse,
    ).C_start_end[0]


def test_a_full_turn_about_any_axis_leads_back():
    time = np.linspace(0.0, 4.0, 401)
    axis = np.array([2.0, -3.0, 6.0]) / 7.0
    C = turned(time, np.tile(2.0 * math.pi / 4.0 * axis, (401, 1)))
    np.testing.assert_allclose(C, np.eye(3), atol=1e-12)  # 400 products of round-off


def test_a_motion_played_there_and_back_leads_home():
    time = np.linspace(0.0, 6.0, 601)
    there = np.column_stack([np.sin(time), 1.5 * np.cos(2.0 * time), time - 2.0])[:301]
    rate = np.vstack([there, -there[-2::-1]])
    rate[300] = 0.0  # the rate jumps there: both halves end in the same sample, at rest
    there[300] = 0.0
    C = turned(time, rate)
    np.testing.assert_allclose(C, np.eye(3), atol=1e-12)
    # though it had turned far away at the middle
    assert np.linalg.norm(turned(time[:301], there) - np.eye(3)) > 1.0


def test_the_order_of_turns_matters():
    # A quarter about x, then a quarter about y, then both undone in the same order: not home.
    steps = np.array([[1.0, 0, 0], [0, 1.0, 0], [-1.0, 0, 0], [0, -1.0, 0]]) * math.pi / 2
    C = np.eye(3)
    for step in steps:
        C = C @ turned(np.array([0.0, 1.0]), np.tile(step, (2, 1)))
    expected = Rotation.from_rotvec(steps)
    by_scipy = (expected[0] * expected[1] * expected[2] * expected[3]).as_matrix()
    np.testing.assert_allclose(C, by_scipy, atol=1e-13)
    assert np.linalg.norm(C - np.eye(3)) > 1.0


def test_a_unit_at_rest_on_the_earth_closes_its_turn_in_a_sidereal_day():
    site = Site.from_latitude(math.radians(52.0))
    day = 2.0 * math.pi / EARTH_RATE
    time = np.linspace(0.0, day, 1001)
    C = turned(time, np.tile(site.earth_rate_n, (1001, 1)))
    # round-off of raw counts (1e-14 of a rad/s at some 60 counts), over 86164 s
    np.testing.assert_allclose(C, np.eye(3), atol=3e-9)
