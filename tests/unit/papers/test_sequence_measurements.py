"""What a rotation sequence measures: of an ideal unit nothing, and of a tilted one as much as geometry says."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.protocol.strapdown_rotation import SEQUENCES, start_down
from tumble_papers.savage.sequences import (
    AVERAGING,
    SequenceMeasurement,
    measure_sequence,
    window_weights,
)

GRAVITY, STEP, REST, TURN = 9.81, 0.02, 200, 80
EARTH = 7.2921e-5
ROWS = {row.name: row for row in SEQUENCES}
DOWN_Z = np.array([0.0, 0.0, 1.0])


def recorded(
    rotations: tuple[tuple[int, float], ...], earth_b: np.ndarray, down: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Exact rates (rotation vector of each sample over its time) and forces of a unit on the turning Earth."""
    vectors = [np.zeros((REST, 3))]
    for axis, angle in rotations:
        vectors += [np.tile(np.eye(3)[axis] * angle / TURN, (TURN, 1))]
    vectors.append(np.zeros((REST, 3)))
    # Attitude against the Earth at the edges of the samples, in the frame of the start.
    edges = [Rotation.identity()]
    for vector in np.concatenate(vectors):
        edges.append(edges[-1] * Rotation.from_rotvec(vector))
    against_inertial = [Rotation.from_rotvec(earth_b * k * STEP) * edge for k, edge in enumerate(edges)]
    rate = np.array([(one.inv() * other).as_rotvec() / STEP for one, other in pairwise(against_inertial)])
    force = np.array([edge.inv().apply(-GRAVITY * down) for edge in edges[1:]])
    return rate, force


def measured(
    rate: np.ndarray, force: np.ndarray, earth: np.ndarray, down: np.ndarray = DOWN_Z, **options
) -> SequenceMeasurement:
    end = (len(rate) - REST, len(rate))
    return measure_sequence(rate, force, STEP, earth, (0, REST), end, GRAVITY, down, **options)


@pytest.mark.parametrize("averaging", AVERAGING)
@pytest.mark.parametrize("start_bias", [True, False])
@pytest.mark.parametrize("name", ["1", "6", "7", "10", "14"])
def test_an_ideal_unit_measures_nothing_on_the_turning_earth(
    name: str, start_bias: bool, averaging: str
) -> None:
    row = ROWS[name]
    down = start_down(row)
    earth = EARTH * np.array([0.52, -0.41, 0.75])
    rate, force = recorded(row.rotations, earth, down)
    found = measured(rate, force, earth, down, start_bias=start_bias, averaging=averaging)
    # Half a sample of the Earth's turn is 0.7 µrad in both windows, and does not stand in their difference to first
    # order; its square of 5e-13 does, and rounding of 10 m/s².
    np.testing.assert_allclose(found.vector, 0.0, rtol=0, atol=3e-11)
    np.testing.assert_allclose(found.gyro_bias, 0.0, rtol=0, atol=1e-9)


def test_the_earth_left_out_is_what_it_turns_between_the_two_windows() -> None:
    """Of a rotation of 360°, without a bias from the start: the turn of the mean of one rest to that of the other."""
    earth = EARTH * np.array([0.6, 0.0, 0.8])
    rate, force = recorded(ROWS["1"].rotations, earth, DOWN_Z)
    found = measured(rate, force, np.zeros(3), start_bias=False)
    seconds = STEP * (REST + TURN)
    # 7e-5 rad/s for 6 s is 0.4 mrad, and second order a thousandth of the first
    expected = GRAVITY * np.cross(DOWN_Z, seconds * earth)
    np.testing.assert_allclose(found.horizontal, expected, rtol=0, atol=2e-3 * np.linalg.norm(expected))


@pytest.mark.parametrize("averaging", AVERAGING)
@pytest.mark.parametrize("count", [1, 2, 3, 10, 11, 500])
def test_weights_of_a_window_add_up_to_one_and_lie_even(averaging: str, count: int) -> None:
    weights = window_weights(count, averaging)
    assert weights.shape == (count,)
    assert np.sum(weights) == pytest.approx(1.0, abs=1e-14)
    np.testing.assert_allclose(weights, weights[::-1], rtol=0, atol=1e-15)
    assert np.all(weights > 0.0)


def test_an_average_of_averages_is_the_mean_of_running_means() -> None:
    signal = np.random.default_rng(4).normal(size=9)
    running = [np.mean(signal[k : k + 5]) for k in range(5)]
    assert window_weights(9, "average-of-averages") @ signal == pytest.approx(np.mean(running), rel=1e-14)
    assert window_weights(9, "plain") @ signal == pytest.approx(np.mean(signal), rel=1e-14)


@pytest.mark.parametrize("angle", [1e-3, 5e-3])
def test_a_fixture_that_leans_by_an_angle_shortens_the_projection_by_half_its_square_and_not_the_norm(
    angle: float,
) -> None:
    leaning = Rotation.from_rotvec([angle, 0.0, 0.0]).apply(DOWN_Z)
    rate, force = recorded(((1, np.pi),), np.zeros(3), leaning)
    by_norm = measured(rate, force, np.zeros(3))
    by_projection = measured(rate, force, np.zeros(3), norm=False)
    np.testing.assert_allclose(by_norm.vector[3:], 0.0, rtol=0, atol=1e-12)
    expected = GRAVITY * (1.0 - np.cos(angle))
    assert expected == pytest.approx(GRAVITY * angle**2 / 2.0, rel=angle)
    np.testing.assert_allclose(by_projection.vector[3:], expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(by_norm.horizontal, by_projection.horizontal, rtol=0, atol=1e-14)


def test_the_bias_that_the_start_shows_is_taken_out_and_told() -> None:
    earth, bias = EARTH * np.array([0.3, 0.5, -0.8]), np.array([2e-3, -1e-3, 5e-4])
    rate, force = recorded(ROWS["13"].rotations, earth, DOWN_Z)
    plain, biased = measured(rate, force, earth), measured(rate + bias, force, earth)
    np.testing.assert_allclose(biased.vector, plain.vector, rtol=0, atol=1e-13)
    np.testing.assert_allclose(biased.gyro_bias - plain.gyro_bias, bias, rtol=0, atol=1e-16)
    kept = measured(rate + bias, force, earth, start_bias=False)
    assert np.linalg.norm(kept.horizontal) > 0.05  # 1 mrad/s for some seconds of 10 m/s²


def test_signs_of_a_tilt_at_the_end_and_of_a_short_gravity() -> None:
    """Force after the turn leans to +x by 2 mrad and is 0.01 short; before it is 0.02 too long."""
    rate = np.zeros((2 * REST, 3))
    force = np.concatenate(
        [
            np.tile([0.0, 0.0, -GRAVITY - 0.02], (REST, 1)),
            np.tile([0.0196, 0.0, -GRAVITY + 0.01], (REST, 1)),
        ]
    )
    found = measured(rate, force, np.zeros(3), norm=False)
    np.testing.assert_allclose(found.vector, [0.0196, 0.0, 0.0, -0.02, 0.01], rtol=0, atol=1e-12)


@pytest.mark.parametrize("start", [(5, 5), (-1, 4), (0, 1001), (20, 10)])
def test_ranges_that_are_none_are_refused(start: tuple[int, int]) -> None:
    nothing = np.zeros((1000, 3))
    with pytest.raises(ValueError, match=f"samples {start[0]} to {start[1]} are no range of 1000 samples"):
        measure_sequence(nothing, nothing, STEP, np.zeros(3), start, (900, 1000), GRAVITY, DOWN_Z)
    with pytest.raises(ValueError, match="are no range of 1000 samples"):
        measure_sequence(nothing, nothing, STEP, np.zeros(3), (0, 10), start, GRAVITY, DOWN_Z)


def test_an_unknown_average_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(ValueError, match="'median' is none of plain, average-of-averages"):
        window_weights(10, "median")
