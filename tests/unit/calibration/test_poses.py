"""Poses in words, which are missing, and whether adding exactly those helps."""

import itertools
import re

import numpy as np
import pytest

from tumble.calibration import NormConditions, poses

FORCE = np.array([0.1, -0.2, 0.3, 1.02, 0.98, 1.05, 0.01, -0.02, 0.03, 0.0, 0.0, 0.0])
FACES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
GRAVITY = 9.81
UP = poses.twenty_six_directions()
EDGES, CORNERS = UP[6:18], np.sign(UP[18:])


def raw(directions: np.ndarray) -> np.ndarray:
    """Hold means of a unit with scale and bias of FORCE; its small angles do not matter here."""
    return GRAVITY * directions * FORCE[3:6] + FORCE[:3]


def refusal(directions: np.ndarray, *, has_prior: bool = False) -> str:
    return poses.missing_poses(raw(directions), FORCE, has_prior=has_prior)


def named_in(message: str) -> np.ndarray:
    """The directions that a message asks for, read as a user would."""
    asked = message[message.index("also with") :]
    words = re.findall(r"(?:edge between |corner of )?[+-][xyz](?:(?:, | and )[+-][xyz])* up", asked)
    assert words, message
    directions = []
    for word in words:
        direction = np.zeros(3)
        for sign, axis in re.findall(r"([+-])([xyz])", word):
            direction["xyz".index(axis)] = 1.0 if sign == "+" else -1.0
        directions.append(direction / np.linalg.norm(direction))
    return np.array(directions)


def plane(normal_axis: int, count: int = 16) -> np.ndarray:
    angle = 2.0 * np.pi * np.arange(count) / count
    return np.insert(np.column_stack([np.cos(angle), np.sin(angle)]), normal_axis, 0.0, axis=1)


def test_the_26_directions_are_6_faces_12_edges_and_8_corners() -> None:
    assert np.count_nonzero(np.abs(UP) > 1e-9, axis=1).tolist() == [1] * 6 + [2] * 12 + [3] * 8
    assert len({tuple(np.round(d, 6)) for d in UP}) == 26
    np.testing.assert_allclose(np.linalg.norm(UP, axis=1), 1.0, atol=1e-15)


@pytest.mark.parametrize(
    ("up", "words"),
    [
        ([9.8, 0.3, -0.2], "+x up"),
        ([0.1, -9.7, 0.4], "-y up"),
        ([0.0, 7.0, -7.0], "edge between +y and -z up"),
        ([-5.7, 5.7, 5.7], "corner of -x, +y and +z up"),
    ],
)
def test_a_direction_is_called_after_what_points_up(up: list[float], words: str) -> None:
    assert poses.describe_direction(np.array(up)) == words


def test_poses_within_ten_degrees_are_one() -> None:
    near, far = np.radians(8.0), np.radians(12.0)
    directions = np.array(
        [[1.0, 0.0, 0.0], [np.cos(near), np.sin(near), 0.0], [np.cos(far), 0.0, np.sin(far)], [2.0, 0.0, 0.0]]
    )
    assert poses.distinct_poses(directions) == [0, 2]


def test_what_a_pose_says_is_the_derivative_of_the_corrected_norm() -> None:
    """The estimator's own, at an ideal unit. The corrected norm falls with what the true output would raise."""
    ideal = np.repeat([0.0, 1.0, 0.0], [3, 3, 6])
    conditions = NormConditions(GRAVITY * UP, np.zeros((26, 3, 3)), GRAVITY, ideal, np.arange(9))
    moved = conditions.linearise(ideal[:9]).design[:, 0] / np.repeat([1.0, GRAVITY], [3, 6])
    np.testing.assert_allclose(moved, -poses.norm_rows(UP), atol=1e-12)


@pytest.mark.parametrize(("axis", "pair"), [(0, "y to z"), (1, "x to z"), (2, "x to y")])
@pytest.mark.parametrize("count", [3, 8])
def test_faces_and_edges_of_two_planes_are_told_which_edge_is_missing(axis, pair, count) -> None:
    message = refusal(np.vstack([FACES, EDGES[np.abs(EDGES[:, axis]) > 0.5][:count]]))
    assert f"do not determine the non-orthogonality of {pair}. " in message
    asked = named_in(message)
    assert len(asked) == 1
    assert asked[0, axis] == 0.0
    assert np.count_nonzero(asked[0]) == 2


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_poses_all_in_one_plane_are_told_which_axis_is_missing(axis: int) -> None:
    message, name = refusal(plane(axis)), "xyz"[axis]
    assert "do not determine" in message
    # Each of the four is open by itself: nothing is to be separated from another.
    assert "separate" not in message
    assert all(f"{what} of {name}" in message for what in ("the scale factor", "the bias")), message
    others = [other for other in "xyz" if other != name]
    for other in others:
        assert f"the non-orthogonality of {min(name, other)} to {max(name, other)}" in message
    assert f"the non-orthogonality of {others[0]} to {others[1]}" not in message
    assert np.all(np.abs(named_in(message)[:, axis]) > 0.5), message


# What Zhang et al. (2010) call orientations 8, 10, 12-18 and print 500,000 ppm for.
LEFT_OUT = np.array([[1, 1, 0], [1, 0, 1], [0, 1, 1]]) / np.sqrt(2.0)
NINE = EDGES[np.max(EDGES @ LEFT_OUT.T, axis=1) < 0.9]
WHOLE = "do not separate the scale factors, the biases and the non-orthogonalities"
PLANES = "in 6 of them up lies in one plane, in the other 3 in another"
FEW = {
    "six faces": (FACES, "6 different poses were found and 9 are needed"),
    "one pose": (FACES[:1], "1 different pose was found and 9 are needed"),
    "one pose, again and again": (np.tile(FACES[4], (12, 1)), "1 different pose was found and 9 are needed"),
    "five faces": (FACES[:5], "5 different poses were found and 9 are needed"),
    **{f"a plane without {'xyz'[k]}": (plane(k), "do not determine") for k in range(3)},
    "never upside down": (UP[UP[:, 2] > 0.1], "separate the scale factors and the bias of z"),
    "some edges": (EDGES[:8], ""),
    "nine edges in two planes": (NINE, rf"{WHOLE}.*{PLANES}"),
    "faces and some edges": (np.vstack([FACES, EDGES[:4]]), ""),
}


@pytest.mark.parametrize("has_prior", [False, True], ids=["alone", "with a prior"])
@pytest.mark.parametrize("what", FEW)
def test_too_little_is_said_and_recording_exactly_the_poses_that_are_named_is_enough(what, has_prior) -> None:
    directions, said = FEW[what]
    message = refusal(directions, has_prior=has_prior)
    # Every one of these is too little for nine unknowns, and five faces for six.
    assert message or (has_prior and what != "five faces")
    if not message:
        return
    assert re.search(said, message) or has_prior
    assert ("--prior" in message) == (not has_prior) or what != "six faces"
    assert not (has_prior and "--prior" in message)
    asked = named_in(message)
    assert not refusal(np.vstack([directions, asked]), has_prior=has_prior)
    assert len(asked) <= 9
    # Nobody is sent to a pose that he has held.
    distinct = len(poses.distinct_poses(np.vstack([directions, asked])))
    assert distinct == len(poses.distinct_poses(directions)) + len(asked)
    if what == "six faces":
        # Faces say nothing of non-orthogonality: none is asked for again.
        assert np.all(np.count_nonzero(asked, axis=1) > 1)
        assert len(asked) == 3


def test_poses_placed_by_hand_are_refused_for_the_same_reason() -> None:
    """Off by 1.5°; where two planes are the reason given, six poses lie in one to 4° of the normal's part."""
    rng, with_reason = np.random.default_rng(12), 0
    for _ in range(50):
        placed = NINE + np.radians(1.5) * rng.standard_normal(NINE.shape)
        said = poses.describe_untold(placed / np.linalg.norm(placed, axis=1)[:, None])
        assert said == "" or WHOLE[7:] in said
        with_reason += PLANES in said
    # A few tell all, just so, or lie no longer in planes.
    assert with_reason > 40


@pytest.mark.parametrize("left_out", list(itertools.product(range(4), repeat=3)))
def test_nine_edges_are_singular_exactly_if_the_three_left_out_have_a_product_of_one(left_out):
    """All 64 choices of one edge left out in each plane.

    If the product of the signs of the three is +1 there is a corner σ with σ_i σ_j = s_i s_j on all three: the six
    edges at right angles to it all remain. Three more directions lie in some plane m . u = c, and
    (σ . u)(m . u - c) vanishes in all nine.
    """
    planes = [EDGES[np.abs(EDGES[:, axis]) < 0.1] for axis in (2, 1, 0)]
    chosen = np.array([plane[index] for plane, index in zip(planes, left_out, strict=True)])
    nine = EDGES[np.max(EDGES @ chosen.T, axis=1) < 0.9]
    rank = np.linalg.matrix_rank(poses.norm_rows(nine), tol=1e-9)
    hexagons = [corner for corner in CORNERS if np.sum(np.abs(nine @ corner) < 1e-9) == 6]
    if np.prod(np.where(np.abs(chosen) > 0.1, np.sign(chosen), 1.0)) == 1:
        assert (rank, len(hexagons)) == (8, 2)  # a corner and its opposite: one plane
        (untold,) = poses.undetermined_combinations(nine)
        # The quadric through all nine: it vanishes there, and not at a corner.
        np.testing.assert_allclose(poses.norm_rows(nine) @ untold, 0.0, atol=1e-12)
        assert np.max(np.abs(poses.norm_rows(UP) @ untold)) > 0.1
        assert [len(plane) for plane in poses.find_two_planes(nine) or ()] == [6, 3]
    else:
        assert (rank, len(hexagons)) == (9, 0)
        assert not poses.undetermined_combinations(nine)
