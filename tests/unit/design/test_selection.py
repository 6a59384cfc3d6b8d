"""The search of poses against brute force, and what it starts from."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from tumble.attitude.rotations import twenty_six_directions
from tumble.design.pose_plan import pose_rows
from tumble.design.selection import find_visits
from tumble.protocol.library import NINE

CUBE = twenty_six_directions()


def mean_variance(chosen: list[int], known: np.ndarray | float = 0.0) -> float:
    rows = pose_rows(CUBE[chosen])
    return float(np.mean(np.diag(np.linalg.inv(rows.T @ rows + known))))


def test_the_exchange_finds_the_best_of_all_sets() -> None:
    """Eleven of the 26 directions, by brute force over their 55 sets of nine."""
    chosen = [0, 1, 2, 3, 4, 5, 6, 8, 11, 13, 20]
    rows = pose_rows(CUBE[chosen])
    found = find_visits(rows, 9, np.random.default_rng(1), starts=12)
    values = [
        mean_variance([chosen[k] for k in subset])
        for subset in itertools.combinations(range(11), 9)
        if np.linalg.cond(rows[list(subset)]) < 1e6
    ]
    # Nine unknowns want nine different poses.
    assert len(set(found)) == 9
    assert mean_variance([chosen[k] for k in found]) == pytest.approx(min(values), rel=1e-6)


def test_the_set_found_is_at_least_as_good_as_the_one_known() -> None:
    """Ppm, arc-seconds and µg at 50 µg a dwell, printed to three digits: half a percent."""
    # Which end a start leads to, round-off decides where exchanges tie: of three hundred some end at the best.
    found = find_visits(pose_rows(CUBE), 9, np.random.default_rng(0), starts=300)
    parts = np.array([53.7e-6, 13.2 * np.pi / 648000.0, 31.9e-6]) / 50e-6
    assert mean_variance(found) <= 1.005 * float(np.mean(parts**2))


def test_a_set_to_start_from_is_never_made_worse() -> None:
    edges = list(range(6, 18))
    found = find_visits(pose_rows(CUBE), 12, np.random.default_rng(1), starts=1, also=[edges])
    assert mean_variance(found) <= mean_variance(edges) * (1.0 + 1e-9)


def test_what_is_known_already_steers_the_choice() -> None:
    """After six faces and three edges, whose misalignments are worst, six more poses are edges and corners."""
    rows = pose_rows(CUBE[list(NINE)])
    known = rows.T @ rows
    found = find_visits(pose_rows(CUBE), 6, np.random.default_rng(1), known=known)
    assert min(found) >= 6
    assert mean_variance(found, known) < mean_variance(list(NINE))
