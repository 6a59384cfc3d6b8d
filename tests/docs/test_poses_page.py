"""The page on poses: its table is what Zhang's sensitivities predict."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tumble.attitude.rotations import twenty_six_directions
from tumble.calibration.poses import norm_rows
from tumble.units import STANDARD_GRAVITY
from tumble_papers.zhang.pose_sets import (
    chatfield_orientations,
    find_best_on_sphere,
    find_best_subset,
    paper_nine,
    predict_sigma,
)

PAGE = Path(__file__).resolve().parents[2] / "docs" / "poses.md"


def tabled_sets() -> dict[str, np.ndarray]:
    """The sets of the page's table, by name."""
    directions = twenty_six_directions()
    faces, edges, corners = directions[:6], directions[6:18], directions[18:]
    # A corner and its three neighbours.
    four = corners[np.sum(corners > 0.0, axis=1) >= 2]

    def found(search: Callable[..., np.ndarray], count: int, criterion: str) -> np.ndarray:
        return search(count, np.random.default_rng(0), criterion=criterion)

    return {
        "the paper's nine: faces, an edge in each plane": paper_nine(),
        "nine on the sphere, minimax": found(find_best_on_sphere, 9, "minimax"),
        "nine of the 26, average": found(find_best_subset, 9, "average"),
        "nine on the sphere, average": found(find_best_on_sphere, 9, "average"),
        "ten: faces, a corner and its three neighbours": np.vstack([faces, four]),
        "twelve edges": edges,
        "fourteen: faces and corners": np.vstack([faces, corners]),
        "eighteen: faces and edges": chatfield_orientations(),
        "18 on the sphere, average": found(find_best_on_sphere, 18, "average"),
        "all 26": directions,
    }


def test_the_table_is_what_the_library_predicts() -> None:
    page = PAGE.read_text(encoding="utf-8")
    table = page.partition("<!-- sets -->")[2].partition("<!-- /sets -->")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.strip().splitlines()[2:]]
    sets = tabled_sets()
    assert [row[0] for row in rows] == list(sets)
    for (_, count, *cells), directions in zip(rows, sets.values(), strict=True):
        assert int(count) == len(directions)
        sigma = predict_sigma(directions, STANDARD_GRAVITY)
        parts = (sigma.scale, sigma.misalignment, sigma.bias / STANDARD_GRAVITY)
        expected = np.sqrt(np.mean(np.square(parts), axis=1))
        seconds = 180.0 * 3600.0 / np.pi
        shown = np.array(cells, dtype=float)
        # Printed to two digits and to one behind the point; a search ends a little elsewhere on another machine.
        np.testing.assert_allclose(shown[:3], expected, atol=0.006)
        np.testing.assert_allclose(shown[3:], expected * np.array([50.0, 50e-6 * seconds, 50.0]), atol=0.15)


def test_the_worst_poses_after_a_calibration_are_as_the_page_says() -> None:
    """2.2 σ towards the corner opposite to the nine's edges."""
    rows = norm_rows(paper_nine())
    cofactor = np.linalg.inv(rows.T @ rows)
    opposite = norm_rows(-np.ones((1, 3)) / np.sqrt(3.0))[0]
    sigma = float(np.sqrt(opposite @ cofactor @ opposite))
    assert sigma == pytest.approx(2.23, abs=0.01)
    drawn = np.random.default_rng(1).standard_normal((5000, 3))
    anywhere = norm_rows(drawn / np.linalg.norm(drawn, axis=1)[:, None])
    assert np.sqrt(np.einsum("ni,ij,nj->n", anywhere, cofactor, anywhere)).max() <= sigma + 1e-9
