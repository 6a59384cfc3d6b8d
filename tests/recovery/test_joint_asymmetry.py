"""Asymmetry in the joint estimator: found where it is, derivatives held against differences."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from recovery.played import by_hand, jointly
from tumble.calibration import Session
from tumble.calibration.equations.imu_unknowns import LAYOUT, imu_unknowns, raw_force, raw_rate, straightened
from tumble.calibration.estimate import Estimate
from tumble.earth import Site
from tumble.sensor import ImuModel, Triad

SITE = Site(9.81, 0.0, float(np.radians(48.0)), 300.0, "as simulated")
OF_FORCE, OF_RATE = np.array([1e-3, -2e-3, 1.5e-3]), np.array([2e-3, -1e-3, 1.5e-3])


def _run() -> Estimate:
    """24 poses of chance for 3 s each, turns of 2 s between them, 50 Hz, white noise."""
    model = ImuModel(
        Triad(
            np.array([[1.01, 0.0, 0.0], [-0.011, 0.99, 0.0], [0.013, -0.009, 1.02]]),
            np.array([0.11, -0.13, 0.09]),
            OF_FORCE,
        ),
        Triad(
            np.array([[0.99, 0.011, -0.013], [-0.014, 1.01, 0.006], [0.007, -0.018, 0.98]]),
            np.array([0.011, -0.013, 0.014]),
            OF_RATE,
        ),
    )
    poses = Rotation.random(24, np.random.default_rng(5))
    recording, timeline = by_hand(poses, model, SITE)
    return jointly(Session(recording, None, SITE), timeline=timeline)


def test_asymmetries_of_both_triads_are_found_and_within_four_sigma() -> None:
    estimate = _run()
    kept = {test.name for test in estimate.terms if test.kept}
    assert kept == {"accelerometer_asymmetry", "gyro_asymmetry"}
    sigma = dict(zip(estimate.names, np.sqrt(np.diag(estimate.covariance)).tolist(), strict=True))
    for kind, true in (("accelerometer", OF_FORCE), ("gyroscope", OF_RATE)):
        found = getattr(estimate.model, kind).asymmetry
        for i in range(3):
            # Six of them in four sigma: once in 2600 recordings one is beyond.
            assert abs(found[i] - true[i]) < 4.0 * sigma[f"{kind}.asymmetry[{i}]"]
            assert sigma[f"{kind}.asymmetry[{i}]"] < 2e-4


def test_derivatives_of_asymmetric_sensors_are_those_of_differences() -> None:
    rng = np.random.default_rng(3)
    u = imu_unknowns(free=np.arange(LAYOUT.size))
    u.values[:12] = [0.1, -0.2, 0.3, 1.01, 0.98, 1.03, 0.01, -0.02, 0.03, 1e-4, -2e-4, 3e-4]
    u["gyro.matrix"][:] = (np.eye(3) + 0.02 * rng.standard_normal((3, 3))).ravel()
    u["gyro.bias"][:], u["gyro.g_sensitivity"][:] = 0.01, 1e-4 * rng.standard_normal(9)
    u["force.asymmetry"][:], u["gyro.asymmetry"][:] = OF_FORCE, OF_RATE
    u["gyro.quadratic"][:] = OF_RATE[::-1]
    force, rate = 9.0 * rng.standard_normal((4, 3)), rng.standard_normal((4, 3))
    step = 1e-6
    for index in range(LAYOUT.size):
        moved = u.copy()
        moved.values[index] += step
        for here, there in (
            (raw_force(u, force), raw_force(moved, force)),
            (raw_rate(u, rate, force), raw_rate(moved, rate, force)),
        ):
            by_unknowns = u.columns(here.by_blocks)
            # Second order in 1e-6 over 1e-6, of forces squared.
            np.testing.assert_allclose((there.value - here.value) / step, by_unknowns[:, :, index], atol=3e-4)


def test_without_asymmetry_a_gyro_shows_what_a_symmetric_and_linear_one_would() -> None:
    u = imu_unknowns()
    u["gyro.matrix"][:] = np.array([[0.99, 0.02, 0.0], [0.01, 1.02, -0.03], [0.0, 0.02, 0.98]]).ravel()
    u["gyro.bias"][:] = [0.01, -0.02, 0.03]
    rate = np.array([[1.0, -2.0, 0.5], [-0.3, 0.4, -1.5]])
    symmetric = raw_rate(u, rate, np.zeros((2, 3))).value
    u["gyro.asymmetry"][:], u["gyro.quadratic"][:] = OF_RATE, OF_RATE[::-1]
    shown = raw_rate(u, rate, np.zeros((2, 3))).value
    np.testing.assert_allclose(straightened(u, shown), symmetric, rtol=1e-14)
