"""Simulated recordings: reproducible, distorted as asked, with the truth beside them."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.earth import Site
from tumble.simulation import Imperfections, Motion, poses_26, recordings, simulate_recording

SITE = Site.from_latitude(np.radians(52.0))


def motion() -> Motion:
    return Motion.between_poses(poses_26(0.2)[[1, 8, 20]], np.array([2.0, 1.5, 2.0]), np.array([1.0, 1.0]))


def test_stamps_are_the_middle_of_each_interval() -> None:
    recording, truth = simulate_recording(motion(), 10.0, np.random.default_rng(1), site=SITE)
    np.testing.assert_allclose(recording.time[:3], [0.05, 0.15, 0.25], rtol=1e-12)
    np.testing.assert_allclose(truth.hold_edges, [[0.0, 2.0], [3.0, 4.5], [5.5, 7.5]], rtol=1e-12)


def test_a_sample_that_a_turn_begins_in_is_not_of_the_hold() -> None:
    uneven = Motion.between_poses(
        poses_26(0.2)[[1, 8, 20]], np.array([2.003, 1.511, 2.0]), np.array([1.017, 0.991])
    )
    _, truth = simulate_recording(uneven, 20.0, np.random.default_rng(1), site=SITE)
    exact = truth.rotations_nb.inv().apply(SITE.earth_rate_n)
    # round-off: a sample in which a turn takes part would show some 1e-3 rad/s
    np.testing.assert_allclose(truth.angular_rate_ib_b, exact, atol=1e-16)


def test_a_long_recording_is_made_in_blocks_that_nobody_sees(monkeypatch: pytest.MonkeyPatch) -> None:
    whole, _ = simulate_recording(motion(), 100.0, np.random.default_rng(1), site=SITE)
    monkeypatch.setattr(recordings, "BLOCK", 7)
    pieces, _ = simulate_recording(motion(), 100.0, np.random.default_rng(1), site=SITE)
    assert whole.angular_rate is not None
    assert pieces.angular_rate is not None
    # vector instructions may round the last of a block otherwise than the middle of one
    np.testing.assert_allclose(pieces.angular_rate, whole.angular_rate, rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(pieces.specific_force, whole.specific_force, rtol=1e-13, atol=1e-14)


def test_a_sampling_clock_that_scatters_loses_no_angle() -> None:
    still = Site.from_gravity(9.8)
    spin = Motion.between_poses(poses_26(0.2)[[1, 8]], np.array([1.0, 1.0]), np.array([1.0]))
    edges = recordings.scatter_instants(np.arange(301) / 100.0, 100.0, 1e-3, np.random.default_rng(2))
    recording, _ = simulate_recording(
        spin, 100.0, np.random.default_rng(2), site=still, imperfections=Imperfections(sampling_jitter=1e-3)
    )
    assert recording.angular_rate is not None
    np.testing.assert_allclose(
        recording.angular_rate, spin.mean_angular_rate_ib_b(edges, still), rtol=1e-12, atol=1e-15
    )
    # the stamps tell the regular instants all the same
    np.testing.assert_allclose(recording.time, (np.arange(300) + 0.5) / 100.0, rtol=1e-12)
