"""The page on poses: its table is what the library predicts, and its maps show what they say."""

from __future__ import annotations

import re
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from tumble.calibration.poses import norm_rows
from tumble.design.pose_sets import paper_nine, predict_sigma
from tumble.units import STANDARD_GRAVITY

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.fixture(scope="module")
def script() -> ModuleType:
    spec = spec_from_file_location("norm_sensitivity", DOCS / "figures" / "norm_sensitivity.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_table_is_what_the_library_predicts(script: ModuleType) -> None:
    page = (DOCS / "poses.md").read_text(encoding="utf-8")
    table = page.partition("<!-- sets -->")[2].partition("<!-- /sets -->")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.strip().splitlines()[2:]]
    sets = script.tabled_sets()
    assert [row[0] for row in rows] == list(sets)
    for (_, count, *cells), directions in zip(rows, sets.values(), strict=True):
        assert int(count) == len(directions)
        scale, misalignment, bias = predict_sigma(directions, STANDARD_GRAVITY).mean_squares()
        expected = np.array([scale, misalignment, bias / STANDARD_GRAVITY])
        seconds = 180.0 * 3600.0 / np.pi
        shown = np.array(cells, dtype=float)
        # Printed to two digits and to one behind the point; a search ends a little elsewhere on another machine.
        np.testing.assert_allclose(shown[:3], expected, atol=0.006)
        np.testing.assert_allclose(shown[3:], expected * np.array([50.0, 50e-6 * seconds, 50.0]), atol=0.15)


def test_both_halves_show_every_direction_once_and_equal_areas(script: ModuleType) -> None:
    halves = [script.Hemisphere(side * script.FRONT, 0.0, 0.0) for side in (1.0, -1.0)]
    rng = np.random.default_rng(8)
    drawn = rng.standard_normal((20000, 3))
    drawn /= np.linalg.norm(drawn, axis=1)[:, None]
    places = [[half.at(up) for up in drawn] for half in halves]
    assert all((a is None) != (b is None) for a, b in zip(*places, strict=True))
    reach = np.array([np.hypot(*place) / script.RADIUS for place in places[0] if place is not None])
    # Of equal areas the share within r is r²: three binomial sigmas of 10,000.
    for r in (0.3, 0.6, 0.9):
        assert abs(np.mean(reach < r) - r * r) < 0.015
    # Where a direction is drawn, its shade is sampled.
    for half in halves:
        radius, turn = np.array([0.2, 0.5, 0.99]), np.array([0.4, 2.5, 5.0])
        for up, r, t in zip(half.directions(radius, turn), radius, turn, strict=True):
            x, y = half.at(up)
            np.testing.assert_allclose(
                [x, -y], script.RADIUS * r * np.array([np.cos(t), np.sin(t)]), atol=1e-9
            )


def test_the_published_map_marks_the_nine_where_they_are(script: ModuleType) -> None:
    text = (DOCS / "figures" / "norm-sensitivity.svg").read_text(encoding="utf-8")
    marks = re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)" r="7.5"', text)
    # Nine in each of three maps, none on both halves.
    assert len(marks) == 27
    first = {(float(x), float(y)) for x, y in marks[:9]}
    radius = script.RADIUS
    halves = [
        script.Hemisphere(side * script.FRONT, 16 + radius + shift, 92 + radius)
        for side, shift in ((1.0, 0.0), (-1.0, 2 * radius + 14))
    ]
    expected = {place for half in halves for up in paper_nine() if (place := half.at(up)) is not None}
    assert len(expected) == 9
    for x, y in expected:
        assert min(np.hypot(x - a, y - b) for a, b in first) < 0.1


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
