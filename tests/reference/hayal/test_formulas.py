"""Each slip in the thesis' formulas: the printed form fails a check that the right one passes.

Checks are the forward model 3.13 (with angles of a tenth of a radian, so that each function of them
counts), complex-step derivatives, dimensions of matrices, and what an adjustment must leave behind. The
words are on the page `docs/papers/hayal-2010-formulas.md`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from numpy import cos, sin, tan

from tumble.attitude.directions import twenty_six_directions

Array = npt.NDArray[Any]

K = 9.801
B_X, B_Y, B_Z = 0.4, -0.2, 0.1
S_X, S_Y, S_Z = 0.02, -0.01, 0.03
YZ, ZX, ZY = 0.11, -0.07, 0.05
VALUES = np.array([B_X, B_Y, B_Z, S_X, S_Y, S_Z, YZ, ZX, ZY])
TRUE = np.array([3.3, -4.9, 7.7])


def observed(values: Array, true: Array) -> Array:
    """Hayal 3.13 without noise; complex if need be."""
    b, s, (yz, zx, zy) = values[:3], values[3:6], values[6:]
    x, y, z = np.moveaxis(true, -1, 0)
    return np.stack(
        [
            b[0] + (1 + s[0]) * x,
            b[1] + (1 + s[1]) * (-x * sin(yz) + y * cos(yz)),
            b[2] + (1 + s[2]) * (x * sin(zy) - y * sin(zx) * cos(zy) + z * cos(zx) * cos(zy)),
        ],
        axis=-1,
    )


def solved(values: Array, Y: Array) -> tuple[Any, Any, Any]:
    """Hayal 3.14."""
    b, s, (yz, zx, zy) = values[:3], values[3:6], values[6:]
    u_x, u_y, u_z = ((Y[..., i] - b[i]) / (1 + s[i]) for i in range(3))
    x = u_x
    y = x * tan(yz) + u_y / cos(yz)
    return x, y, -x * tan(zy) / cos(zx) + y * tan(zx) + u_z / (cos(zx) * cos(zy))


def condition(values: Array, Y: Array) -> Any:
    """Hayal 3.19."""
    x, y, z = solved(values, Y)
    return x * x + y * y + z * z - K * K


def slopes(function: Callable[[Array], Any], at: Array) -> Array:
    """Derivatives by the complex step, exact to round-off; one column a variable."""
    return np.stack([np.imag(function(at + 1e-30j * e)) / 1e-30 for e in np.eye(at.size)], axis=-1)


def R1(a: float) -> Array:
    return np.array([[1, 0, 0], [0, cos(a), sin(a)], [0, -sin(a), cos(a)]])


def R2(a: float) -> Array:
    return np.array([[cos(a), 0, -sin(a)], [0, 1, 0], [sin(a), 0, cos(a)]])


def R3(a: float) -> Array:
    return np.array([[cos(a), sin(a), 0], [-sin(a), cos(a), 0], [0, 0, 1]])


Y = observed(VALUES, TRUE)
A_X, A_Y, A_Z = TRUE
X_BRACKET = A_X + A_Y * tan(YZ) + A_Z * (tan(ZX) * tan(YZ) - tan(ZY) / cos(ZX))


def test_3_14_solves_3_13() -> None:
    """The pair on which the other checks stand."""
    np.testing.assert_allclose(solved(VALUES, Y), TRUE, rtol=1e-14)


def test_3_7_and_3_9_have_the_z_axis_mirrored_in_x() -> None:
    """R_x R_y of 3.8, multiplied out, and 3.11 both want + sin θzy."""
    R_x = np.array([[1, 0, 0], [0, cos(ZX), -sin(ZX)], [0, sin(ZX), cos(ZX)]])  # 3.8
    R_y = np.array([[cos(ZY), 0, sin(ZY)], [0, 1, 0], [-sin(ZY), 0, cos(ZY)]])
    product = R_x @ R_y @ [0.0, 0.0, 1.0]
    right = np.array([sin(ZY), -sin(ZX) * cos(ZY), cos(ZX) * cos(ZY)])
    printed = right * [-1.0, 1.0, 1.0]
    np.testing.assert_allclose(right, product, rtol=1e-15)
    assert right @ TRUE == pytest.approx((Y[2] - B_Z) / (1 + S_Z), rel=1e-14)  # 3.11, as it stands in 3.13
    assert abs(printed[0] - product[0]) > 0.09
    assert abs(printed @ TRUE - right @ TRUE) > 0.3


def test_3_10_is_the_small_angle_form_of_3_9_with_the_same_slip() -> None:
    """For angles of a milliradian the right form is off by products of them, the printed one by 2 θzy."""
    zx, zy = 1e-3 * np.array([-0.7, 0.5])
    exact = np.array([sin(zy), -sin(zx) * cos(zy), cos(zx) * cos(zy)])
    assert np.max(np.abs(np.array([zy, -zx, 1.0]) - exact)) < 2e-6
    assert np.max(np.abs(np.array([-zy, -zx, 1.0]) - exact)) == pytest.approx(2 * zy, rel=1e-3)


def test_3_15_has_the_wrong_sign_of_θzx() -> None:
    """The small-angle matrix must be the slope of 3.13, and the inverse of 3.16."""
    by_angles = slopes(lambda v: observed(np.concatenate([np.zeros(6), v]), TRUE + 0j), np.zeros(3))
    right = np.array([[0, 0, 0], [-A_X, 0, 0], [0, -A_Y, A_X]])  # columns yz, zx, zy
    printed = np.array([[0, 0, 0], [-A_X, 0, 0], [0, +A_Y, A_X]])
    np.testing.assert_allclose(by_angles, right, atol=1e-15)
    assert np.max(np.abs(by_angles - printed)) > 9.0


def test_3_18_lost_its_tangents() -> None:
    """Printed: ωx cos θyz, and ωx / cos θzx without tan θzy."""
    u = (Y - VALUES[:3]) / (1 + VALUES[3:6])
    right_y = A_X * tan(YZ) + u[1] / cos(YZ)
    printed_y = A_X * cos(YZ) + u[1] / cos(YZ)
    rest = A_Y * tan(ZX) + u[2] / (cos(ZX) * cos(ZY))
    right_z, printed_z = -A_X * tan(ZY) / cos(ZX) + rest, -A_X / cos(ZX) + rest
    assert (right_y, right_z) == (pytest.approx(A_Y, rel=1e-14), pytest.approx(A_Z, rel=1e-14))
    assert abs(printed_y - A_Y) > 1.0
    assert abs(printed_z - A_Z) > 1.0


def test_3_21_and_3_22_have_tangents_where_cosines_belong() -> None:
    """With the right factors the condition is zero at the truth; with the printed ones it is not."""
    u = (Y - VALUES[:3]) / (1 + VALUES[3:6])
    y = tan(YZ) * u[0] + u[1] / cos(YZ)
    last = u[2] / (cos(ZX) * cos(ZY))
    right = (tan(ZX) * tan(YZ) - tan(ZY) / cos(ZX)) * u[0] + tan(ZX) / cos(YZ) * u[1] + last
    printed = (tan(ZX) * tan(YZ) - tan(ZY) / tan(ZX)) * u[0] + tan(ZX) / tan(YZ) * u[1] + last
    assert right == pytest.approx(A_Z, rel=1e-14)
    norm = float(TRUE @ TRUE)
    assert u[0] ** 2 + y**2 + right**2 - norm == pytest.approx(0.0, abs=1e-12)
    assert abs(u[0] ** 2 + y**2 + printed**2 - norm) > 10.0


def test_3_21_substitutes_3_14_and_not_the_small_angle_form_3_16() -> None:
    """3.16 is off by squares of the angles: at a tenth of a radian the condition is not zero."""
    u = (Y - VALUES[:3]) / (1 + VALUES[3:6])
    y = u[0] * YZ + u[1]
    z = -u[0] * ZY + y * ZX + u[2]
    assert abs(u[0] ** 2 + y**2 + z**2 - TRUE @ TRUE) > 0.1


def test_3_63_is_a_sum_and_no_fraction() -> None:
    by_bias = slopes(lambda b: condition(np.concatenate([b, VALUES[3:]]), Y), VALUES[:3])[0]
    bracket = (A_X + A_Y * tan(YZ)) / (A_Z * (tan(ZX) * tan(YZ) - tan(ZY) / cos(ZX)))
    assert pytest.approx(by_bias, rel=1e-13) == -2 / (1 + S_X) * X_BRACKET
    assert abs(-2 / (1 + S_X) * bracket / by_bias - 1.0) > 0.5


def test_3_68_means_the_vector_s_own_component() -> None:
    """g_z, if it is gravity's z component as in 4.5, is another number; 3.65 has a_z."""
    by_scale = slopes(lambda s: condition(np.concatenate([VALUES[:3], s, VALUES[6:]]), Y), VALUES[3:6])[2]
    factor = -2 * (Y[2] - B_Z) / (1 + S_Z) ** 2 / (cos(ZX) * cos(ZY))
    assert factor * A_Z == pytest.approx(by_scale, rel=1e-13)
    assert abs(factor * K / by_scale - 1.0) > 0.1


def test_3_25_contradicts_3_40() -> None:
    """With e = Y - Y_obs the condition holds at Y_obs + e, and 3.27 linearises that, not Y_obs - e."""
    e = np.array([1e-5, -2e-5, 3e-5])
    Y_obs = Y - e
    constant = K * K - float(TRUE @ TRUE)  # so that the truth has the norm of the condition

    def f(at: Array) -> float:
        return float(condition(VALUES, at)) + constant

    assert abs(f(Y_obs + e)) < 1e-12  # round-off of a hundred
    assert abs(f(Y_obs - e)) > 1e-4
    # 3.27 and 3.28 with xi = 0: B e + w is zero but for squares of e
    B = slopes(lambda at: condition(VALUES, at), Y_obs)
    assert abs(B @ e + f(Y_obs)) < 1e-4 * np.abs(B @ e)
    assert abs(B @ -e + f(Y_obs)) > np.abs(B @ e)


def noisy(sets: int = 26, noise: float = 0.3) -> Array:
    rng = np.random.default_rng(4)
    up = twenty_six_directions()[:sets] + 0.05 * rng.standard_normal((sets, 3))
    true = K * up / np.linalg.norm(up, axis=1, keepdims=True)
    return observed(VALUES, true) + noise * rng.standard_normal(true.shape)


def adjust(Y_obs: Array, *, pope: bool, iterations: int = 200) -> tuple[Array, Array]:
    """Iterate 3.32 to 3.38 at the adjusted observations, with w by 3.44 or, throughout, by 3.28."""
    values, adjusted = VALUES * 0.9, Y_obs.copy()
    for _ in range(iterations):
        A = slopes(lambda v, at=adjusted: condition(v, at), values)
        steps = [np.imag(condition(values, adjusted + 1e-30j * e)) / 1e-30 for e in np.eye(3)]
        B = np.stack(steps, axis=1)
        w = condition(values, adjusted) + np.sum(B * (Y_obs - adjusted), axis=1)  # 3.44
        if not pope:
            w = condition(values, Y_obs)  # 3.28
        C = np.sum(B**2, axis=1)  # 3.33, P = I
        N = A.T @ (A / C[:, None])  # 3.34
        xi = -np.linalg.solve(N, A.T @ (w / C))  # 3.32
        values = values + xi
        adjusted = Y_obs - B * ((w + A @ xi) / C)[:, None]  # 3.38, 3.40
    return values, adjusted


def test_3_28_holds_in_the_zeroth_iteration_only() -> None:
    """With 3.44 the adjusted observations fulfil the conditions; with 3.28 throughout they never do."""
    Y_obs = noisy()
    left = [np.max(np.abs(condition(*adjust(Y_obs, pope=pope)))) for pope in (True, False)]
    assert left[0] < 1e-9 * K * K
    assert left[1] > 1e-3 * K * K
    # in the zeroth iteration Y_0 = Y_obs, and the two are the same
    first = [adjust(Y_obs, pope=pope, iterations=1)[0] for pope in (True, False)]
    assert np.array_equal(*first)


def design(values: Array, Y_obs: Array, *, cosines: bool = True) -> tuple[Array, Array]:
    """A by 3.63 to 3.71 and the diagonal of C; without the cosines that Shin and El-Sheimy left out."""
    b, s, (yz, zx, zy) = values[:3], values[3:6], values[6:]
    a_x, a_y, a_z = solved(values, Y_obs)
    d_x, d_y, d_z = (Y_obs[:, i] - b[i] for i in range(3))
    x = a_x + a_y * tan(yz) + a_z * (tan(zx) * tan(yz) - tan(zy) / cos(zx))
    y = (a_y + a_z * tan(zx)) / cos(yz)
    z = a_z / (cos(zx) * cos(zy))
    c_yz, c_zx, c_zy = (cos(yz), cos(zx), cos(zy)) if cosines else (1.0, 1.0, 1.0)
    by_yz = 2 * (a_y + a_z * tan(zx)) * (a_x / cos(yz) ** 2 + d_y * tan(yz) / ((1 + s[1]) * c_yz))
    by_zx = (
        2
        * a_z
        * (
            (tan(yz) / cos(zx) ** 2 - tan(zx) * tan(zy) / c_zx) * a_x
            + d_y / ((1 + s[1]) * cos(zx) ** 2 * cos(yz))
            + d_z * tan(zx) / ((1 + s[2]) * cos(zy) * c_zx)
        )
    )
    by_zy = 2 * a_z * (-a_x / (cos(zy) ** 2 * cos(zx)) + d_z * tan(zy) / ((1 + s[2]) * cos(zx) * c_zy))
    by_raw = 2 * np.stack([x / (1 + s[0]), y / (1 + s[1]), z / (1 + s[2])], axis=1)
    by_scale = -by_raw * np.stack([d_x, d_y, d_z], axis=1) / (1 + s)
    A = np.column_stack([-by_raw, by_scale, by_yz, by_zx, by_zy])
    return A, np.sum(by_raw**2, axis=1)


def normal_matrix(values: Array, Y_obs: Array, *, cosines: bool = True) -> Array:
    A, C = design(values, Y_obs, cosines=cosines)
    N = A.T @ (A / C[:, None])
    scale = 1.0 / np.sqrt(np.diag(N))
    return N * np.outer(scale, scale)


TABLE_4_1 = np.array([0.01] * 3 + [300e-6] * 3 + [100e-6] * 3)


def test_the_design_with_all_cosines_is_right_and_without_them_is_not() -> None:
    """At a tenth of a radian the cosines that Shin and El-Sheimy left out count for some 0.1 %."""
    Y_obs = noisy()
    by_values = slopes(lambda v: condition(v, Y_obs), VALUES)
    np.testing.assert_allclose(design(VALUES, Y_obs)[0], by_values, atol=1e-11)
    off = design(VALUES, Y_obs, cosines=False)[0] - by_values
    assert np.max(np.abs(off[:, 6:])) > 0.02
    assert np.max(np.abs(off[:, :6])) < 1e-11


def test_the_missing_cosines_do_not_make_the_normal_matrix_singular() -> None:
    """The thesis says so. At 100 µrad they are 1 within 5e-9, beside tangents of 1e-4: N changes by 1e-12."""
    Y_obs = observed(TABLE_4_1, K * twenty_six_directions())
    with_them, without = (normal_matrix(TABLE_4_1, Y_obs, cosines=c) for c in (True, False))
    assert abs(1.0 - cos(1e-4)) < 5.1e-9
    assert np.max(np.abs(with_them - without)) < 1e-11
    condition_numbers = np.linalg.cond(with_them), np.linalg.cond(without)
    assert condition_numbers[0] < 3.0
    assert condition_numbers[1] == pytest.approx(condition_numbers[0], rel=1e-9)
    # nor at a tenth of a radian
    assert np.linalg.cond(normal_matrix(VALUES, noisy(noise=0.0), cosines=False)) < 3.2


@pytest.mark.parametrize("cosines", [True, False])
@pytest.mark.parametrize(("attitudes", "rank"), [(slice(0, 6), 6), (slice(0, 10), 8), (slice(0, 18), 9)])
def test_what_makes_it_singular_is_too_few_attitudes(attitudes: slice, rank: int, cosines: bool) -> None:
    """Six faces tell six parameters, the first ten attitudes all but θzx: with the cosines and without."""
    perfect = np.zeros(9)
    Y_obs = observed(perfect, K * twenty_six_directions()[attitudes])
    A, _ = design(perfect, Y_obs, cosines=cosines)
    assert np.linalg.matrix_rank(A, tol=1e-6) == rank


def test_shin_s_normal_matrix_ends_in_a_and_not_in_its_transpose() -> None:
    """26 x 9: the printed product cannot be formed; with nine attitudes it can, and is no normal matrix."""
    Y_obs = noisy()
    A, C = design(VALUES, Y_obs)
    with pytest.raises(ValueError, match="matmul"):
        A.T @ np.diag(1.0 / C) @ A.T
    A, C = design(VALUES, Y_obs[[0, 1, 2, 3, 4, 5, 6, 7, 10]])
    right, printed = A.T @ np.diag(1.0 / C) @ A, A.T @ np.diag(1.0 / C) @ A.T
    np.testing.assert_allclose(right, right.T, rtol=1e-9, atol=1e-9 * np.max(np.abs(right)))
    assert np.all(np.linalg.eigvalsh(right) > 0.0)
    assert np.max(np.abs(printed - printed.T)) > 0.1 * np.max(np.abs(printed))


def test_4_2_has_the_latitude_s_functions() -> None:
    """C_e^n of 4.3 times (0, 0, ω) is (ω cos φ, 0, −ω sin φ); printed is cos ω, and sin λ, the longitude."""
    latitude, longitude, rate = np.radians(40.0), np.radians(-83.0), 7.292115e-5
    s_f, c_f, s_l, c_l = sin(latitude), cos(latitude), sin(longitude), cos(longitude)
    C_ne = np.array([[-s_f * c_l, -s_f * s_l, c_f], [-s_l, c_l, 0.0], [-c_f * c_l, -c_f * s_l, -s_f]])  # 4.3
    np.testing.assert_allclose(C_ne @ C_ne.T, np.eye(3), atol=1e-15)
    exact = C_ne @ [0.0, 0.0, rate]
    np.testing.assert_allclose(rate * np.array([c_f, 0.0, -s_f]), exact, atol=1e-20)
    printed = rate * np.array([cos(rate), 0.0, -s_l])
    assert np.linalg.norm(printed) > 1.2 * rate
    assert np.max(np.abs(printed - exact)) > 0.2 * rate


def test_4_10_is_r3_r2_r1_and_a_heading_does_not_turn_about_the_vertical_in_it() -> None:
    """The usual way from north-east-down to body is R1(roll) R2(pitch) R3(heading)."""
    roll, pitch, heading = 0.3, -0.5, 1.1
    c_a, s_a, c_c, s_c, c_e, s_e = cos(heading), sin(heading), cos(pitch), sin(pitch), cos(roll), sin(roll)
    printed = np.array(
        [
            [c_a * c_c, c_a * s_c * s_e + s_a * c_e, -c_a * s_c * c_e + s_a * s_e],
            [-s_a * c_c, -s_a * s_c * s_e + c_a * c_e, s_a * s_c * c_e + c_a * s_e],
            [s_c, -c_c * s_e, c_c * c_e],
        ]
    )
    np.testing.assert_allclose(printed, R3(heading) @ R2(pitch) @ R1(roll), atol=1e-15)
    usual = R1(roll) @ R2(pitch) @ R3(heading)
    assert np.max(np.abs(printed - usual)) > 0.3
    # at rest a heading must not change what the accelerometers see
    up = np.array([0.0, 0.0, -K])
    np.testing.assert_allclose(usual @ up, R1(roll) @ R2(pitch) @ up, atol=1e-14)
    assert np.max(np.abs(printed @ up - R2(pitch) @ R1(roll) @ up)) > 1.0


def test_table_3_1_is_for_samples_of_one_second() -> None:
    """0.125 °/√h is 3.636e-5 rad/s over 1 s, and ten times that at 100 Hz."""
    walk = np.radians(0.125) / 60.0  # rad/√s
    assert walk == pytest.approx(3.6361e-5, rel=1e-4)
    assert walk * np.sqrt(100.0) == pytest.approx(3.6361e-4, rel=1e-4)
    assert 0.09 * np.pi / 180 / 60 == pytest.approx(2.6180e-5, rel=1e-4)
