"""A unit on its mount: exact and first-order angles from gravity in two attitudes (Savage 2018, section 10)."""

import numpy as np
import pytest

from tumble.attitude import matrix_from_rotation_vector
from tumble.calibration.mount import align_to_mount, check_poses, mean_covariances
from tumble.errors import ObservabilityError
from tumble.sensor import Triad

GRAVITY = 9.81
GAMMA = np.array([1.7e-3, -0.9e-3, 2.3e-3])
NOISE = 1e-8 * np.eye(6)


def forces(gamma, *, z_up=False, pitch_error=0.0) -> tuple[np.ndarray, np.ndarray]:
    """Specific force in the unit's axes, level and pitched: it points up."""
    C_MB = matrix_from_rotation_vector(gamma)
    up = np.array([0.0, 0.0, 1.0 if z_up else -1.0])
    pitched_up = matrix_from_rotation_vector(np.array([0.0, pitch_error, 0.0])) @ np.array([1.0, 0.0, 0.0])
    return GRAVITY * C_MB.T @ up, GRAVITY * C_MB.T @ pitched_up


@pytest.mark.parametrize("z_up", [False, True])
def test_the_exact_solution_gives_back_any_rotation(z_up: bool) -> None:
    gamma = np.array([0.11, -0.06, 0.15])
    found = align_to_mount(*forces(gamma, z_up=z_up), NOISE)
    np.testing.assert_allclose(found.C_MB, matrix_from_rotation_vector(gamma), atol=1e-12)
    np.testing.assert_allclose(found.angles, gamma, atol=1e-12)
    assert found.z_down is not z_up


def test_a_pitch_that_is_off_ninety_degrees_changes_nothing_and_is_told() -> None:
    found = align_to_mount(*forces(GAMMA, pitch_error=0.02), NOISE)
    np.testing.assert_allclose(found.angles, GAMMA, atol=1e-12)
    assert abs(found.off_right_angle) == pytest.approx(0.02, abs=1e-9)


def test_the_stated_covariance_is_that_of_drawn_noise() -> None:
    """Correlated noise, 20,000 draws: the spread of a variance is 1 %, four of them are allowed."""
    rng = np.random.default_rng(4)
    root = 1e-3 * rng.standard_normal((6, 6))
    level, pitched = forces(GAMMA)
    stated = align_to_mount(level, pitched, root @ root.T).covariance
    drawn = rng.standard_normal((20_000, 6)) @ root.T
    angles = np.array([align_to_mount(level + d[:3], pitched + d[3:], NOISE).angles for d in drawn[:2000]])
    np.testing.assert_allclose(np.cov(angles.T), stated, atol=0.13 * np.max(np.diag(stated)))


def test_an_error_of_the_calibration_counts_in_both_poses() -> None:
    """A bias x shifts γy by its length over g; the same bias in both poses, as the derivative by it says."""
    level, pitched = forces(GAMMA)
    triad = Triad(np.array([[1.01, 0.02, -0.01], [0.0, 0.99, 0.03], [0.0, 0.0, 1.02]]), np.zeros(3))
    names = ["accelerometer.matrix[0,2]", "accelerometer.bias[1]", "gyroscope.bias[0]"]
    sigma = np.diag([3e-4, 2e-3, 1.0])
    got = mean_covariances(triad, [level, pitched], [np.zeros((3, 3))] * 2, names, sigma**2, 0.0)

    def corrected(step: np.ndarray) -> np.ndarray:
        matrix = triad.matrix.copy()
        matrix[0, 2] += step[0]
        other = Triad(matrix, np.array([0.0, step[1], 0.0]))
        return other.correct(triad.distort(np.array([level, pitched]))).ravel()

    steps = np.eye(3) * 1e-6
    effect = np.column_stack([(corrected(s) - corrected(-s)) / 2e-6 for s in steps])
    np.testing.assert_allclose(got, effect @ sigma**2 @ effect.T, rtol=1e-5, atol=1e-15)


def test_noise_and_wandering_biases_count_once_a_pose() -> None:
    triad = Triad(2.0 * np.eye(3), np.zeros(3))
    level, pitched = forces(GAMMA)
    got = mean_covariances(triad, [level, pitched], [np.eye(3) * 4.0] * 2, [], np.zeros((0, 0)), 0.5)
    # 4 raw over 2² of the matrix is 1, and 0.5² beside it
    np.testing.assert_allclose(got, 1.25 * np.eye(6), atol=1e-15)


UP = {axis: sign * GRAVITY * np.eye(3)[k] for k, axis in enumerate("xyz") for sign in (1.0,)}


@pytest.mark.parametrize(
    ("level", "pitched", "words"),
    [
        (UP["x"], UP["z"], "swapped"),
        (UP["z"], UP["z"], "same pose"),
        (UP["y"], UP["x"], "mounted another way"),
        (UP["z"], -UP["x"], "x down"),
        (UP["z"], UP["y"], "another axis"),
        (UP["z"] + 4.0 * np.eye(3)[1], UP["x"], "22° from the vertical"),
    ],
)
def test_other_poses_are_refused_with_what_is_wrong(level, pitched, words) -> None:
    with pytest.raises(ObservabilityError, match=words):
        check_poses(level, pitched)
