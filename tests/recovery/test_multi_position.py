"""The multi-position procedure finds what made the hold means, with numbers that a reader can check."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.calibration import Estimate, calibrate_multi_position
from tumble.calibration.prior import StableKnowledge
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ObservabilityError, UsageError
from tumble.recording import Recording
from tumble.segmentation import HoldMeans

SITE = Site.from_gravity(9.8)

# raw = M f + b with M = [[1.02, 0, 0], [-0.01, 0.98, 0], [0.03, -0.02, 1.05]], b = (0.1, -0.2, 0.3).
MATRIX = np.array([[1.02, 0.0, 0.0], [-0.01, 0.98, 0.0], [0.03, -0.02, 1.05]])
BIAS = np.array([0.1, -0.2, 0.3])
# True specific force (gravity 9.8 m/s², 3-4-5 triangles) and raw output, multiplied out by hand.
BY_HAND = (
    ((9.8, 0.0, 0.0), (10.096, -0.298, 0.594)),
    ((-9.8, 0.0, 0.0), (-9.896, -0.102, 0.006)),
    ((0.0, 9.8, 0.0), (0.1, 9.404, 0.104)),
    ((0.0, -9.8, 0.0), (0.1, -9.804, 0.496)),
    ((0.0, 0.0, 9.8), (0.1, -0.2, 10.59)),
    ((0.0, 0.0, -9.8), (0.1, -0.2, -9.99)),
    ((5.88, 7.84, 0.0), (6.0976, 7.4244, 0.3196)),
    ((0.0, 5.88, 7.84), (0.1, 5.5624, 8.4144)),
    ((7.84, 0.0, 5.88), (8.0968, -0.2784, 6.7092)),
    ((-5.88, 0.0, 7.84), (-5.8976, -0.1412, 8.3556)),
)


def means_of(
    force: np.ndarray, rate: np.ndarray | None = None, sigma: tuple[float, float] = (1e-4, 1e-9)
) -> HoldMeans:
    holds = len(force)
    none = np.full(holds, 99.0)
    return HoldMeans(
        specific_force=force,
        specific_force_covariance=sigma[0] ** 2 * np.tile(np.eye(3), (holds, 1, 1)),
        specific_force_dof=none,
        angular_rate=rate,
        angular_rate_covariance=None if rate is None else sigma[1] ** 2 * np.tile(np.eye(3), (holds, 1, 1)),
        angular_rate_dof=None if rate is None else none,
        duration=np.full(holds, 10.0),
        time=20.0 * np.arange(holds, dtype=float),
        count=np.full(holds, 1000.0),
        temperature=None,
    )


def recording_of(means: HoldMeans, units: tuple[str, str] = ("m/s^2", "rad/s")) -> Recording:
    """A recording that only says its units: the procedure looks at nothing else."""
    return Recording(means.time, means.specific_force, means.angular_rate, units[0], units[1], 100.0)


def calibrate(
    means: HoldMeans, units: tuple[str, str] = ("m/s^2", "rad/s"), prior: StableKnowledge | None = None
) -> Estimate:
    return calibrate_multi_position(recording_of(means, units), means, SITE, prior=prior)


def raw_by_hand() -> np.ndarray:
    return np.array([raw for _, raw in BY_HAND])


@pytest.mark.parametrize("poses", [9, 10])
def test_nine_or_ten_poses_written_out_by_hand_give_matrix_and_bias(poses: int) -> None:
    """Nine poses for nine unknowns leave no redundancy, and the answer is exact all the same.

    Arithmetic: the raw numbers are exact to 1e-15, the poses amplify by less than 10.
    """
    estimate = calibrate(means_of(raw_by_hand()[:poses]))
    assert estimate.model.accelerometer is not None
    np.testing.assert_allclose(estimate.model.accelerometer.matrix, MATRIX, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(estimate.model.accelerometer.bias, BIAS, rtol=1e-9)
    assert estimate.degrees_of_freedom == poses - 9


def test_counts_of_a_converter_give_the_matrix_in_counts() -> None:
    """The zero of the converter is at 32768 counts, and a m/s² is 400: nothing is near SI."""
    counts = 32768.0 + 400.0 * raw_by_hand()
    estimate = calibrate(means_of(counts, sigma=(0.04, 1.0)), units=("counts", "counts"))
    assert estimate.model.accelerometer is not None
    np.testing.assert_allclose(estimate.model.accelerometer.matrix, 400.0 * MATRIX, rtol=1e-9, atol=4e-8)
    np.testing.assert_allclose(estimate.model.accelerometer.bias, 32768.0 + 400.0 * BIAS, rtol=1e-9)


def test_a_force_in_g_gives_a_matrix_in_g_per_si_unit() -> None:
    estimate = calibrate(means_of(raw_by_hand() / 9.80665), units=("g", "deg/s"))
    assert estimate.model.accelerometer is not None
    np.testing.assert_allclose(estimate.model.accelerometer.matrix, MATRIX / 9.80665, rtol=1e-9, atol=1e-11)
    scales = {p.name: p.value for p in estimate.parameters}
    # Row lengths of the matrix less one: sqrt(1.02²), sqrt(0.01² + 0.98²), sqrt(0.03² + 0.02² + 1.05²).
    assert scales["accelerometer scale factor error x"] == pytest.approx(0.02, abs=1e-9)
    assert scales["accelerometer scale factor error y"] == pytest.approx(np.sqrt(0.9605) - 1.0, abs=1e-9)
    assert scales["accelerometer scale factor error z"] == pytest.approx(np.sqrt(1.1038) - 1.0, abs=1e-9)


def test_gyros_that_see_the_earth_rate_give_their_lower_triangular_factor() -> None:
    """The Earth rate's direction in b is scipy's, pose by pose; norms see no rotation between triads."""
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng(11)
    attitudes = Rotation.random(30, rng)
    latitude = np.radians(40.0)
    earth_rate_n = EARTH_RATE * np.array([np.cos(latitude), 0.0, -np.sin(latitude)])
    force = attitudes.inv().apply([0.0, 0.0, -9.8]) @ MATRIX.T + BIAS
    own = np.array([[0.995, 0.0, 0.0], [0.004, 1.01, 0.0], [-0.007, 0.006, 1.02]])
    between = Rotation.from_rotvec([0.02, -0.01, 0.03]).as_matrix()
    bias = np.array([2e-6, -5e-6, 3e-6])
    rate = attitudes.inv().apply(earth_rate_n) @ (own @ between).T + bias
    estimate = calibrate(means_of(force, rate, sigma=(1e-4, 1e-9)))
    assert estimate.model.gyroscope is not None
    # Arithmetic at 1e-16 of 7e-5 rad/s, and the adjustment's own stop at a millionth of sigma (1e-9).
    np.testing.assert_allclose(estimate.model.gyroscope.matrix, own, atol=1e-9)
    np.testing.assert_allclose(estimate.model.gyroscope.bias, bias, atol=1e-13)
    assert any("rotation between the triads" in sentence for sentence in estimate.not_determined)


def test_gyros_that_do_not_see_the_earth_rate_give_their_mean_as_bias_and_say_so() -> None:
    rng = np.random.default_rng(2)
    rate = np.array([0.02, -0.01, 0.03]) + 1e-4 * rng.standard_normal((10, 3))
    estimate = calibrate(means_of(raw_by_hand(), rate, sigma=(1e-4, 1e-4)))
    assert estimate.model.gyroscope is not None
    np.testing.assert_allclose(estimate.model.gyroscope.bias, rate.mean(axis=0), rtol=1e-12)
    assert not any(name.startswith("gyroscope.matrix") for name in estimate.names)
    assert any("cannot see the Earth's rotation" in sentence for sentence in estimate.remarks)


@pytest.mark.parametrize("latitude_deg", [None, 50.0, -50.0])
def test_hold_means_tell_g_sensitivity_and_a_latitude_takes_the_earth_rate_out(
    latitude_deg: float | None,
) -> None:
    """Rate = bias + G f exactly; a latitude adds the Earth rate's vertical part, Omega sin(latitude) f / g.

    Arithmetic: a linear regression on numbers near 1e-2 (1e-14). The accelerometer's own error is 1e-10.
    """
    sensitivity = 1e-4 * np.array([[11.0, -23.0, 5.0], [31.0, -13.0, 19.0], [-27.0, 16.0, -7.0]])
    force = np.array([true for true, _ in BY_HAND])
    bias = np.array([0.02, -0.01, 0.03])
    rate = bias + force @ sensitivity.T
    site = SITE
    if latitude_deg is not None:
        latitude = float(np.radians(latitude_deg))
        site = Site(9.8, 0.0, latitude, 0.0, "by hand")
        rate = rate + EARTH_RATE * np.sin(latitude) * force / 9.8
    means = means_of(raw_by_hand(), rate, sigma=(1e-4, 1e-5))
    estimate = calibrate_multi_position(recording_of(means), means, site)
    assert estimate.model.g_sensitivity is not None
    assert estimate.model.gyroscope is not None
    np.testing.assert_allclose(estimate.model.g_sensitivity, sensitivity, atol=1e-11)
    np.testing.assert_allclose(estimate.model.gyroscope.bias, bias, atol=1e-10)


def test_six_poses_and_the_angles_of_an_earlier_calibration_give_bias_and_scale_factors() -> None:
    # The matrix's own angles: sin(yz) = 0.01 / |row y|, sin(zy) = 0.03 / |row z|, tan(zx) = 0.02 / 1.05.
    angles = np.array([np.arctan2(0.01, 0.98), np.arctan2(0.02, 1.05), np.arcsin(0.03 / np.sqrt(1.1038))])
    prior = StableKnowledge(angles, np.diag([1e-5, 2e-5, 3e-5]) ** 2)
    six = means_of(raw_by_hand()[:6])
    estimate = calibrate(six, prior=prior)
    assert estimate.model.accelerometer is not None
    np.testing.assert_allclose(estimate.model.accelerometer.matrix, MATRIX, atol=1e-9)
    np.testing.assert_allclose(estimate.model.accelerometer.bias, BIAS, atol=1e-8)
    with pytest.raises(ObservabilityError, match="--prior"):
        calibrate(six)


def test_an_outlying_hold_is_named_and_leaves_no_trace_in_the_estimate() -> None:
    """Twenty holds, one of which was pushed by 50 sigma along gravity, where its norm shows it."""
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng(8)
    force = Rotation.random(20, rng).apply([9.8, 0.0, 0.0])
    raw = force @ MATRIX.T + BIAS + 1e-4 * rng.standard_normal((20, 3))
    clean = calibrate(means_of(raw))
    pushed = raw.copy()
    pushed[7] *= 1.0 + 50.0 * 1e-4 / 9.8
    estimate = calibrate(means_of(pushed))
    assert [(left.kind, left.index) for left in estimate.left_out] == [("hold", 7)]
    assert not clean.left_out
    assert estimate.model.accelerometer is not None
    # Statistics: 1e-4 of noise a hold, 20 holds, at most three times amplified, at 4 sigma.
    np.testing.assert_allclose(estimate.model.accelerometer.matrix, MATRIX, atol=4 * 3e-4 / 9.8)
    np.testing.assert_allclose(estimate.model.accelerometer.bias, BIAS, atol=4 * 3e-4)


def test_an_unknown_gravity_is_in_the_scale_factors_together_and_nowhere_else() -> None:
    """d scale / scale = -d gravity / gravity; 0.015 m/s² of 9.80665 is 0.15 %."""
    means = means_of(raw_by_hand() * 9.80665 / 9.8)
    known = Site.from_gravity(9.80665)
    vague = Site.unknown()
    exact = calibrate_multi_position(recording_of(means), means, known)
    wide = calibrate_multi_position(recording_of(means), means, vague)
    added = wide.covariance - exact.covariance
    assert wide.model.accelerometer is not None
    matrix = wide.model.accelerometer.matrix.ravel()
    expected = np.zeros_like(added)
    slope = matrix / vague.gravity * vague.gravity_sigma
    expected[:9, :9] = np.outer(slope, slope)
    np.testing.assert_allclose(added, expected, atol=1e-12)


# Orthogonal axes: raw = diag(1.02, 0.98, 1.05) f + (0.1, -0.2, 0.3), six faces multiplied out by hand.
SIX_FACES_ORTHOGONAL = (
    (10.096, -0.2, 0.3),
    (-9.896, -0.2, 0.3),
    (0.1, 9.404, 0.3),
    (0.1, -9.804, 0.3),
    (0.1, -0.2, 10.59),
    (0.1, -0.2, -9.99),
)


def test_six_unknowns_of_six_faces_are_bias_and_scale_factors_and_the_rest_is_said_to_be_nominal() -> None:
    means = means_of(np.array(SIX_FACES_ORTHOGONAL))
    estimate = calibrate_multi_position(recording_of(means), means, SITE, unknowns=6)
    assert estimate.model.accelerometer is not None
    np.testing.assert_allclose(estimate.model.accelerometer.matrix, np.diag([1.02, 0.98, 1.05]), atol=1e-9)
    np.testing.assert_allclose(estimate.model.accelerometer.bias, BIAS, atol=1e-9)
    assert any("non-orthogonalities were not estimated" in sentence for sentence in estimate.not_determined)


def test_three_unknowns_are_the_biases_with_the_scale_factors_nominal() -> None:
    # raw = f + (0.1, -0.2, 0.3): the three positive faces and one negative.
    faces = 9.8 * np.vstack([np.eye(3), [[0.0, 0.0, -1.0]]]) + BIAS
    means = means_of(faces)
    estimate = calibrate_multi_position(recording_of(means), means, SITE, unknowns=3)
    assert estimate.model.accelerometer is not None
    np.testing.assert_allclose(estimate.model.accelerometer.bias, BIAS, atol=1e-9)
    np.testing.assert_array_equal(estimate.model.accelerometer.matrix, np.eye(3))


@pytest.mark.parametrize(("unknowns", "unit", "words"), [(4, "m/s^2", "9"), (3, "counts", "raw counts")])
def test_other_numbers_of_unknowns_and_biases_of_counts_are_refused(
    unknowns: int, unit: str, words: str
) -> None:
    means = means_of(raw_by_hand())
    with pytest.raises(UsageError, match=words):
        calibrate_multi_position(recording_of(means, (unit, "rad/s")), means, SITE, unknowns=unknowns)
