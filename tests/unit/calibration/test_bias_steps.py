"""Jumps of biases between holds: found where they are, and seldom where they are not."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.calibration.bias_steps import CLEARLY, FALSE_ALARM, find_bias_steps, find_force_step


def residuals(seed: int, holds: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """Holds of unequal length: standard deviations of 1e-4 to 2e-4 rad/s."""
    rng = np.random.default_rng(seed)
    sigma = rng.uniform(1e-4, 2e-4, (holds, 1)) * np.ones(3)
    return sigma * rng.standard_normal((holds, 3)), sigma**2


@pytest.mark.parametrize(("axis", "before", "size"), [(0, 9, 1.2e-3), (1, 4, -1.5e-3), (2, 17, 2e-3)])
def test_a_step_is_found_on_its_axis_between_its_holds_with_its_size(
    axis: int, before: int, size: float
) -> None:
    residual, variance = residuals(4)
    residual[before + 1 :, axis] += size
    (found,) = find_bias_steps(residual, variance)
    assert (found.axis, found.before) == (axis, before)
    # 4 sigma of the difference of the two sides' means.
    assert found.size == pytest.approx(size, abs=4.0 * found.sigma)


def test_the_stated_sigma_is_that_of_many_steps() -> None:
    """Errors over sigma of 200 steps: the level is a median (37 % efficient), so that the spread is 0.85 to 1.3."""
    normalised = []
    for seed in range(200):
        residual, variance = residuals(seed)
        residual[12:, 1] += 3e-3
        (found,) = find_bias_steps(residual, variance)
        normalised.append((found.size - 3e-3) / found.sigma)
    assert 0.85 < np.std(normalised) < 1.3
    assert abs(np.mean(normalised)) < 4.0 * 1.3 / np.sqrt(200)


def test_no_step_is_found_where_there_is_none_but_for_false_alarms() -> None:
    """600 recordings without a step; 1 % may alarm, by Bonferroni fewer: more than 14 has a chance of 1e-3."""
    alarms = sum(bool(find_bias_steps(*residuals(seed))) for seed in range(600))
    assert FALSE_ALARM == 0.01
    assert alarms <= 14


def test_one_odd_hold_is_no_step() -> None:
    residual, variance = residuals(6)
    residual[11, 2] += 3e-3
    assert not find_bias_steps(residual, variance)


def test_few_holds_hide_a_step_rather_than_invent_one() -> None:
    residual, variance = residuals(1, holds=7)
    residual[4:] += 1e-2
    assert not find_bias_steps(residual, variance)


def test_all_axes_that_jump_at_once_are_named_and_what_a_g_sensitivity_took_of_them_is_given_back() -> None:
    """A g-sensitivity was adjusted to holds that jump: it takes what goes with the force of the later ones."""
    residual, variance = residuals(5, holds=26)
    force = np.random.default_rng(8).standard_normal((26, 3))
    jump = np.array([4e-3, 0.0, -2.5e-3])
    residual[11:] += jump
    known = np.hstack([np.ones((26, 1)), force])
    residual -= known @ np.linalg.lstsq(known, residual, rcond=None)[0]
    found = find_bias_steps(residual, variance, force)
    assert [(step.axis, step.before) for step in found] == [(0, 10), (2, 10)]
    for step in found:
        assert step.size == pytest.approx(jump[step.axis], abs=4.0 * step.sigma)
        assert abs(step.size) > CLEARLY * step.scatter


def norms_of(biases: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """What nine unknowns leave of (holds, 3) biases in the norms of as many poses, which are measured to 0.4 mm/s²."""
    rng = np.random.default_rng(seed)
    up = rng.standard_normal(biases.shape)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    norms = np.sum(biases * up, axis=1) + 4e-4 * rng.standard_normal(len(up))
    square = np.einsum("ni,nj->nij", up, up).reshape(-1, 9)
    adjusted = np.hstack([up, square])
    return norms - adjusted @ np.linalg.lstsq(adjusted, norms, rcond=1e-9)[0], up


@pytest.mark.parametrize(("before", "jump"), [(12, [8e-3, 2e-3, -5e-3]), (19, [0.0, 0.0, 2e-2])])
def test_accelerometers_that_jump_are_found_between_their_holds(before: int, jump: list[float]) -> None:
    later = np.arange(30)[:, None] > before
    assert find_force_step(*norms_of(later * np.array(jump), 3)) == before


def test_accelerometers_that_warm_up_or_wander_do_not_jump() -> None:
    """Of 150 units that warm up by 3 mg and 150 with flicker noise of 0.1 mg from hold to hold none is said to jump."""
    rng = np.random.default_rng(4)
    order, found = np.arange(30)[:, None], 0
    frequency = np.fft.rfftfreq(240)[1:, None]
    for seed in range(150):
        warming = 0.03 * rng.standard_normal(3) * np.exp(-order / (30 * rng.uniform(0.05, 0.6)))
        lines = (rng.standard_normal((120, 3)) + 1j * rng.standard_normal((120, 3))) / np.sqrt(frequency)
        wander = np.fft.irfft(np.vstack([np.zeros((1, 3)), lines]), axis=0)[:30]
        wander *= 1e-3 / np.std(wander)
        found += sum(find_force_step(*norms_of(biases, seed)) is not None for biases in (warming, wander))
    assert found == 0
