"""Which combinations of parameters are told badly."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.estimation import find_weak_directions
from tumble.estimation.reliability import WeakDirection


def test_a_known_combination_is_found_with_its_sigma() -> None:
    # The sum of the first two is known to 0.01, their difference to 5, the third to 0.1.
    total, difference = np.array([1.0, 1.0, 0.0]), np.array([1.0, -1.0, 0.0])
    normal = np.outer(total, total) / 0.01**2 + np.outer(difference, difference) / 5.0**2
    normal[2, 2] = 1.0 / 0.1**2
    (weak,) = find_weak_directions(normal, np.ones(3), 1.0)
    # of the unit vector difference / sqrt(2): 5 / sqrt(2)
    assert weak.sigma == pytest.approx(5.0 / np.sqrt(2.0), rel=1e-6)
    np.testing.assert_allclose(np.abs(weak.direction), np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0), atol=1e-6)
    assert weak.direction[0] * weak.direction[1] < 0
    assert sorted(weak.leading()) == [0, 1]


def test_sigmas_are_in_the_sizes_that_matter() -> None:
    normal = np.diag([1.0 / 0.02**2, 1.0 / 30.0**2])  # 0.02 rad and 30 counts
    assert find_weak_directions(normal, np.array([1.0, 100.0]), 1.0) == []
    weak = find_weak_directions(normal, np.array([0.01, 100.0]), 1.0)
    assert [w.sigma for w in weak] == [pytest.approx(2.0)]
    assert weak[0].leading() == [0]


def test_what_is_not_determined_at_all_comes_first_and_is_infinite() -> None:
    direction = np.array([3.0, -4.0, 0.0]) / 5.0
    across = np.array([4.0, 3.0, 0.0]) / 5.0
    normal = np.outer(across, across) * 0.25 + np.diag([0.0, 0.0, 1.0 / 9.0])
    weak = find_weak_directions(normal, np.ones(3), 1.0)
    assert [w.sigma for w in weak] == [np.inf, pytest.approx(3.0), pytest.approx(2.0)]
    assert abs(weak[0].direction @ direction) == pytest.approx(1.0)
    assert all(w.sigma == np.inf for w in find_weak_directions(np.zeros((2, 2)), np.ones(2), 1.0))


def test_the_leading_parameters_are_the_largest_first() -> None:
    weak = WeakDirection(np.array([0.1, -0.9, 0.3, 0.26]), 1.0)
    assert weak.leading() == [1, 2]
    assert weak.leading(0.05) == [1, 2, 3, 0]
