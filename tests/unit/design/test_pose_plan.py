"""Plans of poses: noise that holds share, the order, the time, the next pose, and when to stop."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.attitude.directions import twenty_six_directions
from tumble.design.candidates import pose_rows
from tumble.design.hold_noise import hold_covariance, predict_covariance
from tumble.design.next_pose import find_next_poses, judge_stop, known_from_holds, sigmas_so_far
from tumble.design.pose_order import shortest_order
from tumble.design.pose_plan import PoseTask, plan_of, plan_poses, plan_schemes, plan_time, require_seen
from tumble.errors import ObservabilityError, UsageError
from tumble.protocol.library import NINE
from tumble.simulation.noise import TriadNoise, simulate_noise

CUBE, ALL = twenty_six_directions(), np.arange(9)
WHITE = TriadNoise(random_walk=2e-3)
WANDERING = TriadNoise(random_walk=3e-4, bias_instability=5e-4)


def task(noise: TriadNoise = WHITE) -> PoseTask:
    return PoseTask(noise)


@pytest.mark.parametrize(
    "noise", [TriadNoise(bias_instability=1.0), TriadNoise(rate_random_walk=1.0), TriadNoise(random_walk=1.0)]
)
def test_the_noise_that_holds_share_is_what_the_simulator_plays(noise: TriadNoise) -> None:
    """1,200 draws of three axes: a variance is good to 2.4 %, four of these are allowed."""
    times, rng = np.array([[0.0, 30.0], [33.0, 63.0], [66.0, 96.0], [99.0, 140.0]]), np.random.default_rng(3)
    drawn: list[np.ndarray] = []
    for _ in range(1200):
        played = simulate_noise(noise, 1400, 10.0, rng)
        means = np.array([played[int(10 * a) : int(10 * b)].mean(axis=0) for a, b in times])
        drawn.append(means - (played.mean(axis=0) if noise.wanders else 0.0))
    seen = np.concatenate([one.T for one in drawn])
    expected = hold_covariance(times, noise, 10.0)
    limit = 0.1 * np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert np.all(np.abs(seen.T @ seen / len(seen) - expected) < limit)


def test_with_white_noise_the_prediction_is_the_bound_of_norms_at_rest() -> None:
    dwell = 40.0
    plan = plan_of("nine", task(), CUBE[list(NINE)], np.full(9, dwell))
    sigma = WHITE.random_walk / np.sqrt(dwell) / task().gravity
    # A face up and down: mean and half the difference. An edge: its own twice, and four others (docs/poses.md).
    expected = sigma * np.sqrt(np.repeat([0.5, 7.0, 0.5], 3))
    np.testing.assert_allclose(plan.sigmas, expected, rtol=1e-6)


def test_a_common_wander_of_all_holds_is_in_the_biases_alone() -> None:
    """Where one constant is added to all holds' means, it is the bias of that session and no error of the others."""
    directions = twenty_six_directions()
    covariance = predict_covariance(
        pose_rows(directions), directions, np.full((26, 26), 4.0) + 1e-9 * np.eye(26)
    )
    np.testing.assert_allclose(np.diag(covariance)[:6], 0.0, atol=1e-6)
    np.testing.assert_allclose(np.diag(covariance)[6:], 4.0, rtol=1e-6)


def test_a_good_order_lessens_what_a_wandering_bias_does() -> None:
    found = plan_poses(task(WANDERING), 18, 30.0, np.random.default_rng(1))
    order = shortest_order(found.directions)
    shortest = plan_of("shortest", task(WANDERING), found.directions[order], found.dwells)
    assert found.value < 0.7 * shortest.value
    # Two holds in one pose, one after the other, would be one hold.
    assert np.all(np.sum(found.directions[1:] * found.directions[:-1], axis=1) < np.cos(np.radians(10.0)))


def test_a_plan_of_a_given_time_lasts_so_long_and_is_no_worse_than_any_scheme() -> None:
    """5 %: among plans so close to each other the one with the fewest poses is taken."""
    for noise in (WHITE, WANDERING):
        found = plan_time(task(noise), 150.0, np.random.default_rng(1))
        assert found.duration == pytest.approx(150.0, abs=3.0)  # dwells are rounded to tenths of a second
        schemes = plan_schemes(task(noise), 150.0)
        assert isinstance(schemes["six faces"], str)
        assert all(isinstance(one, str) or found.value <= 1.05 * one.value for one in schemes.values())


def test_poses_that_do_not_tell_are_refused_in_words() -> None:
    with pytest.raises(
        ObservabilityError, match=r"8 poses do not determine the non-orthogonality of y to z\. Add edge"
    ):
        require_seen(CUBE[[0, 1, 2, 3, 4, 5, 6, 8]], ALL)
    # Six faces do tell the biases and scale factors.
    require_seen(CUBE[:6], np.array([0, 1, 2, 6, 7, 8]))
    with pytest.raises(ObservabilityError, match="8 poses determine 8 numbers"):
        plan_poses(task(), 8, 30.0, np.random.default_rng(0))
    with pytest.raises(UsageError, match="too short for the 9 poses"):
        plan_time(task(), 30.0, np.random.default_rng(0))


def test_the_next_pose_is_the_one_that_helps_most() -> None:
    """By trying all 26: after the six faces, then after each pose that was named."""
    covariances = np.tile(np.diag([1e-8, 2e-8, 3e-8]), (6, 1, 1))
    known = known_from_holds(CUBE[:6], covariances, 9.8)
    assert np.array_equal(np.isfinite(sigmas_so_far(known)), [True] * 3 + [False] * 3 + [True] * 3)
    following = find_next_poses(known, CUBE, 1e-5, ALL, count=3)
    total = known + np.eye(9) / 0.09
    for one in following:
        tried = [total + np.outer(row, row) / 1e-10 for row in pose_rows(CUBE)]
        best = min(float(np.mean(np.diag(np.linalg.inv(trial)))) for trial in tried)
        assert one.value == pytest.approx(best, rel=1e-6)
        row = pose_rows(one.up_b[None])[0]
        total = total + np.outer(row, row) / 1e-10
    # Three poses that are no faces, and then everything is told.
    assert np.all(following[-1].sigmas < 1e-3)


def test_when_to_stop_is_said() -> None:
    noise, wanted = WANDERING, np.arange(9)
    sigmas = np.full(9, 2e-5)
    following = find_next_poses(np.diag(1.0 / sigmas**2), CUBE, 1e-4, ALL)
    stop, words = judge_stop(sigmas, following, {"bias": 3e-4}, noise, 9.8, wanted)
    assert stop
    assert words == ["All targets are reached: stop here."]
    stop, words = judge_stop(sigmas, following, {"bias": 1e-4}, noise, 9.8, wanted)
    assert not stop
    assert "bias x" in words[0]
    # Biases known to a tenth of what they wander, and holds that are five times as noisy as what is known.
    stop, words = judge_stop(np.full(9, 3e-6), [], {}, noise, 9.8, wanted)
    assert any("wander" in word for word in words)
    following = find_next_poses(np.diag(1.0 / sigmas**2), CUBE, 1e-3, ALL)
    stop, words = judge_stop(sigmas, following, {}, noise, 9.8, wanted)
    assert stop
    assert "hardly worth" in words[-1]
    untold = sigmas_so_far(np.zeros((9, 9)))
    assert judge_stop(untold, [], {}, noise, 9.8, wanted)[1][0].startswith(
        "Not determined yet: scale factor x"
    )
