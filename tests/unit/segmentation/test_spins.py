"""Spins and rotations: what is found of a table's rates, what means and integrals tell, however it turned."""

from dataclasses import replace

import numpy as np
import pytest
from tests.recovery.test_matching import shortened, simulated

from tumble.earth import Site
from tumble.errors import SegmentationError
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep, TurnStep
from tumble.segmentation import find_timeline, observe_holds
from tumble.segmentation.matching import match_protocol, observe_matched_spins
from tumble.segmentation.rotations import observe_rotations
from tumble.segmentation.spin_means import observe_spins, whole_revolutions
from tumble.segmentation.turns import find_spins
from tumble.sensor import ImuModel, Triad
from tumble.simulation import TableErrors, simulate_protocol

SITE, NO_EARTH = Site.from_latitude(np.radians(41.0)), Site.from_gravity(9.81)
RATE = np.radians(41.78)  # ten thousand times the Earth's
PERIOD = 2.0 * np.pi / RATE
X, Y, Z = np.eye(3)
# Poses of the table's axis, z: up but for a tilt, level, and leaning.
TILTED, LYING = (
    Pose(np.array([0.03, 0.02, np.sqrt(1.0 - 0.0013)])),
    Pose(np.array([0.1, -np.sqrt(0.99), 0.0])),
)


def played(steps, *, rate=100.0, noise=(0.02, 0.002), seed=1, site=SITE, table=None, model=None):
    """Exact samples of a protocol, and white noise of force and rate."""
    rng, told = np.random.default_rng(seed), Protocol("spins", "turntable", tuple(steps))
    model = model or ImuModel.ideal()
    recording, truth = simulate_protocol(
        told, rate, rng, site=site, model=model, placement=False, table=table
    )
    force, turn = np.asarray(recording.specific_force), np.asarray(recording.angular_rate)
    force = force + noise[0] * rng.standard_normal(force.shape)
    turn = turn + noise[1] * rng.standard_normal(turn.shape)
    return replace(recording, specific_force=force, angular_rate=turn), truth


def spun(*rates, seconds=20.0, rest=5.0, pose=TILTED, ramp=2.0):
    spins = [(SpinStep(seconds, rate, Z, ramp=ramp), HoldStep(rest)) for rate in rates]
    return [HoldStep(rest, pose), *(step for pair in spins for step in pair)]


def assert_found(recording, truth, lost=0.4):
    """Every plateau is found, nothing of its ramps, and `lost` s at most at each end."""
    timeline = find_timeline(recording)
    assert len(timeline.holds) == len(truth.hold_edges)
    spins = find_spins(recording, timeline)
    assert len(spins) == len(truth.spins)
    for spin, true in zip(spins, truth.spins, strict=True):
        assert true.start < recording.time[spin.start] < true.start + lost
        assert true.stop - lost < recording.time[spin.stop - 1] < true.stop
        assert timeline.turns[spin.turn].start <= spin.start < spin.stop <= timeline.turns[spin.turn].stop
    return spins


@pytest.mark.parametrize(
    ("noise", "rate"), [((0.0, 0.0), 400.0), ((1e-4, 1e-6), 100.0), ((0.05, 0.005), 25.0)]
)
def test_every_rate_of_a_table_is_found(noise, rate):
    steps = spun(*(sign * np.radians(speed) for speed in (10, 60, 200) for sign in (1, -1)))
    # at 10 deg/s and 25 Hz the noise hides the last eighth of the ramp
    assert_found(*played(steps, noise=noise, rate=rate), lost=0.7)


KINDS = {
    "always the same way": spun(RATE, RATE, RATE, 2 * RATE),
    "straight to the other way": [*spun(RATE)[:2], *spun(-RATE)[1:]],
    "hardly ever at rest": spun(RATE, -RATE, seconds=300.0, rest=3.0),
    "slow": spun(np.radians(5.0), -np.radians(5.0), seconds=60.0),
    "fast, and quick to come to it": spun(5.0, seconds=8.0, ramp=0.5),
    "slow to come to it": spun(RATE, seconds=30.0, ramp=10.0),
}


@pytest.mark.parametrize("steps", KINDS.values(), ids=KINDS)
def test_spins_of_every_kind_are_found(steps):
    assert_found(*played(steps), lost=0.5)


@pytest.mark.parametrize("seconds", [0.8, 4.0, 20.0])
def test_a_turn_by_hand_has_no_plateau(seconds):
    turns = [
        TurnStep(seconds, np.array([0.8, 0.0, 0.6]), angle) for angle in (3.0, -2.0, 1.6, -3.1, 2.5, -1.8)
    ]
    steps = [HoldStep(4.0, TILTED), *(step for turn in turns for step in (turn, HoldStep(4.0)))]
    for noise in ((0.0, 0.0), (0.05, 0.005)):
        recording, _ = played(steps, noise=noise)
        timeline = find_timeline(recording)
        assert len(timeline.holds) == 7
        assert find_spins(recording, timeline) == []


def ranges(spins):
    return [(spin.start, spin.stop) for spin in spins]


@pytest.mark.parametrize(
    ("pose", "seconds"), [(TILTED, 6.0), (LYING, 6.0), (LYING, 33.3)], ids=["upright", "lying", "lying long"]
)
def test_without_noise_the_means_are_the_truth_whatever_the_window(pose, seconds):
    """6 s is 0.65 of a revolution; no window here is a whole number of samples per revolution."""
    steps = spun(RATE, -RATE, seconds=seconds, pose=pose)
    recording, truth = played(steps, noise=(0.0, 0.0), rate=97.0)
    spins = find_spins(recording, find_timeline(recording))
    means = observe_spins(recording, ranges(spins), [PERIOD, PERIOD])
    for k, spin in enumerate(truth.spins):
        along = SITE.earth_rate_n @ spin.axis_n, -SITE.gravity * spin.axis_n[2]
        # arithmetic: a fit of some thousand samples whose condition is below ten
        np.testing.assert_allclose(means.angular_rate[k], (spin.rate + along[0]) * Z, atol=1e-11)
        np.testing.assert_allclose(means.specific_force[k], along[1] * Z, atol=1e-10)


def test_a_table_off_its_nominal_rate_is_seen_by_the_phase_of_gravity():
    recording, _ = played(spun(RATE * 1.003, seconds=60.0, pose=LYING))
    means = observe_spins(recording, ranges(find_spins(recording, find_timeline(recording))), [PERIOD])
    # phase noise of 0.02 m/s² on 9.8 over 52 s: 1e-6 of the rate; five of them
    assert means.period[0] == pytest.approx(PERIOD / 1.003, rel=5e-6)
    sigma = np.sqrt(np.diagonal(means.specific_force_covariance[0]))
    # statistics: two components, 4.5 sigma; with the nominal period they would be off by 0.05 m/s²
    assert np.all(np.abs(means.specific_force[0, :2]) < 4.5 * sigma[:2])


def test_errors_of_the_means_have_their_stated_size_with_gravity_going_round():
    """Sixty spins about a lying axis: what goes round is 500 times the noise and must not be in sigma."""
    squares: list[np.ndarray] = []
    for seed in range(10):
        recording, _ = played(spun(*[RATE, -RATE] * 3, seconds=10.0, rest=3.0, pose=LYING), seed=seed)
        means = observe_spins(
            recording, ranges(find_spins(recording, find_timeline(recording))), [PERIOD] * 6
        )
        error = means.specific_force[:, :2]
        squares.append(error**2 / np.diagonal(means.specific_force_covariance, axis1=1, axis2=2)[:, :2])
    # 120 normalised errors: their mean square spreads by sqrt(2 / 120) = 0.13; four of these
    assert abs(np.mean(squares) - 1.0) < 0.52


def test_whole_revolutions_lie_in_the_middle():
    recording, _ = played([HoldStep(30.0, TILTED)])
    with pytest.raises(SegmentationError, match="no spins to average"):
        observe_spins(recording, [], [])
    with pytest.raises(SegmentationError, match="fewer than two samples"):
        observe_spins(recording, [(3, 4)], [np.nan])
    start, stop = whole_revolutions(recording, 100, 2000, 6.0)
    assert (stop - start, start - 100, 2000 - stop) == (1800, 50, 50)
    assert whole_revolutions(recording, 100, 2000, 20.0) == (100, 2000)
    assert whole_revolutions(recording, 100, 2000, float("nan")) == (100, 2000)


MATRIX = np.array([[0.99, 0.021, -0.033], [-0.014, 1.03, 0.026], [0.037, -0.018, 0.97]])
BIAS = np.array([0.002, -0.003, 0.001])
MODEL = ImuModel(Triad(np.eye(3), np.zeros(3)), Triad(MATRIX, BIAS))
TABLE_RATE = np.radians(60.0)
AXIS = np.array([0.6, 0.8, 0.0])
ARC_SECOND = np.pi / 648000.0


FULL = 2.0 * np.pi
SPINS = [
    SpinStep(FULL / TABLE_RATE - 2.0, s * TABLE_RATE, AXIS, angle=s * FULL, angle_sigma=2.0 * ARC_SECOND)
    for s in (1.0, -1.0)
]
FACES = [step for up in (X, Y) for step in (HoldStep(6.0, Pose(up, None, 0.05)), TurnStep(3.0))]
REST = HoldStep(6.0, Pose(Z, None, 0.05))
# One axis both ways, and the faces about it, so that the poses are told.
TOLD = Protocol("one axis", "turntable", (*FACES, REST, SPINS[0], REST, SPINS[1], REST))


def turned(table=None):
    return played(TOLD.steps, rate=50.0, noise=(0.0, 0.0), seed=2, site=NO_EARTH, model=MODEL, table=table)


def observed(told, recording):
    timeline = find_timeline(recording)
    means = observe_holds(recording, timeline)
    matching = match_protocol(told, recording, timeline, means)
    spins = observe_matched_spins(told, recording, matching)
    return observe_rotations(told, recording, timeline, matching, means, spins)


@pytest.mark.parametrize("spread", [0.0, 0.4])
def test_the_integral_from_rest_to_rest_is_the_angle_whatever_the_ramps(spread):
    """Samples are means over their intervals: their sum is the integral, to rounding."""
    stopped, truth = turned(TableErrors(stops_early=((0, 0.6),)))
    early = observed(replace(TOLD, steps=truth.steps), stopped)[0]
    assert early.is_from_rest
    assert early.angle == pytest.approx(0.6 * 2.0 * np.pi, rel=1e-12)
    expected = MATRIX @ (AXIS * early.angle) + BIAS * early.seconds
    np.testing.assert_allclose(early.integral, expected, rtol=0, atol=1e-11)
    recording, truth = turned(TableErrors(ramp_spread=spread))
    rotations = observed(TOLD, recording)
    ramps = [spin.ramps for spin in truth.spins]
    assert (ramps[0][0] != ramps[0][1]) == (spread > 0.0)
    for rotation, sign in zip(rotations, (1.0, -1.0), strict=True):
        assert rotation.is_from_rest
        assert rotation.angle == pytest.approx(sign * 2.0 * np.pi, rel=1e-15)
        assert rotation.angle_sigma == pytest.approx(2.0 * ARC_SECOND)
        expected = MATRIX @ (AXIS * rotation.angle) + BIAS * rotation.seconds
        np.testing.assert_allclose(rotation.integral, expected, rtol=0, atol=1e-11)


def test_without_an_angle_the_constant_rate_serves_and_it_is_said():
    recording, _ = turned()
    bare = replace(
        TOLD,
        steps=tuple(replace(s, angle=None) if isinstance(s, SpinStep) else s for s in TOLD.steps),
    )
    for rotation, sign in zip(observed(bare, recording), (1.0, -1.0), strict=True):
        assert not rotation.is_from_rest
        assert rotation.why == "no angle was read off the table"
        assert (rotation.before, rotation.after) == (None, None)
        assert rotation.angle == pytest.approx(sign * TABLE_RATE * rotation.seconds, rel=1e-12)
        expected = MATRIX @ (AXIS * rotation.angle) + BIAS * rotation.seconds
        # the spin's mean is a fit over a window whose ends are found to a sample
        np.testing.assert_allclose(rotation.integral, expected, rtol=0, atol=1e-8)


def test_no_rotation_is_integrated_across_a_gap():
    recording, _ = turned()
    middle = observed(TOLD, recording)[0].start + 60
    time, force, rate = (
        np.delete(np.asarray(one), slice(middle, middle + 8), axis=0)
        for one in (recording.time, recording.specific_force, recording.angular_rate)
    )
    torn = replace(recording, time=time, specific_force=force, angular_rate=rate)
    first, second = observed(TOLD, torn)
    assert first.why == "samples are missing for more than 0.1 s"
    assert second.is_from_rest
    expected = MATRIX @ (AXIS * first.angle) + BIAS * first.seconds
    np.testing.assert_allclose(first.integral, expected, rtol=0, atol=1e-8)


def test_ripple_counts_and_coarse_steps_do_not_matter_and_a_saturated_spin_says_so():
    recording, truth = played(spun(RATE, -RATE))
    ripple = 1.0 + 1e-3 * np.sin(2.0 * np.pi * 3.3 * recording.time)[:, None]
    force, rate = np.asarray(recording.specific_force), np.asarray(recording.angular_rate) * ripple
    counts = replace(
        recording,
        specific_force=np.round(force * 400.0 + 33_000.0),
        angular_rate=np.round(rate * 3000.0 + 32_000.0),
        specific_force_unit="counts",
        angular_rate_unit="counts",
    )
    assert_found(replace(recording, angular_rate=rate), truth)
    assert_found(counts, truth)
    blind = replace(recording, angular_rate=None)
    assert find_spins(blind, find_timeline(blind)) == []
    coarse, _ = played(spun(RATE, -RATE), noise=(0.0, 0.0))
    coarse = replace(coarse, angular_rate=np.round(np.asarray(coarse.angular_rate) / 0.01) * 0.01)
    assert all(spin.usable for spin in find_spins(coarse, find_timeline(coarse)))
    fast, _ = played(spun(RATE, 2.0 * RATE, -RATE))
    clipped = replace(fast, angular_rate=np.clip(np.asarray(fast.angular_rate), -5.0, 1.5 * RATE))
    spins = find_spins(clipped, find_timeline(clipped))
    assert [spin.usable for spin in spins] == [True, False, True]
    assert spins[1].reason == "the gyro's z axis is at its extreme value: saturated"


@pytest.mark.slow
def test_two_files_of_one_rate_are_two_spins() -> None:
    """A file a step: two recordings of the same spin lie side by side, with only a gap between them."""
    protocol = shortened("modified-multi-position")
    recording, truth = simulated(protocol)
    spin = next(n for n, step in enumerate(protocol.steps) if isinstance(step, SpinStep))
    start, stop = (int(50.0 * t) for t in truth.step_edges[spin])
    middle = (start + stop) // 2
    time = recording.time + np.where(np.arange(len(recording)) >= middle, 10.0, 0.0)
    timeline = find_timeline(parted := replace(recording, time=time, gaps=(middle,)))
    found = [s for s in find_spins(parted, timeline) if start <= s.start < stop]
    assert len(found) == 2
    assert found[0].stop <= middle <= found[1].start
