"""Motions and what is recorded of them: one motion in rate, attitude and force; the chain to a file; the chamber."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.earth import Site
from tumble.protocol import HoldStep, Pose, Protocol, RampStep, SoakStep, TurnStep
from tumble.recording import Recording
from tumble.simulation import (
    Chamber,
    Motion,
    find_grade,
    find_thermal_grade,
    play_protocol,
    poses_26,
    simulate_chamber,
    simulate_recording,
)
from tumble.simulation.sampling import Imperfections, count_increments, drop_samples, scatter_instants
from tumble.simulation.trajectories import CART, ORIGIN, REST, SECTIONS, cart_trajectory
from unit.given import given, signals

SITE = Site.from_latitude(np.radians(-33.0))
STILL = Site.from_gravity(9.79)
X_UP, Y_UP, Z_UP = (Pose(axis) for axis in np.eye(3))


def by_hand(*, placement: bool = True) -> Motion:
    """Three turns between poses, off the shortest way where they are made by hand."""
    steps = [HoldStep(1.0, pose) for pose in (Z_UP, X_UP, Y_UP, Z_UP)]
    turns = [TurnStep(0.8), TurnStep(1.2), TurnStep(2.0)]
    protocol = Protocol(
        "p", "multi-position", (*(s for p in zip(steps, turns, strict=False) for s in p), steps[3])
    )
    arm = np.array([0.1, -0.05, 0.2])
    return play_protocol(protocol, np.random.default_rng(1), placement=placement, lever_arm_b=arm).motion


def test_rates_and_increments_by_hand_are_those_of_the_attitude() -> None:
    motion = by_hand()
    edges = np.linspace(0.0, motion.duration, 951)
    attitude = motion.rotation_nb(edges[:1])[0]
    mean = motion.mean_angular_rate_ib_b(edges, STILL)
    for step in Rotation.from_rotvec(mean * np.diff(edges)[:, None]):
        attitude = attitude * step
    # 950 products of rotations, each good to one unit in the last place
    assert (attitude.inv() * motion.rotation_nb(edges[-1:])[0]).magnitude() < 1e-12
    for t in np.linspace(0.2, motion.duration - 0.2, 23).tolist():
        mean = motion.mean_angular_rate_ib_b(np.array([t - 1e-4, t + 1e-4]), SITE)
        # truncation: third derivative of the attitude (some 1e3 /s³ in a detour) times step²
        np.testing.assert_allclose(motion.angular_rate_ib_b(np.array([t]), SITE), mean, atol=3e-5)


def test_acceleration_is_the_second_derivative_of_the_lever_arm_s_end() -> None:
    motion, h = by_hand(placement=False), 1e-4
    for t in (1.25, 3.3, 5.9):
        before, now, after = motion.rotation_nb(np.array([t - h, t, t + h])).apply(motion.lever_arm_b)
        acceleration = (before - 2 * now + after) / h**2
        assert np.linalg.norm(acceleration) > 0.05
        expected = motion.rotation_nb(np.array([t])).inv().apply(acceleration - [0.0, 0.0, 9.79])
        # rounding: 1e-16 / h²; truncation: fourth derivative times h² / 12
        np.testing.assert_allclose(motion.specific_force_b(np.array([t]), STILL), expected, atol=1e-5)


# Recordings ------------------------------------------------------------------------------------------


def between(first: float, second: float, *turns: float) -> Motion:
    return Motion.between_poses(poses_26(0.2)[[1, 8, 20]], np.array([first, second, 2.0]), np.array(turns))


def record(motion: Motion, rate: float, seed: int = 1, site: Site = SITE, **chain: float) -> Recording:
    imperfections = Imperfections(**chain) if chain else None
    return simulate_recording(
        motion, rate, np.random.default_rng(seed), site=site, imperfections=imperfections
    )[0]


def at_rest(seconds: float) -> Motion:
    return Motion.between_poses(poses_26(0.2)[[9]], np.array([seconds]), np.zeros(0))


def test_stamps_are_the_middle_of_each_interval_and_holds_have_no_sample_of_a_turn() -> None:
    recording, truth = simulate_recording(
        between(2.0, 1.5, 1.0, 1.0), 10.0, np.random.default_rng(1), site=SITE
    )
    np.testing.assert_allclose(recording.time[:3], [0.05, 0.15, 0.25], rtol=1e-12)
    np.testing.assert_allclose(truth.hold_edges, [[0.0, 2.0], [3.0, 4.5], [5.5, 7.5]], rtol=1e-12)
    uneven = between(2.003, 1.511, 1.017, 0.991)
    _, truth = simulate_recording(uneven, 20.0, np.random.default_rng(1), site=SITE)
    # round-off: a sample in which a turn takes part would show some 1e-3 rad/s
    exact = truth.rotations_nb.inv().apply(SITE.earth_rate_n)
    np.testing.assert_allclose(truth.angular_rate_ib_b, exact, atol=1e-16)


def test_a_long_recording_is_made_in_blocks_that_nobody_sees() -> None:
    """100,000 samples are a block: there and elsewhere it is the motion's own mean rate and force."""
    motion = between(40.0, 9.7, 1.0, 1.5)
    force, rate = signals(record(motion, 2000.0))
    edges = np.arange(len(rate) + 1) / 2000.0
    assert len(rate) > 100_000
    # vector instructions may round the last of a block otherwise than the middle of one
    np.testing.assert_allclose(rate, motion.mean_angular_rate_ib_b(edges, SITE), rtol=1e-13, atol=1e-12)
    expected = motion.specific_force_b(0.5 * (edges[1:] + edges[:-1]), SITE)
    np.testing.assert_allclose(force, expected, rtol=1e-13, atol=1e-13)


def test_a_sampling_clock_that_scatters_loses_no_angle_and_stamps_tell_the_regular_instants() -> None:
    spin = Motion.between_poses(poses_26(0.2)[[1, 8]], np.array([1.0, 1.0]), np.array([1.0]))
    recording = record(spin, 100.0, 2, STILL, sampling_jitter=1e-3)
    # the first interval begins where the recording does; no instant of these is cut at 0.45 of an interval
    edges = np.arange(301) / 100.0 + 1e-3 * np.random.default_rng(2).standard_normal(301)
    edges[0] = 0.0
    expected = spin.mean_angular_rate_ib_b(edges, STILL)
    np.testing.assert_allclose(signals(recording)[1], expected, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(recording.time, (np.arange(300) + 0.5) / 100.0, rtol=1e-12)


@pytest.mark.parametrize(
    ("motion", "angle", "velocity"),
    [(between(2.0, 1.5, 1.0, 1.0), 1e-3, 0.07), (at_rest(3600.0), 2.0**-33, 0.3048 * 2.0**-27)],
    ids=["turned", "an hour"],
)
def test_whole_increments_carry_over_what_is_left(motion: Motion, angle: float, velocity: float) -> None:
    """No sum is off by more than half a step: not even after an hour of 2⁻³³ rad."""
    exact = signals(record(motion, 20.0))
    counted = signals(record(motion, 20.0, angle_increment=angle, velocity_increment=velocity))
    for true, found, step in zip(exact, counted, (velocity, angle), strict=True):
        whole = found / (step * 20.0)
        # arithmetic: a product of a whole number and its step, divided by the step again
        np.testing.assert_allclose(whole, np.round(whole), rtol=1e-15, atol=1e-9)
        off = np.cumsum(found - true, axis=0) / 20.0
        # and the round-off of sums of 72,000 numbers
        assert np.max(np.abs(off)) <= 0.5 * step + 1e-9
    assert np.any(counted[1] != 0.0)


def test_in_counts_the_increments_are_counts_times_seconds() -> None:
    chain = Imperfections(jitter=0.1, angle_increment=2e-6, velocity_increment=3e-3).in_raw_unit(1000.0, 5e5)
    assert chain == Imperfections(jitter=0.1, angle_increment=1.0, velocity_increment=3.0)


def test_samples_are_lost_but_for_the_first_and_the_last_and_leave_gaps() -> None:
    for seed in range(50):
        kept = record(at_rest(0.6), 20.0, seed, dropped=0.5, burst=3.0)
        assert kept.time[[0, -1]] == pytest.approx([0.025, 0.575])
    kept = record(at_rest(1000.0), 20.0, dropped=0.2, burst=4.0)
    assert kept.gaps == tuple(np.flatnonzero(np.diff(kept.time) > 0.06) + 1)


# The chamber: surroundings, the unit's own temperature, and the thermometer --------------------------

TIME = np.asarray((np.arange(4000) + 0.5) * 0.5, dtype=np.float64)


def test_a_unit_follows_a_step_exponentially_and_a_ramp_by_its_time_constant() -> None:
    # From the middle of the first sample the straight line between two samples is the step.
    around = np.where(TIME < 100.0, 5.0, 25.0)
    unit = Chamber(time_constant=60.0).unit(TIME, around)
    late = TIME > 101.0
    # A step between the samples at 99.75 and 100.25 s acts as one in their middle, to (0.5 / 60)² / 24.
    expected = 5.0 + 20.0 * (1.0 - np.exp(-(TIME[late] - 100.0) / 60.0))
    np.testing.assert_allclose(unit[late], expected, atol=1e-4)
    np.testing.assert_allclose(unit[TIME < 99.0], 5.0, rtol=1e-12)
    unit, since = Chamber(time_constant=60.0).unit(TIME, 0.01 * TIME), TIME - TIME[0]
    expected = 0.01 * (TIME - 60.0 * (1.0 - np.exp(-since / 60.0)))
    np.testing.assert_allclose(unit, expected, atol=1e-11)


def test_soaks_and_ramps_make_the_surroundings() -> None:
    protocol = Protocol(
        "p", "thermal", (SoakStep(100.0, 10.0), RampStep(200.0, 10.0, 30.0), SoakStep(100.0, 20.0))
    )
    edges = np.array([[0.0, 100.0], [100.0, 300.0], [300.0, 400.0]])
    found = Chamber(rate=0.5).surroundings(protocol, edges, np.array([50.0, 150.0, 200.0, 310.0, 399.0]))
    np.testing.assert_allclose(found, [10.0, 15.0, 20.0, 25.0, 20.0], rtol=1e-12)


def test_soaks_prolong_the_hold_beside_them_and_keep_their_place() -> None:
    holds = HoldStep(10.0, X_UP), TurnStep(3.0), HoldStep(10.0, Y_UP)
    protocol = Protocol("p", "thermal", (SoakStep(60.0, 20.0), *holds, SoakStep(60.0, 40.0)))
    played = play_protocol(protocol, np.random.default_rng(1), placement=False)
    expected = [[0, 60], [60, 70], [70, 73], [73, 83], [83, 143]]
    np.testing.assert_allclose(played.step_edges, expected, rtol=1e-12)
    assert played.hold_steps == (1, 3)


def test_the_thermometer_has_steps_and_the_recording_its_temperature() -> None:
    rng = np.random.default_rng(3)
    reference = find_grade("consumer-mems").simulate_model(rng)
    thermal = find_thermal_grade("consumer-mems").simulate_model(reference, rng)
    chamber = Chamber(thermometer_noise=0.05, thermometer_resolution=0.25)
    protocol = Protocol("p", "thermal", (HoldStep(20.0, Z_UP), SoakStep(20.0, 30.0)))
    recording, _, truth = simulate_chamber(protocol, 10.0, rng, site=SITE, thermal=thermal, chamber=chamber)
    shown = given(recording.temperature)
    assert len(shown) == len(recording)
    np.testing.assert_allclose(shown / 0.25, np.round(shown / 0.25), atol=1e-9)
    assert np.max(np.abs(shown - truth.unit)) < 0.125 + 6.0 * 0.05


# Statistics of many samples: 4.5 standard deviations are allowed, a false alarm in 7e-6.
def test_the_rounding_of_increments_has_the_variance_of_a_carried_remainder() -> None:
    """The remainder is uniform over a step q: a mean over T is off by the difference of two, variance q²/6 / T².

    Rounding each sample alone would leave q² rate / (12 T), a hundred times as much here.
    """
    rng = np.random.default_rng(14)
    step, samples = 2e-4, 50
    signal = rng.uniform(-1.0, 1.0, (1, 3)) + rng.normal(0.0, 0.05, (100_000, 3))
    off = (count_increments(signal, 50.0, step) - signal).reshape(-1, samples, 3).mean(axis=1)
    duration = samples / 50.0
    ratio = np.mean(off**2) / (step**2 / 6.0 / duration**2)
    # 6000 means; neighbours share an edge, which at most doubles the variance of their mean square
    assert abs(ratio - 1.0) < 4.5 * np.sqrt(2.0 * 2.0 / off.size)


def test_the_share_and_the_length_of_what_is_lost_are_those_asked_for() -> None:
    rng = np.random.default_rng(15)
    samples, dropped, burst = 400_000, 0.08, 5.0
    lost = ~drop_samples(samples, dropped, burst, rng)
    starts = np.flatnonzero(np.diff(lost.astype(int), prepend=0) == 1)
    # number of bursts: a renewal process of about samples * dropped / burst = 6400 events
    share_spread = np.sqrt(dropped * (1 - dropped) * (2.0 * burst * (1 - dropped)) / samples)
    assert abs(lost.mean() - dropped) < 4.5 * share_spread
    lengths = lost.sum() / len(starts)
    # geometric lengths spread by √(burst (burst - 1))
    assert abs(lengths - burst) < 4.5 * np.sqrt(burst * (burst - 1.0) / len(starts))


def test_instants_scatter_as_asked_and_stay_in_order() -> None:
    edges, jitter = np.arange(100_001) / 50.0, 0.002
    scattered = scatter_instants(edges, 50.0, jitter, np.random.default_rng(16))
    off = (scattered - edges)[1:]
    assert scattered[0] == edges[0]
    assert np.all(np.diff(scatter_instants(edges, 50.0, 10.0, np.random.default_rng(16))) > 0.0)
    assert abs(np.mean(off**2) / jitter**2 - 1.0) < 4.5 * np.sqrt(2.0 / len(off))


def test_the_cart_walks_25_sections_there_and_back_after_a_minute_of_rest() -> None:
    trajectory = cart_trajectory(np.random.default_rng(1))
    time = np.arange(0.0, REST + CART, 1.0)
    states = trajectory.states(time)
    assert states.latitude[0] == pytest.approx(ORIGIN[0], abs=1e-12)
    speed = np.hypot(*states.velocity_n[:, :2].T)
    # the splines of the start reach a second back
    assert speed[time < REST - 3.0].max() < 1e-3
    walking = speed[time > REST + 5.0]
    assert 0.3 < walking.min() < walking.mean() < walking.max() < 1.8
    middles = REST + CART / SECTIONS * (np.arange(SECTIONS, dtype=np.float64) + 0.5)
    velocity = trajectory.states(middles).velocity_n[:, :2]
    cosines = np.sum(velocity[1:] * velocity[:-1], axis=1) / (speed[middles.astype(int)][1:] ** 2)
    # each section leads back beside the one before
    assert np.all(cosines < -0.7)
