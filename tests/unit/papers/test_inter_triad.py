"""Axes as both triads see them, and the rotation that joins them: never its transpose."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.errors import ObservabilityError
from tumble_papers.zhang.closed_forms import (
    axis_from_rotation,
    axis_from_scatter,
    rotation_from_two_axes,
    scatter_in_p,
    triad_rotation,
    wahba_rotation,
)

# Degrees about three axes, all different: the transpose differs by 0.1 and more in every element off the diagonal.
R = Rotation.from_rotvec([0.2, -0.3, 0.4]).as_matrix()
_LONG = np.array([[0.1, 0.2, 1.0], [0.0, 1.0, -0.3], [1.0, -0.2, 0.3], [0.5, 0.5, -0.7]])
AXES_P = _LONG / np.linalg.norm(_LONG, axis=1, keepdims=True)
AXES_O = AXES_P @ R.T
MATRIX = np.array([[1.02, 0.0, 0.0], [0.031, 0.97, 0.0], [-0.012, 0.045, 1.05]])

Solver = Callable[..., np.ndarray]
TWO: list[Solver] = [rotation_from_two_axes, triad_rotation]


@pytest.mark.parametrize("solve", TWO)
def test_two_axes_tell_the_rotation_from_p_to_o(solve: Solver) -> None:
    assert np.max(np.abs(R - R.T)) > 0.1
    np.testing.assert_allclose(solve(AXES_O[:2], AXES_P[:2]), R, atol=1e-14)


def test_many_axes_tell_the_same() -> None:
    np.testing.assert_allclose(wahba_rotation(AXES_O, AXES_P), R, atol=1e-14)


def test_wahba_gives_a_rotation_even_of_reflected_axes() -> None:
    turned = wahba_rotation(AXES_O * [1.0, 1.0, -1.0], AXES_P)
    assert np.linalg.det(turned) == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(turned @ turned.T, np.eye(3), atol=1e-12)


def test_triad_takes_its_first_axis_exactly_and_the_second_as_well_as_it_can() -> None:
    off = AXES_O[:2].copy()
    off[1] += [0.01, -0.02, 0.0]
    turned = triad_rotation(off, AXES_P[:2])
    np.testing.assert_allclose(turned @ AXES_P[0], off[0], atol=1e-14)
    assert 1e-3 < np.linalg.norm(turned @ AXES_P[1] - off[1]) < 0.03
    # the second lies in the plane of both
    normal = np.cross(off[0], off[1])
    assert normal @ (turned @ AXES_P[1]) == pytest.approx(0.0, abs=1e-14)


@pytest.mark.parametrize("solve", [*TWO, wahba_rotation])
def test_batches_equal_each_by_itself(solve: Solver) -> None:
    rng = np.random.default_rng(3)
    rotations = Rotation.random(5, random_state=1).as_matrix()
    axes_o = np.einsum("kij,nj->kni", rotations, AXES_P[:2]) + 1e-4 * rng.standard_normal((5, 2, 3))
    axes_p = np.broadcast_to(AXES_P[:2], (5, 2, 3))
    many = solve(axes_o, axes_p)
    for k in range(5):
        np.testing.assert_allclose(many[k], solve(axes_o[k], axes_p[k]), rtol=0, atol=1e-13)


@pytest.mark.parametrize("solve", [*TWO, wahba_rotation])
def test_one_axis_alone_is_refused(solve: Solver) -> None:
    near = np.array([[1.0, 0.0, 0.0], [1.0, 0.02, 0.0]])
    near /= np.linalg.norm(near, axis=1, keepdims=True)
    with pytest.raises(ObservabilityError, match=r"have one axis only.*turn the unit about another"):
        solve(near @ R.T, near)


# Axes -----------------------------------------------------------------------------------------------


def test_the_gyros_axis_is_the_integral_s_direction_in_o() -> None:
    rotation = 62.0 * AXES_O @ MATRIX.T
    np.testing.assert_allclose(axis_from_rotation(MATRIX, rotation), AXES_O, atol=1e-14)
    counts = 1e6 * rotation
    np.testing.assert_allclose(axis_from_rotation(1e6 * MATRIX, counts), AXES_O, atol=1e-14)


@pytest.mark.parametrize("axis", AXES_P)
def test_the_accelerometers_axis_is_the_normal_of_the_plane(axis: np.ndarray) -> None:
    """A lever arm's acceleration is across the axis: it lies in the plane and moves nothing."""
    angle = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    tilted = 9.81 * np.cross(axis, [0.3, -0.5, 0.8]) + 3.0 * axis
    force = Rotation.from_rotvec(-angle[:, None] * axis).apply(tilted) + 0.1 * np.cross(axis, [1.0, 2.0, 0.0])
    raw = force @ MATRIX.T + [0.3, -0.2, 0.1]
    scatter = scatter_in_p(MATRIX, np.cov(raw.T))
    found = axis_from_scatter(scatter)
    np.testing.assert_allclose(found * np.sign(found @ axis), axis, atol=1e-12)
    # without the accelerometers' matrix it is off by their angles
    bare = axis_from_scatter(np.cov(raw.T))
    assert np.linalg.norm(bare * np.sign(bare @ axis) - axis) > 1e-3
