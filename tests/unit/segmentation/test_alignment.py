"""Alignment of steps with events, and the rough scales that it needs, on cases that can be done by hand."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tumble.attitude import twenty_six_directions
from tumble.segmentation.alignment import (
    align,
    scale_of_poses,
    scale_of_sphere,
    scale_of_units,
    signed_permutations,
)

GAP, AGAIN = 6.0, 3.0


def aligned(steps, events, *, again=AGAIN):
    """Letters that are alike cost nothing, others cannot be matched."""
    cost = np.array([[0.0 if a == b else np.inf for b in events] for a in steps]).reshape(
        len(steps), len(events)
    )
    return align(cost, np.full(len(events), GAP), np.full(len(steps), GAP), np.full(cost.shape, again))


def cheapest(steps, events):
    """The same by trying everything: the step before is the one that an event may repeat."""
    if not events:
        return GAP * len(steps)

    def from_here(i, j, begun):
        if i == len(steps) and j == len(events):
            return 0.0
        ways = []
        if i < len(steps):
            ways.append(GAP + from_here(i + 1, j, -1))
        if j < len(events):
            ways.append(GAP + from_here(i, j + 1, begun))
            if begun >= 0 and steps[begun] == events[j]:
                ways.append(AGAIN + from_here(i, j + 1, begun))
        if i < len(steps) and j < len(events) and steps[i] == events[j]:
            ways.append(from_here(i + 1, j + 1, i))
        return min(ways)

    return from_here(0, 0, -1)


@given(st.text("ab", max_size=5), st.text("abx", max_size=5))
def test_nothing_is_cheaper(steps, events):
    order, cost = aligned(steps, events)
    assert cost == cheapest(steps, events)
    assert order == sorted(order)
    assert all(steps[i] == events[k] for i, k in order)


def test_steps_are_skipped_left_out_and_repeated_in_their_order():
    assert aligned("abc", "axbc") == ([(0, 0), (1, 2), (2, 3)], GAP)
    assert aligned("abc", "abxbc") == ([(0, 0), (1, 1), (1, 3), (2, 4)], GAP + AGAIN)
    # what comes too late is left out, and so is a repetition that is forbidden
    assert aligned("abc", "bca") == ([(1, 0), (2, 1)], 2 * GAP)
    assert aligned("abc", "abbc", again=np.inf)[1] == GAP


CENTRE = np.array([33_000.0, 32_500.0, -400.0])


def test_a_sphere_gives_centre_and_scale():
    up_b = twenty_six_directions()[[0, 1, 2, 7, 13, 20]]
    found = scale_of_sphere(CENTRE + 4000.0 * up_b)
    # arithmetic: differences of numbers of 1e4 in a fit of condition ten
    np.testing.assert_allclose(found.centre, CENTRE, atol=1e-8)
    assert found.scale == pytest.approx(4000.0)
    np.testing.assert_allclose(found.directions(CENTRE + 4000.0 * up_b), up_b, atol=1e-11)


def test_poses_in_one_plane_show_no_sphere():
    angle = np.linspace(0.0, 6.0, 9)
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(9)])
    assert scale_of_sphere(CENTRE + 4000.0 * ring) is None
    assert scale_of_sphere(np.tile(CENTRE, (6, 1))) is None
    assert scale_of_sphere(CENTRE + 4000.0 * np.eye(3)) is None  # three points lie on many spheres


def test_known_poses_give_a_centre_where_the_sphere_does_not():
    up_b = np.eye(3)[[0, 1]]
    found = scale_of_poses(CENTRE + 4000.0 * up_b, up_b)
    np.testing.assert_allclose(found.centre, CENTRE, atol=1e-8)
    assert found.scale == pytest.approx(4000.0)
    # the mirror image is no scale, and one direction tells no centre
    assert scale_of_poses(CENTRE - 4000.0 * up_b, up_b) is None
    assert scale_of_poses(CENTRE + 4000.0 * up_b[[0, 0]], up_b[[0, 0]]) is None
    units = scale_of_units(9.8 * np.eye(3))
    assert np.array_equal(units.centre, np.zeros(3))
    assert units.scale == pytest.approx(9.8)
    # Axes are swapped and reversed in forty-eight ways.
    matrices = signed_permutations()
    assert len({m.tobytes() for m in matrices}) == 48
    assert all(np.array_equal(matrix @ matrix.T, np.eye(3)) for matrix in matrices)
