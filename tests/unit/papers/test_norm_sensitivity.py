"""Zhang et al. (2010), (29) to (38), against complex-step derivatives of the squared norm."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from tumble.attitude.directions import twenty_six_directions
from tumble.sensor.conventions.zhang import matrix_from_zhang
from tumble.sensor.propagation import jacobian
from tumble_papers.zhang.pose_sets import (
    approximate_norm_sensitivity,
    most_sensitive_directions,
    norm_sensitivity,
)

# No two alike, and angles so large that a forgotten product of two of them shows.
SCALE = np.array([95.0, 104.0, 112.0])
ANGLES = np.array([-0.11, 0.07, 0.16])
BIAS = np.array([0.6, -2.0, 1.1])
GRAVITY = 9.8


def some_directions() -> np.ndarray:
    rng = np.random.default_rng(5)
    drawn = rng.standard_normal((20, 3))
    return np.vstack([twenty_six_directions(), drawn / np.linalg.norm(drawn, axis=1)[:, None]])


def squared_norm(
    raw: npt.NDArray[Any], scale: npt.NDArray[Any], angles: npt.NDArray[Any], bias: npt.NDArray[Any]
) -> Any:
    true = np.linalg.solve(matrix_from_zhang(scale, angles, "small-angle"), (raw - bias).T).T
    return np.sum(true * true, axis=1)


def differentiated(directions: np.ndarray, norm: float) -> np.ndarray:
    """The derivatives by scale, misalignment and bias, exact to round-off."""
    raw = norm * directions @ matrix_from_zhang(SCALE, ANGLES, "small-angle").T + BIAS
    return jacobian(lambda v: squared_norm(raw, v[:3], v[3:6], v[6:]), np.concatenate([SCALE, ANGLES, BIAS]))


def test_the_exact_formulas_are_the_derivatives_of_the_squared_norm() -> None:
    directions = some_directions()
    found = norm_sensitivity(directions, SCALE, ANGLES, GRAVITY).columns()
    # 1e-12 of a squared gravity: round-off of a solve.
    np.testing.assert_allclose(found, differentiated(directions, GRAVITY), atol=1e-12 * GRAVITY**2)


def test_the_formulas_without_small_terms_miss_by_the_order_of_the_angles() -> None:
    directions = some_directions()
    for factor in (1e-2, 1e-4):
        small = factor * ANGLES
        exact = norm_sensitivity(directions, SCALE, small, GRAVITY).columns()
        rough = approximate_norm_sensitivity(directions, SCALE, small, GRAVITY).columns()
        unit = 2.0 * GRAVITY**2 / np.concatenate([SCALE, np.ones(3), GRAVITY * SCALE])
        missed = np.max(np.abs(rough - exact) / unit)
        # The largest neglected term is one angle, and two stand in a row.
        assert 0.1 * np.max(np.abs(small)) < missed < 2.0 * np.max(np.abs(small))


@pytest.mark.parametrize(("group", "index"), [("scale", 0), ("misalignment", 2), ("bias", 1)])
def test_no_direction_of_a_fine_grid_tells_more_than_those_found(group: str, index: int) -> None:
    count = 4000
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = np.arange(count) * np.pi * (3.0 - np.sqrt(5.0))
    ring = np.sqrt(1.0 - height**2)
    grid = np.column_stack([ring * np.cos(turn), ring * np.sin(turn), height])
    found = most_sensitive_directions(SCALE, ANGLES, group, index)
    at_best = np.abs(getattr(norm_sensitivity(found, SCALE, ANGLES), group)[:, index])
    on_grid = np.abs(getattr(norm_sensitivity(grid, SCALE, ANGLES), group)[:, index])
    assert on_grid.max() <= at_best.max() * (1.0 + 1e-9)
    # The grid's cells are 3° wide: its best is at most 0.3 % below.
    assert on_grid.max() > 0.997 * at_best.max()


def test_without_misalignment_faces_tell_most_of_scale_and_bias_and_edges_of_misalignment() -> None:
    """The paper's statement below (35)."""
    none = np.zeros(3)
    for index in range(3):
        face = np.eye(3)[index]
        for group in ("scale", "bias"):
            found = most_sensitive_directions(SCALE, none, group, index)
            np.testing.assert_allclose(np.abs(found), [face, face], atol=1e-4)
        edges = most_sensitive_directions(SCALE, none, "misalignment", index)
        pair = np.sqrt(0.5) * (1.0 - np.eye(3)[2 - index])
        assert len(edges) == 4
        np.testing.assert_allclose(np.abs(edges), np.tile(pair, (4, 1)), atol=1e-4)


def test_a_group_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="is none of scale, misalignment, bias"):
        most_sensitive_directions(SCALE, ANGLES, "noise", 0)
