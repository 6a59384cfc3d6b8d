"""The conditions of a table in unknown poses: their derivatives, and what is left out."""

from __future__ import annotations

import numpy as np

from tumble.calibration.equations.table import VERTICAL, TableConditions, TableReadings
from tumble.calibration.equations.turn import TOTAL

GRAVITY = 9.81


def readings(rng: np.random.Generator) -> TableReadings:
    force = 9.81 * np.array([[0.6, 0.0, 0.8], [0.0, -0.8, 0.6], [0.48, 0.64, -0.6]])
    row = np.array([[0, 1], [2, -1], [3, 4]])
    return TableReadings(
        force=force + 0.1 * rng.standard_normal((3, 3)),
        force_covariance=np.tile(np.diag([1e-6, 2e-6, 3e-6]), (3, 1, 1)),
        rate=np.array([[0.7, -0.7], [0.9, 0.0], [0.5, -0.6]]),
        shown=0.3 * rng.standard_normal((3, 2, 3)),
        shown_covariance=np.tile(np.diag([1e-10, 3e-10, 2e-10]), (3, 2, 1, 1)),
        row=row,
    )


def values(rng: np.random.Generator) -> np.ndarray:
    """All unknowns, asymmetric, with a g-sensitivity and a vertical Earth rate."""
    full = np.zeros(TOTAL)
    full[:9] = [0.1, -0.2, 0.3, 1.02, 0.98, 1.05, 0.01, -0.02, 0.03]
    full[12:21] = (np.eye(3) + 0.05 * rng.standard_normal((3, 3))).ravel()
    full[21:24], full[24:33] = [0.02, -0.01, 0.03], 1e-3 * rng.standard_normal(9)
    full[VERTICAL] = 5e-5
    return full


def test_the_design_is_the_derivative_of_the_misclosure() -> None:
    rng = np.random.default_rng(2)
    data, at = readings(rng), values(rng)
    free = np.array([*range(9), *range(12, 33), VERTICAL])
    conditions = TableConditions(data, GRAVITY, at, free)
    linear = conditions.linearise(at[free])
    # The matrix' own derivative acts on the spin's residual through its inverse, and is left out of the
    # design: spins that the unknowns explain have none.
    inverse = np.linalg.inv(at[12:21].reshape(3, 3))
    for s in range(2):
        data.shown[:, s] += linear.misclosure[:, 1 + 3 * s : 4 + 3 * s] @ np.linalg.inv(inverse).T
    linear = conditions.linearise(at[free])
    np.testing.assert_allclose(linear.misclosure[:, 1:], 0.0, atol=1e-12)
    for index in range(free.size):
        step = 1e-6
        ahead, back = at[free].copy(), at[free].copy()
        ahead[index] += step
        back[index] -= step
        slope = (conditions.linearise(ahead).misclosure - conditions.linearise(back).misclosure) / (2 * step)
        # Central differences: 1e-12 of curvature, 1e-16 / 1e-6 of round-off on numbers up to 10.
        np.testing.assert_allclose(linear.design[:, :, index], slope, rtol=1e-6, atol=2e-8)


def test_a_tilt_moves_both_spins_of_a_placement_oppositely_and_across_the_axis_alone() -> None:
    rng = np.random.default_rng(5)
    data, at = readings(rng), values(rng)
    at[:9], at[12:36] = [0, 0, 0, 1, 1, 1, 0, 0, 0], 0.0
    at[12:21] = np.eye(3).ravel()
    free = np.arange(9)
    level = TableConditions(data, GRAVITY, at, free).linearise(at[free]).covariance
    tilted = TableConditions(data, GRAVITY, at, free, tilt=1e-3).linearise(at[free]).covariance
    added = (tilted - level)[0]
    up = data.force[0] / np.linalg.norm(data.force[0])
    across = 1e-6 * (np.eye(3) - np.outer(up, up))
    np.testing.assert_allclose(added[1:4, 1:4], 0.49 * across, atol=1e-14)
    np.testing.assert_allclose(added[1:4, 4:7], -0.49 * across, atol=1e-14)
    np.testing.assert_array_equal(added[0], 0.0)
