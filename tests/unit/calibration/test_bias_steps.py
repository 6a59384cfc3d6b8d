"""Jumps of biases between holds: found where they are, and seldom where they are not."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.calibration.checks.bias_steps import (
    CONTRADICTION,
    FALSE_ALARM,
    Rests,
    find_bias_steps,
    find_force_course,
    find_rate_course,
    hidden_jumps,
)


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
    normalised: list[float] = []
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
        course = find_rate_course(residual[:, step.axis], rests_of(variance[:, step.axis]), force)
        assert course is not None
        assert course.is_contradiction


def rests_of(variance: np.ndarray) -> Rests:
    """Holds of five seconds, one each seven."""
    start = np.arange(0.0, 7.0 * len(variance), 7.0, dtype=np.float64)
    return Rests(start, start + 5.0, variance)


def norms_of(biases: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray, Rests]:
    """What nine unknowns leave of (holds, 3) biases in the norms of as many poses, which are measured to 0.4 mm/s²."""
    rng = np.random.default_rng(seed)
    up = rng.standard_normal(biases.shape)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    norms = np.sum(biases * up, axis=1) + 4e-4 * rng.standard_normal(len(up))
    square = np.einsum("ni,nj->nij", up, up).reshape(-1, 9)
    adjusted = np.hstack([up, square])
    left = np.asarray(norms - adjusted @ np.linalg.lstsq(adjusted, norms, rcond=1e-9)[0], dtype=np.float64)
    return left, up, rests_of(np.full(len(up), 4e-4**2))


@pytest.mark.parametrize(
    ("before", "jump"), [(12, [8e-3, 2e-3, -5e-3]), (19, [0.0, 0.0, 2e-2]), (15, [0.0, 3e-3, 0.0])]
)
def test_accelerometers_that_jump_are_found_between_their_holds(before: int, jump: list[float]) -> None:
    """The last is one axis by 0.3 mg, eight times what a hold is measured to."""
    later = np.arange(30)[:, None] > before
    course = find_force_course(*norms_of(later * np.array(jump), 3))
    assert course is not None
    assert course.is_contradiction
    assert course.after == before
    assert course.size == pytest.approx(jump, abs=1.2e-3)
    assert course.departure(np.array([0.0, 209.0])) == pytest.approx(np.stack([-course.size, np.zeros(3)]))


def wandering(kind: str, rng: np.random.Generator, holds: int = 30) -> np.ndarray:
    """(holds, 3) means by 1/f noise or a random walk, of 1 mm/s² about their mean, from eight parts a hold."""
    frequency = np.fft.rfftfreq(16 * holds)[1:, None]
    lines = rng.standard_normal((len(frequency), 3)) + 1j * rng.standard_normal((len(frequency), 3))
    lines /= frequency ** {"1/f": 0.5, "walk": 1.0}[kind]
    course = np.fft.irfft(np.vstack([np.zeros((1, 3)), lines]), axis=0)[: 7 * holds]
    means = course.reshape(holds, 7, 3)[:, :5].mean(axis=1)
    means -= means.mean(axis=0)
    return np.asarray(1e-3 * means / means.std())


def test_accelerometers_that_warm_up_do_not_jump() -> None:
    """Of 100 units that warm up by 3 mg none is said to jump."""
    rng = np.random.default_rng(4)
    order, found = np.arange(30)[:, None], 0
    for seed in range(100):
        warming = 0.03 * rng.standard_normal(3) * np.exp(-order / (30 * rng.uniform(0.05, 0.6)))
        course = find_force_course(*norms_of(warming, seed))
        found += course is not None and course.after is not None
    assert found == 0


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["white", "1/f", "walk"])
def test_what_only_wanders_is_said_to_jump_no_more_often_than_stated(kind: str) -> None:
    """At 2.5 % each for jumps and drifts, of 300 units: 15 expected, and more than 26 has a chance of 1e-3."""
    assert CONTRADICTION == 0.002
    alarms = {"force": 0, "rate": 0}
    for seed in range(300):
        rng = np.random.default_rng(1000 + seed)
        wander = np.zeros((30, 3)) if kind == "white" else wandering(kind, rng)
        alarms["force"] += find_force_course(*norms_of(wander, seed), chance=0.025) is not None
        shown = wander[:, 0] + 4e-4 * rng.standard_normal(30)
        alarms["rate"] += find_rate_course(shown, rests_of(np.ones(30)), chance=0.025) is not None
    assert max(alarms.values()) <= 26


def test_jumps_are_hidden_where_all_faces_up_come_before_all_faces_down() -> None:
    """With the faces up first, M' = M - j (1, 1, 1)/2g and b' = b + j/2 give all six readings, and are no unit's."""
    rng = np.random.default_rng(2)
    ordered = np.vstack([np.eye(3), -np.eye(3)])
    matrix, bias, jump = (
        np.eye(3) + 0.02 * rng.standard_normal((3, 3)),
        rng.standard_normal(3),
        np.array([0.3, -0.1, 0.2]),
    )
    shown = 9.8 * ordered @ matrix.T + bias + np.where(np.arange(6)[:, None] > 2, jump, 0.0)
    other = matrix - np.outer(jump, np.ones(3)) / (2 * 9.8)
    assert 9.8 * ordered @ other.T + bias + jump / 2 == pytest.approx(shown, abs=1e-12)
    assert hidden_jumps(ordered) == [2]
    # placed to a degree, and each face held three times
    leaning = np.repeat(ordered, 3, axis=0) + 0.01 * rng.standard_normal((18, 3))
    assert hidden_jumps(leaning / np.linalg.norm(leaning, axis=1, keepdims=True)) == [8]
    assert hidden_jumps(ordered[[0, 3, 1, 4, 2, 5]]) == []
    assert hidden_jumps(np.vstack([ordered, ordered[:1]])) == []
    assert hidden_jumps(ordered[:4]) == []
