"""The iterations (10) and (11) end where the closed form does: with nine attitudes to the last digit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tumble.calibration.closed_forms.iterative_norms import (
    IteratedNorms,
    iterate_linearised,
    minimise_norm_cost,
)
from tumble.calibration.closed_forms.separate_norms import ellipsoid_from_norms
from tumble.calibration.closed_forms.start_values import rough_triad
from tumble.calibration.equations.triad_unknowns import triad_from_unknowns
from tumble.errors import ConvergenceError

G = 9.81
MATRIX = np.array([[1.02, 0.0, 0.0], [0.031, 0.97, 0.0], [-0.012, 0.045, 1.05]])
BIAS = np.array([0.3, -0.2, 0.11])
_LONG = np.array(
    [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [1, 1, 0], [1, 0, 1], [0, 1, 1]], dtype=float
)  # fmt: skip
NINE = _LONG / np.linalg.norm(_LONG, axis=1, keepdims=True)

Iteration = Callable[..., IteratedNorms]


def readings(directions: np.ndarray, scale: float, noise: float, seed: int = 1) -> np.ndarray:
    raw = G * directions @ MATRIX.T + BIAS
    return scale * (raw + noise * np.random.default_rng(seed).standard_normal(raw.shape))


@pytest.mark.parametrize("scale", [1.0, 415.0])
@pytest.mark.parametrize("iterate", [minimise_norm_cost, iterate_linearised])
def test_nine_attitudes_with_noise_agree_with_the_closed_form(iterate: Iteration, scale: float) -> None:
    """Nothing is left over: all three fit the noise exactly. The iterations stop at 1e-12 of a step."""
    raw = readings(NINE, scale, 0.01)
    closed, bias = ellipsoid_from_norms(raw, G)
    found = iterate(raw, np.full(9, G), rough_triad(raw, G))
    triad = triad_from_unknowns(found.unknowns)
    np.testing.assert_allclose(triad.matrix, closed, rtol=0, atol=1e-10 * scale)
    np.testing.assert_allclose(triad.bias, bias, rtol=0, atol=1e-9 * scale)
    assert found.cost < 1e-16
    assert found.iterations >= 2


@pytest.mark.parametrize("iterate", [minimise_norm_cost, iterate_linearised])
def test_more_attitudes_agree_to_the_noise_s_square(iterate: Iteration) -> None:
    """The two minimise residuals weighed a little differently: 1e-3 of noise squared, times tens."""
    directions = np.random.default_rng(2).normal(size=(30, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    noise = 1e-3
    raw = readings(directions, 1.0, noise * G)
    closed, _ = ellipsoid_from_norms(raw, G)
    found = triad_from_unknowns(iterate(raw, np.full(30, G), rough_triad(raw, G)).unknowns).matrix
    assert np.max(np.abs(found - MATRIX)) > 10.0 * noise**2
    np.testing.assert_allclose(found, closed, rtol=0, atol=50.0 * noise**2)


def test_the_two_iterations_end_in_the_same_minimum() -> None:
    directions = np.random.default_rng(2).normal(size=(30, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    raw = readings(directions, 1.0, 0.05)
    start = rough_triad(raw, G)
    one, other = (f(raw, np.full(30, G), start) for f in (minimise_norm_cost, iterate_linearised))
    np.testing.assert_allclose(one.unknowns, other.unknowns, rtol=0, atol=1e-8)
    assert one.cost == pytest.approx(other.cost, rel=1e-10)


def test_start_values_far_off_do_not_converge_and_the_closed_form_is_named() -> None:
    raw = readings(NINE, 1.0, 0.0)
    start = np.array([40.0, -60.0, 80.0, 5.0, 0.02, 0.3, 1.0, -1.0, 0.8])
    with pytest.raises(ConvergenceError, match=r"\(11\) do not converge.*the closed form needs none"):
        iterate_linearised(raw, np.full(9, G), start)
