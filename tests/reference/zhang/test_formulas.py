"""Zhang's formulas as printed and as they have to be, on readings without noise that are made here."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.calibration.closed_forms.inter_triad import rotation_from_two_axes, triad_rotation
from tumble.calibration.closed_forms.separate_norms import (
    bias_from_static_pairs,
    ellipsoid_from_norms,
    matrix_from_rotations,
)
from tumble_papers.zhang.formulas import (
    pair_bias,
    printed_derivatives,
    printed_design,
    smallest_share,
    squared_norm,
    stepped_derivatives,
)

G = 9.8
SECOND = np.pi / 648000.0
# Lower triangular, of large and different angles.
MATRIX = np.array([[90.0, 0.0, 0.0], [12.0, 110.0, 0.0], [-7.0, 15.0, 100.0]])
BIAS = np.array([3.0, -20.0, 11.0])
EARTH = 7.292115e-5
RATE_MATRIX, RATE_BIAS = 1e4 * MATRIX, np.array([0.6, -1.0, 0.25])


def attitudes(count: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(count, 3))


def units(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


FORCE = G * units(attitudes(24)) @ MATRIX.T + BIAS
RATE = EARTH * units(attitudes(12, 2)) @ RATE_MATRIX.T + RATE_BIAS


def test_ten_unknowns_of_13_are_singular_and_nine_are_not() -> None:
    design = printed_design(FORCE)
    # the true elements of (14) fit, and so does m44 = |g|² alone
    inverse = np.linalg.inv(MATRIX)
    N = inverse.T @ inverse
    m4 = N @ BIAS
    true = np.array([N[0, 0], N[1, 1], N[2, 2], N[0, 1], N[0, 2], N[1, 2], *m4, BIAS @ m4])
    np.testing.assert_allclose(design @ true, G**2, rtol=1e-11)
    np.testing.assert_allclose(design @ np.eye(10)[9] * G**2, G**2, rtol=0.0)
    assert smallest_share(design) < 1e-14
    # one less: well determined by 24 attitudes at random
    assert smallest_share(printed_design(FORCE - FORCE.mean(axis=0))[:, :9]) > 1e-2
    matrix, bias = ellipsoid_from_norms(FORCE, G)
    np.testing.assert_allclose(matrix, MATRIX, atol=1e-10)
    np.testing.assert_allclose(bias, BIAS, atol=1e-9)


def test_25_has_j2_in_its_last_factor() -> None:
    right = pair_bias(RATE_MATRIX, RATE, printed=False)
    np.testing.assert_allclose(right, RATE_BIAS, atol=1e-8)
    np.testing.assert_allclose(bias_from_static_pairs(RATE_MATRIX, RATE), RATE_BIAS, atol=1e-8)
    # as printed it is off by a good part of the Earth rate, 73 counts
    assert np.max(np.abs(pair_bias(RATE_MATRIX, RATE, printed=True) - RATE_BIAS)) > 5.0


def test_six_rotations_are_enough_for_the_gyros_and_five_are_not() -> None:
    """The difference of both directions knows neither bias nor Earth rate."""
    axes = units(np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1.0]]))
    angle = np.array([62.0, 61.0, 60.0, 59.0, 58.0, 57.0])
    rotation = angle[:, None] * axes @ RATE_MATRIX.T
    np.testing.assert_allclose(matrix_from_rotations(rotation, angle), RATE_MATRIX, rtol=1e-9, atol=1e-4)
    design = printed_design(axes)[:, :6]
    assert smallest_share(design) > 0.1
    assert np.linalg.matrix_rank(design[:5]) == 5


PARAMETERS = np.array([90.0, 110.0, 100.0, 0.1, -0.07, 0.13, 0.5, -2.0, 1.0])
RAW = np.array([300.0, 500.0, -800.0])


def test_27_is_the_inverse_of_3_and_does_not_depend_on_the_attitude() -> None:
    k, (yz, zy, zx), b = PARAMETERS[:3], PARAMETERS[3:6], PARAMETERS[6:]
    T = np.array([[1.0, 0.0, 0.0], [yz, 1.0, 0.0], [-zy, zx, 1.0]])
    true = np.linalg.solve(np.diag(k) @ T, RAW - b)
    assert squared_norm(PARAMETERS.astype(complex), RAW).real == pytest.approx(true @ true, rel=1e-13)


def test_of_29_to_32_only_the_first_of_30_is_wrong() -> None:
    printed, right = printed_derivatives(PARAMETERS, RAW), stepped_derivatives(PARAMETERS, RAW)
    # complex steps are exact; central differences say the same to their own accuracy
    for k, unit in enumerate(np.eye(9)):
        step = 1e-6 * max(1.0, abs(PARAMETERS[k])) * unit
        high, low = (squared_norm((PARAMETERS + s * step).astype(complex), RAW).real for s in (1.0, -1.0))
        assert (high - low) / (2.0 * step[k]) == pytest.approx(right[k], rel=1e-6, abs=1e-7)
    wrong = np.flatnonzero(~np.isclose(printed, right, rtol=1e-12))
    np.testing.assert_array_equal(wrong, [1])
    # with s_y for s_x it is right
    s = (RAW - PARAMETERS[6:]) / PARAMETERS[:3]
    assert printed[1] * s[1] / s[0] == pytest.approx(right[1], rel=1e-12)


def test_11_is_not_linear() -> None:
    """|s|² is of degree −2 in the scale factors, so that A θ, which (11) sets equal to |g|², is of another sign."""
    told = stepped_derivatives(PARAMETERS, RAW)
    square = squared_norm(PARAMETERS.astype(complex), RAW).real
    assert told[:3] @ PARAMETERS[:3] == pytest.approx(-2.0 * square, rel=1e-12)
    assert told @ PARAMETERS < 0.0 < square


def test_40_is_a_rotation_only_if_both_frames_have_the_same_angle() -> None:
    R = Rotation.from_rotvec([-0.003, 0.0006, -0.002]).as_matrix()
    axes_p = units(np.array([[0.1, 0.2, 1.0], [0.0, 1.0, -0.3]]))
    axes_o = axes_p @ R.T
    for form in (rotation_from_two_axes, triad_rotation):
        np.testing.assert_allclose(form(axes_o, axes_p), R, atol=1e-14)
    # the accelerometers' z axis tipped by 27″ towards y, as their misalignment zx tips it
    tipped = axes_p + np.array([[0.0, 27.0 * SECOND, 0.0], [0.0, 0.0, 0.0]])
    tipped = units(tipped)
    printed, triad = (form(axes_o, tipped) for form in (rotation_from_two_axes, triad_rotation))
    assert np.max(np.abs(printed.T @ printed - np.eye(3))) > 20.0 * SECOND
    np.testing.assert_allclose(triad.T @ triad, np.eye(3), atol=1e-14)


def test_42_has_gravity_as_minus_g_and_46_a_null_vector() -> None:
    """A specific force at rest points up, and its part along a fixed axis stays: gravity's with the sign changed."""
    axis = units(np.array([[0.3, -0.5, 0.8]]))[0]
    up = np.array([0.0, 0.0, 1.0])
    turned = np.array([Rotation.from_rotvec(-a * axis).apply(up) for a in np.linspace(0.0, 5.0, 40)])
    force = G * turned
    np.testing.assert_allclose(force @ axis, -(-G * up) @ axis, rtol=1e-12)
    A = np.column_stack([force, -np.ones(40)])
    assert A.shape == (40, 4)
    values, rows = np.linalg.svd(A)[1:]
    assert values[3] < 1e-12 * values[0] < values[2]
    null = rows[3]
    np.testing.assert_allclose(np.abs(null[:3] @ axis) / np.linalg.norm(null[:3]), 1.0, rtol=1e-12)
    # (45): the fourth element is κ
    np.testing.assert_allclose(null[3] / np.linalg.norm(null[:3]), np.sign(null[:3] @ axis) * G * axis[2])


def test_raw_rows_make_scale_factors_larger_by_the_noise_squared() -> None:
    """5,000 µg a sample, many attitudes: |y|² is too large by 3 σ²; 7/2 σ² are left in the scales, as for 26."""
    rng = np.random.default_rng(5)
    true = G * units(rng.normal(size=(60, 3)))
    share = 5e-3
    samples = true[:, None] + share * G * rng.standard_normal((60, 2000, 3))
    by_rows, by_means = (
        np.linalg.norm(ellipsoid_from_norms(raw, G)[0], axis=1)
        for raw in (samples.reshape(-1, 3), samples.mean(axis=1))
    )
    shift = np.mean(by_rows / by_means - 1.0)
    # the squares' own noise over 120,000 rows is a tenth of it
    assert shift == pytest.approx(3.5 * share**2, rel=0.3)
