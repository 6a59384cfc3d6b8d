"""Many norm adjustments at once: the same equations as one, each estimator what it says, failures told apart."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from numpy import cos, sin
from scipy.optimize import least_squares

from tumble.attitude.rotations import twenty_six_directions
from tumble.calibration.equations.triad_unknowns import NormConditions
from tumble.errors import UsageError
from tumble.estimation import adjust
from tumble_papers.hayal.norm_batch import ESTIMATORS, NormBatch, adjust_norms

Array = npt.NDArray[Any]

K = 9.801
# Angles of tenths of a radian, each sensor with its own sigma.
TRUTH = np.array([0.4, -0.2, 0.1, 1.02, 0.99, 1.03, 0.11, -0.07, 0.05])
SIGMA = np.array([2e-3, 7e-3, 4e-3])


def raw(unknowns: Array, true: Array) -> Array:
    """Hayal 3.13, by scalars, complex if need be."""
    b, s, (yz, zx, zy) = unknowns[:3], unknowns[3:6], unknowns[6:9]
    x, y, z = np.moveaxis(true, -1, 0)
    return np.stack(
        [
            b[0] + s[0] * x,
            b[1] + s[1] * (-x * sin(yz) + y * cos(yz)),
            b[2] + s[2] * (x * sin(zy) - y * sin(zx) * cos(zy) + z * cos(zx) * cos(zy)),
        ],
        axis=-1,
    )


def square_of_true(unknowns: Array, observed: Array) -> Array:
    """|true|² of raw numbers, by solving 3.13 from its first row on."""
    u = observed - unknowns[:3]
    s, (yz, zx, zy) = unknowns[3:6], unknowns[6:9]
    x = u[..., 0] / s[0]
    y = (u[..., 1] / s[1] + x * sin(yz)) / cos(yz)
    z = (u[..., 2] / s[2] - x * sin(zy) + y * sin(zx) * cos(zy)) / (cos(zx) * cos(zy))
    return x * x + y * y + z * z


def simulated(sets: int, noise: float = 1.0, holds: int = 26) -> Array:
    """Hold means in jittered poses, with `noise` times the noise that is stated."""
    rng = np.random.default_rng(5)
    up = twenty_six_directions()[:holds] + 0.05 * rng.standard_normal((sets, holds, 3))
    true = K * up / np.linalg.norm(up, axis=-1, keepdims=True)
    return raw(TRUTH, true) + noise * SIGMA * rng.standard_normal(true.shape)


def adjusted(observed: Array, **options: Any) -> NormBatch:
    """As `adjust_norms`, until nothing moves any more."""
    return adjust_norms(observed, np.tile(SIGMA, (observed.shape[1], 1)), K, tolerance=1e-13, **options)


@pytest.mark.parametrize("unknowns", [3, 6, 9])
def test_it_is_the_adjustment_of_one_set_to_round_off(unknowns: int) -> None:
    observed = simulated(4)
    batch = adjusted(observed, unknowns=unknowns)
    start = np.concatenate([np.zeros(3), np.ones(3), np.zeros(6)])
    for k, means in enumerate(observed):
        covariance = np.tile(np.diag(SIGMA**2), (26, 1, 1))
        free = np.arange(unknowns)
        one = adjust(NormConditions(means, covariance, K, start, free), start[free], tolerance=1e-13)
        sigma = np.sqrt(np.diag(one.cofactor))
        # both stop where a step is 1e-13 of sigma or round-off; round-off of K is 1e-15 / 1e-4 of sigma
        np.testing.assert_allclose(batch.parameters[k, :unknowns], one.parameters, atol=1e-9 * sigma.max())
        np.testing.assert_allclose(batch.sigmas[k], sigma, rtol=1e-9)
        assert batch.sigma0[k] == pytest.approx(one.sigma0, rel=1e-9)
        # what is not estimated is as it was given
        assert np.array_equal(batch.parameters[k, unknowns:], start[unknowns:9])
    assert batch.usable.all()


def test_without_noise_every_estimator_finds_the_truth() -> None:
    observed = simulated(3, noise=0.0)
    for estimator in set(ESTIMATORS) - {"corrected"}:
        batch = adjusted(observed, estimator=estimator)
        # round-off of numbers of ten, a hundredfold for the solution of nine unknowns
        np.testing.assert_allclose(batch.parameters, np.tile(TRUTH, (3, 1)), atol=1e-12, err_msg=estimator)


@pytest.mark.parametrize(("estimator", "power"), [("norm", 1), ("square", 2)])
def test_least_squares_on_the_norm_and_its_square_are_scipy_s(estimator: str, power: int) -> None:
    observed = simulated(2, noise=20.0)
    batch = adjusted(observed, estimator=estimator)
    for k, means in enumerate(observed):

        def residual(p: Array, means: Array = means) -> Array:
            return square_of_true(p, means) ** (0.5 * power) - K**power

        found = least_squares(residual, TRUTH, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        # Gauss-Newton and scipy's end where the gradient is round-off: 1e-7 of a sigma of 1e-2
        np.testing.assert_allclose(batch.parameters[k], found.x, atol=1e-8)


def test_the_fixed_linearisation_ends_where_its_normal_equations_are_zero() -> None:
    """A' C^-1 f = 0 with A, B and C at the observed values (3.28), by complex steps."""
    observed = simulated(2, noise=20.0)
    batch = adjusted(observed, estimator="fixed")
    for k, means in enumerate(observed):
        values = batch.parameters[k]

        def f(p: Array, Y: Array) -> Array:
            return (square_of_true(p, Y) - K * K) / (2.0 * K)

        A = np.stack([np.imag(f(values + 1e-30j * e, means)) / 1e-30 for e in np.eye(9)], axis=1)
        B = np.stack([np.imag(f(values, means + 1e-30j * e)) / 1e-30 for e in np.eye(3)], axis=1)
        C = B**2 @ SIGMA**2
        gradient, scale = A.T @ (f(values, means) / C), np.abs(A).T @ (np.abs(f(values, means)) / C)
        # zero but for round-off, beside the size of its terms
        assert np.all(np.abs(gradient) < 1e-10 * scale)


def test_the_corrected_estimator_is_the_same_with_a_larger_norm() -> None:
    observed = simulated(2, noise=20.0)
    sigma = np.tile(SIGMA, (26, 1)) * np.linspace(1.0, 3.0, 26)[:, None]
    corrected = adjust_norms(observed, sigma, K, estimator="corrected")
    larger = np.sqrt(K**2 + 2.0 * np.mean(sigma**2, axis=1))
    assert np.array_equal(corrected.parameters, adjust_norms(observed, sigma, larger).parameters)


def test_the_mirror_root_fits_as_well_and_is_flagged() -> None:
    """x alone counts backwards: the norm cannot tell, but the start value can."""
    observed = simulated(3)
    mirrored = TRUTH.copy()
    mirrored[[3, 6, 8]] *= -1.0  # x backwards, and the angles that go with it
    good, mirror = adjusted(observed), adjusted(observed, start=mirrored)
    assert mirror.converged.all()
    assert mirror.mirror.all()
    assert not mirror.usable.any()
    assert not good.mirror.any()
    np.testing.assert_allclose(mirror.sigma0, good.sigma0, rtol=1e-9)


def test_a_set_that_does_not_settle_is_flagged() -> None:
    batch = adjusted(simulated(3), limit=1)
    assert not batch.converged.any()
    assert np.array_equal(batch.iterations, [1, 1, 1])
    assert not batch.mirror.any()


def test_a_set_that_tells_nothing_fails_alone_and_has_no_sigmas() -> None:
    observed = simulated(3)
    alone = adjusted(observed)
    observed[1] = observed[1, 0]
    batch = adjusted(observed)
    assert batch.converged.tolist() == [True, False, True]
    assert np.isnan(batch.sigmas[1]).all()
    assert np.isnan(batch.sigma0[1])
    for k in (0, 2):
        assert np.array_equal(batch.parameters[k], alone.parameters[k])


def test_nine_attitudes_for_nine_unknowns_leave_no_sigma0() -> None:
    """3.37 is zero over zero there."""
    up = twenty_six_directions()
    # six faces and an edge of each two axes: as many as unknowns, and they tell all of them
    rows = [0, 1, 2, 3, 4, 5, 6, 7, 10]
    true = K * up[rows]
    batch = adjust_norms(raw(TRUTH, true)[None], 1e-3, K)
    np.testing.assert_allclose(batch.parameters[0], TRUTH, atol=1e-12)  # round-off
    assert np.isnan(batch.sigma0[0])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"unknowns": 4}, "3, 6 or 9 and not 4"),
        ({"estimator": "total"}, "gauss-helmert, corrected, fixed, norm, square"),
        ({"holds": 8}, "8 holds cannot determine 9 unknowns"),
    ],
)
def test_a_wrong_argument_is_named(options: dict[str, Any], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        adjust_norms(simulated(1, holds=options.pop("holds", 26)), 1e-3, K, **options)
