"""Jumps of the gyro's bias between holds: found where they are, and seldom where they are not."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.calibration.bias_steps import FALSE_ALARM, find_bias_step


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
    found = find_bias_step(residual, variance)
    assert found is not None
    assert (found.axis, found.before) == (axis, before)
    # 4 sigma of the difference of the two sides' means.
    assert found.size == pytest.approx(size, abs=4.0 * found.sigma)


def test_the_stated_sigma_is_that_of_many_steps() -> None:
    """Errors over sigma of 200 steps: the level is a median (37 % efficient), so that the spread is 0.85 to 1.3."""
    normalised = []
    for seed in range(200):
        residual, variance = residuals(seed)
        residual[12:, 1] += 3e-3
        found = find_bias_step(residual, variance)
        assert found is not None
        normalised.append((found.size - 3e-3) / found.sigma)
    assert 0.85 < np.std(normalised) < 1.3
    assert abs(np.mean(normalised)) < 4.0 * 1.3 / np.sqrt(200)


def test_no_step_is_found_where_there_is_none_but_for_false_alarms() -> None:
    """600 recordings without a step; 1 % may alarm, by Bonferroni fewer: more than 14 has a chance of 1e-3."""
    alarms = sum(find_bias_step(*residuals(seed)) is not None for seed in range(600))
    assert FALSE_ALARM == 0.01
    assert alarms <= 14


def test_one_odd_hold_is_no_step() -> None:
    residual, variance = residuals(6)
    residual[11, 2] += 3e-3
    assert find_bias_step(residual, variance) is None


def test_few_holds_hide_a_step_rather_than_invent_one() -> None:
    residual, variance = residuals(1, holds=7)
    residual[4:] += 1e-2
    assert find_bias_step(residual, variance) is None
