"""The conditions of holds and turns: their derivatives, and where the chain breaks; statistics try their covariance."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tumble.calibration.equations.turn import (
    EARTH,
    FORCE,
    G_SENSITIVITY,
    GYRO_BIAS,
    GYRO_MATRIX,
    NORM,
    RATE,
    TOTAL,
    TURN,
    ExtraVariances,
    TurnConditions,
)
from tumble.earth import EARTH_RATE

EVERY = np.arange(TOTAL)


def conditions_of(
    tumbled: Any, site: Any, values: np.ndarray, extra: ExtraVariances | None = None
) -> TurnConditions:
    data = tumbled.data()
    return TurnConditions(
        data, site.gravity, values, EVERY, np.ones((data.holds, 6), dtype=bool), extra or ExtraVariances()
    )


def with_earth_rate(quiet: Any, site: Any, truth: np.ndarray) -> np.ndarray:
    """The true unknowns, the Earth rate of the first hold from its own first attitude."""
    values = truth.copy()
    rest = quiet.means.angular_rate[0] - values[GYRO_BIAS]
    force = np.linalg.solve(matrix_of(values), quiet.means.specific_force[0] - values[:3])
    rest = rest - values[G_SENSITIVITY].reshape(3, 3) @ force
    values[EARTH] = np.linalg.solve(values[GYRO_MATRIX].reshape(3, 3), rest)
    return values


def matrix_of(values: np.ndarray) -> np.ndarray:
    from tumble.calibration.equations.triad_unknowns import triad_from_unknowns

    return triad_from_unknowns(values[FORCE]).matrix


def test_the_truth_leaves_no_misclosure(quiet: Any, site: Any, truth: np.ndarray) -> None:
    """Every condition holds for a recording without noise, the Earth turning below it.

    Truncation: the accelerometer's sample is the middle's value, the gyro's the mean over its interval:
    g-sensitivity of 7e-4 (rad/s)/(m/s²) is seen to (1.5 rad/s x 0.01 s)² / 24 of itself; the gyro is
    linear between its samples.
    """
    values = with_earth_rate(quiet, site, truth)
    assert np.linalg.norm(values[EARTH]) == pytest.approx(EARTH_RATE, rel=1e-3)
    linear = conditions_of(quiet, site, values).linearise(values)
    np.testing.assert_allclose(linear.misclosure[:, NORM], 0.0, atol=1e-8)
    np.testing.assert_allclose(linear.misclosure[:, RATE], 0.0, atol=2e-8)
    np.testing.assert_allclose(linear.misclosure[:-1, TURN], 0.0, atol=2e-6)


def numerical_design(tumbled: Any, site: Any, values: np.ndarray) -> np.ndarray:
    """Central differences; each step is some 1e-5 of the unknown's size (g-sensitivity, Earth rate: absolute)."""
    step = np.full(TOTAL, 1e-6)
    step[9:12], step[G_SENSITIVITY], step[EARTH] = 1e-8, 1e-7, 1e-6
    columns = []
    for index in range(TOTAL):
        moved = []
        for sign in (1.0, -1.0):
            x = values.copy()
            x[index] += sign * step[index]
            moved.append(conditions_of(tumbled, site, x).linearise(x).misclosure)
        columns.append((moved[0] - moved[1]) / (2.0 * step[index]))
    return np.stack(columns, axis=2)


@pytest.fixture(scope="module")
def designs(play: Any, site: Any, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The design at the truth, exact and numerical, without noise on an Earth that stands still."""
    still_earth = play(noise=(1e-9, 1e-11), earth=False)
    return conditions_of(still_earth, site, truth).linearise(truth).design, numerical_design(
        still_earth, site, truth
    )


DESIGN = {
    # Arithmetic: rounding of 1e-15 over steps of 1e-6 (1e-8 for quadratic terms), and the step squared.
    "norms by the accelerometer": (NORM, FORCE, 1e-6),
    "norms by the gyro, which they do not know": (NORM, slice(12, 36), 0.0),
    "rates by the gyro's matrix": (RATE, GYRO_MATRIX, 1e-8),
    "rates by the gyro's bias": (RATE, GYRO_BIAS, 1e-8),
    "rates by g-sensitivity": (RATE, G_SENSITIVITY, 1e-6),
    "rates by the Earth rate": (RATE, EARTH, 1e-8),
    # Truncation: integrals of the design are trapezoids, off by a sample's rotation squared over 12:
    # (2.9 rad/s x 0.01 s)² / 12 = 7e-5 of entries up to 2 (matrix, bias) and 13 (g-sensitivity).
    "turns by the gyro's matrix": (TURN, GYRO_MATRIX, 1.4e-4),
    "turns by the gyro's bias": (TURN, GYRO_BIAS, 1.4e-4),
    "turns by g-sensitivity": (TURN, G_SENSITIVITY, 9e-4),
    "turns by the Earth rate": (TURN, EARTH, 1e-6),
}


def test_the_design_is_the_derivative_of_the_misclosure(designs: tuple[np.ndarray, np.ndarray]) -> None:
    exact, numerical = designs
    for what, (rows, columns, limit) in DESIGN.items():
        found, expected = (design[:, rows, columns] for design in (exact, numerical))
        np.testing.assert_allclose(found, expected, atol=limit, err_msg=what)


def test_a_turn_that_cannot_be_integrated_has_no_condition_and_breaks_the_chain(
    tumbled: Any, site: Any, truth: np.ndarray
) -> None:
    """Beyond it the Earth rate's direction in b is unknown: the rates get its variance instead."""
    whole = conditions_of(tumbled, site, truth).linearise(truth)
    broken = conditions_of(tumbled.without_turns(4), site, truth).linearise(truth)
    assert whole.active[:-1].all()
    assert not broken.active[4, TURN].any()
    np.testing.assert_array_equal(broken.misclosure[4, TURN], 0.0)
    np.testing.assert_array_equal(broken.design[4, TURN], 0.0)
    # Before the break everything is as it was, and turns after it too.
    np.testing.assert_allclose(broken.misclosure[:4], whole.misclosure[:4], rtol=1e-12)
    np.testing.assert_allclose(broken.design[:5, RATE, EARTH], whole.design[:5, RATE, EARTH], rtol=1e-12)
    np.testing.assert_array_equal(broken.design[5:, RATE, EARTH], 0.0)
    added = np.diagonal(broken.covariance - whole.covariance, axis1=1, axis2=2)[:, RATE]
    np.testing.assert_allclose(added[:5], 0.0, atol=1e-20)
    np.testing.assert_allclose(added[5:], EARTH_RATE**2 / 3.0, rtol=1e-6)
    np.testing.assert_allclose(broken.misclosure[5:-1, TURN], whole.misclosure[5:-1, TURN], atol=1e-3)
