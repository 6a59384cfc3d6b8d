"""Better sets of poses, held against an independent computation and against each other."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.attitude.directions import twenty_six_directions
from tumble.units import STANDARD_GRAVITY
from tumble_papers.zhang.pose_sets import (
    badness,
    chatfield_orientations,
    find_best_on_sphere,
    find_best_subset,
    paper_nine,
    predict_sigma,
)

SECOND = np.pi / 648000.0
MICRO_G = 1e-6 * STANDARD_GRAVITY


def shown(directions: np.ndarray) -> np.ndarray:
    """Ppm, arc-seconds and µg at 50 µg a dwell."""
    sigma = predict_sigma(directions, 50.0 * MICRO_G)
    parts = (1e6 * sigma.scale, sigma.misalignment / SECOND, sigma.bias / MICRO_G)
    return np.sqrt(np.mean(np.square(parts), axis=1))


@pytest.mark.parametrize(
    ("where", "count", "criterion", "expected"),
    [
        ("sphere", 9, "minimax", (32.2, 23.2, 29.9)),
        ("26", 9, "average", (53.7, 13.2, 31.9)),
        ("sphere", 9, "average", (48.0, 12.2, 29.2)),
        ("sphere", 18, "average", (31.7, 8.9, 20.4)),
    ],
)
def test_the_best_sets_are_those_of_an_independent_search(
    where: str, count: int, criterion: str, expected: tuple[float, float, float]
) -> None:
    """Another program's optima, 3 %: its minimax is of the largest ratio itself, ours of a 24-norm."""
    rng = np.random.default_rng(2)
    if where == "26":
        found = find_best_subset(count, rng, criterion=criterion, starts=8)
    else:
        found = find_best_on_sphere(count, rng, criterion=criterion, starts=12)
    assert found.shape == (count, 3)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(shown(found), expected, rtol=0.03)


@pytest.mark.parametrize("criterion", ["average", "minimax"])
def test_small_moves_of_the_poses_change_a_best_set_in_the_second_order(criterion: str) -> None:
    """The slope that the search follows is zero at its end: found by differences, not by its own formula."""
    rng = np.random.default_rng(4)
    best = find_best_on_sphere(9, rng, criterion=criterion, starts=4)
    here = badness(best, criterion)
    for _ in range(5):
        push = rng.standard_normal((9, 3))
        moved = [best + step * push for step in (1e-4, -1e-4)]
        ahead, behind = (badness(m / np.linalg.norm(m, axis=1)[:, None], criterion) for m in moved)
        assert abs(ahead - behind) / 2e-4 < 1e-2 * here
        # A minimum, not a saddle: both ways are worse, by more than round-off.
        assert min(ahead, behind) > here


def test_of_the_26_directions_the_paper_s_nine_are_the_best_in_the_sense_of_minimax() -> None:
    found = find_best_subset(9, np.random.default_rng(6), criterion="minimax", starts=10)
    np.testing.assert_allclose(shown(found), shown(paper_nine()), rtol=1e-9)


def test_badness_is_the_sum_of_variances_and_the_worst_ratio() -> None:
    nine, all_18 = paper_nine(), chatfield_orientations()
    # Six halves and three sevens.
    assert badness(nine) == pytest.approx(24.0, rel=1e-6)
    # Nine ratios of one: their 24-norm.
    assert badness(nine, "minimax") == pytest.approx(9.0 ** (1.0 / 24.0), rel=1e-6)
    assert badness(all_18) < badness(nine)
    # A singular set is bad, not an error.
    assert badness(twenty_six_directions()[:6]) > 1e6


@pytest.mark.parametrize("search", [find_best_subset, find_best_on_sphere])
def test_what_cannot_be_asked_is_refused(search) -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match="9 at least"):
        search(8, rng)
    with pytest.raises(ValueError, match="is none of average, minimax"):
        search(9, rng, criterion="best")
