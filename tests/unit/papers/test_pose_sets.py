"""Chatfield's orientations, what sets of poses promise, and which of them tell too little."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from tumble.attitude.directions import twenty_six_directions
from tumble.calibration.poses import find_two_planes, find_untold, norm_rows
from tumble.errors import ObservabilityError
from tumble.units import STANDARD_GRAVITY
from tumble_papers.zhang.pose_sets import (
    OTHER_EDGE_NUMBERS,
    chatfield_orientations,
    explain_pose_set,
    information,
    norm_sensitivity,
    paper_nine,
    predict_sigma,
)

SECOND = np.pi / 648000.0
MICRO_G = 1e-6 * STANDARD_GRAVITY
# Table 3: 500 µg/√Hz over 100 s.
DWELL = 50.0 * MICRO_G


def edges() -> np.ndarray:
    return twenty_six_directions()[6:18]


def planes_edges() -> list[np.ndarray]:
    """The four edges in each coordinate plane."""
    return [edges()[np.abs(edges()[:, axis]) < 0.1] for axis in (2, 1, 0)]


def without(left_out: np.ndarray) -> np.ndarray:
    return edges()[np.max(edges() @ left_out.T, axis=1) < 0.9]


@pytest.mark.parametrize("signs", list(itertools.product((1, -1), repeat=3)))
def test_the_eighteen_are_faces_and_edges_as_the_paper_numbers_them(signs: tuple[int, int, int]) -> None:
    numbered = dict(enumerate(chatfield_orientations(signs), 1))
    parts = {number: np.count_nonzero(np.abs(up) > 1e-9) for number, up in numbered.items()}
    assert [number for number, count in parts.items() if count == 1] == [1, 3, 5, 7, 9, 11]
    assert len({tuple(np.round(up, 6)) for up in numbered.values()}) == 18
    # One edge of the nine in each plane, with the sign asked for.
    for number, (i, j), sign in zip((2, 4, 6), itertools.combinations(range(3), 2), signs, strict=True):
        assert np.sign(numbered[number][i] * numbered[number][j]) == sign
    np.testing.assert_array_equal(paper_nine(signs), [numbered[n] for n in (1, 2, 3, 4, 5, 6, 7, 9, 11)])


def test_a_sign_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="1 or -1"):
        chatfield_orientations((1, 0, 1))


def test_information_is_of_the_norm_s_own_derivatives() -> None:
    """Half the squared norm's over the norm; scale relative: without angles, exact to round-off."""
    scale, gravity = np.array([95.0, 104.0, 112.0]), 9.8
    directions = twenty_six_directions()[:20]
    columns = norm_sensitivity(directions, scale, np.zeros(3), gravity).columns() / (2.0 * gravity)
    columns[:, :3] *= scale
    columns[:, 6:] *= scale
    sigma = np.linspace(1.0, 2.0, 20)
    expected = (columns / sigma[:, None]).T @ (columns / sigma[:, None])
    np.testing.assert_allclose(information(directions, sigma, gravity), expected, atol=1e-11)


def test_of_the_nine_theory_and_tables_agree() -> None:
    """Faces give scale and bias by sums and differences of two norms; an edge takes seven variances."""
    predicted = predict_sigma(paper_nine(), DWELL)
    np.testing.assert_allclose(predicted.scale, 50e-6 / np.sqrt(2.0), rtol=1e-12)
    np.testing.assert_allclose(predicted.bias, DWELL / np.sqrt(2.0), rtol=1e-12)
    np.testing.assert_allclose(predicted.misalignment, 50e-6 * np.sqrt(7.0), rtol=1e-12)


@pytest.mark.parametrize(
    ("directions", "expected"),
    [
        pytest.param(paper_nine(), (35.4, 27.3, 35.4), id="the nine"),
        pytest.param(twenty_six_directions()[6:18], (43.3, 10.3, 25.0), id="twelve edges"),
        pytest.param(chatfield_orientations(), (26.4, 10.3, 20.4), id="all eighteen"),
    ],
)
def test_sets_promise_what_an_independent_computation_found(
    directions: np.ndarray, expected: tuple[float, float, float]
) -> None:
    """Ppm, arc-seconds and µg at 50 µg a dwell; computed elsewhere to the digits given."""
    sigma = predict_sigma(directions, DWELL)
    parts = (1e6 * sigma.scale, sigma.misalignment / SECOND, sigma.bias / MICRO_G)
    found = np.sqrt(np.mean(np.square(parts), axis=1))
    np.testing.assert_allclose(found, expected, atol=0.06)


@pytest.mark.parametrize("left_out", list(itertools.product(range(4), repeat=3)))
def test_nine_edges_are_singular_exactly_if_the_three_left_out_have_a_product_of_one(
    left_out: tuple[int, int, int],
) -> None:
    """All 64 choices of one edge left out in each plane."""
    chosen = np.array([plane[index] for plane, index in zip(planes_edges(), left_out, strict=True)])
    nine = without(chosen)
    assert nine.shape == (9, 3)
    rank = np.linalg.matrix_rank(norm_rows(nine), tol=1e-9)
    # Six of the nine in a plane through the middle: the plane at right angles to a corner.
    hexagons = [c for c in itertools.product((1, -1), repeat=3) if np.sum(np.abs(nine @ c) < 1e-9) == 6]
    # The nine that remain determine nine unknowns only if the product of the signs of the three is -1. If it is +1
    # there is a corner σ with σ_i σ_j = s_i s_j on all three: the six edges at right angles to it all remain. Three
    # more directions lie in some plane m . u = c, and (σ . u)(m . u - c) vanishes in all nine.
    if np.prod(np.where(np.abs(chosen) > 0.1, np.sign(chosen), 1.0)) == 1:
        assert rank == 8
        assert len(hexagons) == 2  # a corner and its opposite: one plane
        (untold,) = find_untold(nine)
        # The quadric through all nine: it vanishes there, and not at a corner.
        np.testing.assert_allclose(norm_rows(nine) @ untold, 0.0, atol=1e-12)
        assert np.max(np.abs(norm_rows(twenty_six_directions()) @ untold)) > 0.1
        first, second = find_two_planes(nine) or ([], [])
        assert (len(first), len(second)) == (6, 3)
    else:
        assert rank == 9
        assert not hexagons
        assert not find_untold(nine)


@pytest.mark.parametrize("signs", list(itertools.product((1, -1), repeat=3)))
def test_what_is_left_of_the_eighteen_is_refused_or_not_by_the_signs_of_the_three(
    signs: tuple[int, int, int],
) -> None:
    others = chatfield_orientations(signs)[[n - 1 for n in OTHER_EDGE_NUMBERS]]
    said = explain_pose_set(others)
    if np.prod(signs) == 1:
        assert "The 9 poses do not separate the scale factors, the biases and the non-orthogonalities" in said
        assert "in 6 of them up lies in one plane, in the other 3 in another" in said
        with pytest.raises(ObservabilityError, match=r"Add (corner of|[+-])"):
            predict_sigma(others, DWELL)
    else:
        assert said == ""
        # Twelve edges tell more than nine of them, and nine still something.
        twelve, nine = predict_sigma(edges(), DWELL), predict_sigma(others, DWELL)
        assert np.all(nine.scale > twelve.scale)
        assert np.all(nine.scale < 10.0 * twelve.scale)


def test_the_pose_that_is_named_mends_the_set() -> None:
    nine = without(np.array([[1, 1, 0], [1, 0, 1], [0, 1, 1]]) / np.sqrt(2.0))
    assert explain_pose_set(nine).endswith("Add corner of +x, +y and +z up.")
    predict_sigma(np.vstack([nine, np.ones(3) / np.sqrt(3.0)]), DWELL)


def test_dwells_repeated_in_their_poses_tell_the_same_and_more_surely() -> None:
    nine = without(np.array([[1, 1, 0], [1, 0, 1], [0, 1, 1]]) / np.sqrt(2.0))
    assert "in 6 of them up lies in one plane, in the other 3" in explain_pose_set(np.vstack([nine, nine]))
    once, twice = (predict_sigma(np.vstack([paper_nine()] * n), DWELL) for n in (1, 2))
    np.testing.assert_allclose(twice.misalignment, once.misalignment / np.sqrt(2.0), rtol=1e-12)


def test_one_pose_is_spoken_of_as_one() -> None:
    assert explain_pose_set(np.array([[0.0, 0.0, 1.0]])).startswith("The 1 pose does not determine ")
