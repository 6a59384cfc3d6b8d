"""The accelerometer simulation of the thesis played again: table 4.5, and without noise the truth itself."""

from __future__ import annotations

import itertools

import numpy as np
import numpy.typing as npt
import pytest

from tumble.calibration.closed_forms.start_values import rough_triad
from tumble.calibration.equations.norm import NormConditions
from tumble.calibration.equations.triad_unknowns import triad_from_unknowns
from tumble.estimation import Adjustment, adjust

Array = npt.NDArray[np.float64]

GRAVITY = 9.801
NOISE = 3.667e-3  # m/s² of a sample of one second
SAMPLES = 180
# Table 4.1: bias, scale factor, non-orthogonality.
TABLE_4_1 = np.concatenate([np.full(3, 0.01), np.full(3, 1.0 + 300e-6), np.full(3, 100e-6), np.zeros(3)])


def attitudes(rng: np.random.Generator) -> Array:
    """Specific force in 26 attitudes, faces, edges and corners down, each angle off by 2 degrees."""
    corners = np.array([s for s in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(s)])
    down = corners / np.linalg.norm(corners, axis=1, keepdims=True)
    off = np.radians(2.0) * rng.standard_normal((26, 3))
    tilted = down + np.cross(off, down)
    return -GRAVITY * tilted / np.linalg.norm(tilted, axis=1, keepdims=True)


def adjusted(means: Array, sigma: float, start: Array) -> Adjustment:
    covariance = np.tile(sigma**2 * np.eye(3), (means.shape[0], 1, 1))
    free = np.arange(9)
    return adjust(NormConditions(means, covariance, GRAVITY, start, free), start[free])


# SI as in the thesis; counts as a unit of the Xsens kind gives, with angles of degrees.
IN_SI = TABLE_4_1
IN_COUNTS = np.array([33124.0, 33275.0, 32364.0, 414.5, 412.0, -0.0, 0.0034, -0.0211, -0.0089, 0.0, 0.0, 0.0])
IN_COUNTS[5] = 414.6


@pytest.mark.parametrize("truth", [IN_SI, IN_COUNTS], ids=["m/s²", "counts"])
def test_without_noise_26_attitudes_give_the_truth_from_rough_start_values(truth: Array) -> None:
    force = attitudes(np.random.default_rng(1))
    means = triad_from_unknowns(truth).distort(force)
    # With zero noise, P still wants a nominal sigma.
    solution = adjusted(means, NOISE * truth[3] / np.sqrt(SAMPLES), rough_triad(means, GRAVITY))
    np.testing.assert_allclose(solution.parameters[:6], truth[:6], rtol=1e-9)
    np.testing.assert_allclose(solution.parameters[6:], truth[6:9], atol=1e-9)
    assert solution.sigma0 < 1e-7
    assert solution.redundancy == 26 - 9


def test_a_left_out_attitude_s_norm_is_gravity_too() -> None:
    force = attitudes(np.random.default_rng(1))
    means = triad_from_unknowns(IN_COUNTS).distort(force)
    solution = adjusted(means[1:], 1.0, rough_triad(means[1:], GRAVITY))
    triad = triad_from_unknowns(np.concatenate([solution.parameters, np.zeros(3)]))
    corrected = triad.correct(means[:1])[0]
    np.testing.assert_allclose(corrected, force[0], atol=1e-8)


def run(seed: int) -> tuple[Adjustment, Array]:
    rng = np.random.default_rng(seed)
    means = triad_from_unknowns(TABLE_4_1).distort(attitudes(rng))
    samples = means[:, None, :] + NOISE * rng.standard_normal((26, SAMPLES, 3))
    start = np.concatenate([np.zeros(3), np.ones(3), np.zeros(6)])
    return adjusted(samples.mean(axis=1), NOISE / np.sqrt(SAMPLES), start), means


def test_the_estimated_sigmas_are_those_of_table_4_5() -> None:
    runs = [run(seed)[0] for seed in range(60)]
    # The thesis scales by the estimated sigma of unit weight.
    sigmas = np.array([one.sigma0 * np.sqrt(np.diag(one.cofactor)) for one in runs])
    bias, scale, angle = sigmas[:, :3], 1e6 * sigmas[:, 3:6], 1e6 * sigmas[:, 6:9]
    # min to max of 500 runs elsewhere: all of 60 should lie inside, but for the last digit printed
    assert np.all((bias > 4.75e-5) & (bias < 15.65e-5))
    assert np.all((scale > 7.15) & (scale < 24.5))
    assert np.all((angle > 9.5) & (angle < 34.5))
    # the means: a run's sigma scatters by 18 % with 17 degrees of freedom; four times that over root 60
    tolerance = 4.0 * 0.18 / np.sqrt(60.0)
    assert bias.mean() == pytest.approx(9.3e-5, rel=tolerance)
    assert scale.mean() == pytest.approx(14.2, rel=tolerance)
    assert angle.mean() == pytest.approx(20.3, rel=tolerance)


def test_the_errors_scatter_as_the_sigmas_say() -> None:
    runs = [run(seed)[0] for seed in range(60)]
    errors = np.array([(one.parameters - TABLE_4_1[:9]) / np.sqrt(np.diag(one.cofactor)) for one in runs])
    # 540 normalised errors, correlated by threes in a run: within five sigma of 180 independent ones
    assert abs(errors.mean()) < 5.0 / np.sqrt(180.0)
    assert errors.std() == pytest.approx(1.0, abs=5.0 / np.sqrt(2 * 180.0))
    assert np.abs(errors).max() < 5.0
    # sigma of unit weight 0.97 to 1.00 in the mean: chi-square of 60 * 17 degrees
    assert np.sqrt(np.mean([one.sigma0**2 for one in runs])) == pytest.approx(
        1.0, abs=4.0 / np.sqrt(2 * 1020.0)
    )
