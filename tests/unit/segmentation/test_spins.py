"""Spins and rotations: what is found of a table's rates, what means and integrals tell, however it turned."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.earth import Site
from tumble.errors import SegmentationError
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep, TurnStep
from tumble.recording import Recording
from tumble.segmentation import FoundSpin, find_spins, find_timeline, observe_holds, observe_spins
from tumble.segmentation.matching import match_protocol, observe_matched_spins
from tumble.segmentation.rotations import Rotation as TableRotation, observe_rotations
from tumble.segmentation.spin_means import whole_revolutions
from tumble.sensor import ImuModel, Triad
from tumble.simulation import TableErrors, Truth, simulate_protocol

SITE = Site.from_latitude(np.radians(41.0))
RATE = np.radians(41.78)  # ten thousand times the Earth's
PERIOD = 2.0 * np.pi / RATE


# x, y, z of the fixture in b: not symmetric, so that a transposed or swapped axis shows
TILT = Rotation.from_rotvec([np.pi - 0.02, 0.03, 0.0])


@dataclass(frozen=True)
class Part:
    """A hold (no rate, no angle), a turn by an angle with a minimum-jerk profile, or a spin at a rate."""

    seconds: float
    rate: float = 0.0
    angle: float = 0.0
    ramp: float = 2.0

    @property
    def duration(self) -> float:
        return self.seconds + (2.0 * self.ramp if self.rate else 0.0)

    def turned(self, time: np.ndarray) -> np.ndarray:
        """Angle after a time since the beginning of the part."""
        if not self.rate:
            x = np.clip(time / self.seconds, 0.0, 1.0)
            return self.angle * x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        up = np.clip(time / self.ramp, 0.0, 1.0)
        down = np.clip((time - self.ramp - self.seconds) / self.ramp, 0.0, 1.0)
        # the integral of the minimum-jerk profile, 10 x³ - 15 x⁴ + 6 x⁵, and what it lacks to the full rate
        grown = self.ramp * (2.5 * up**4 - 3.0 * up**5 + up**6)
        steady = np.clip(time - self.ramp, 0.0, self.seconds)
        slowed = self.ramp * (down - (2.5 * down**4 - 3.0 * down**5 + down**6))
        return self.rate * (grown + steady + slowed)


def recorded(
    parts: list[Part],
    *,
    first: Rotation = TILT,
    axis_b: tuple[float, float, float] = (0.0, 0.0, 1.0),
    rate: float = 100.0,
    noise: tuple[float, float] = (0.02, 0.002),
    ripple: float = 0.0,
    seed: int = 1,
) -> Recording:
    """One axis after another part; samples are exact increments, stamped at the middle."""
    ends = np.cumsum([0.0, *(part.duration for part in parts)])
    edges = np.arange(int(ends[-1] * rate) + 1) / rate

    def attitude(time: np.ndarray) -> Rotation:
        angle = sum(part.turned(time - start) for part, start in zip(parts, ends, strict=False))
        return first * Rotation.from_rotvec(np.asarray(angle)[:, None] * np.array(axis_b))

    middle = 0.5 * (edges[1:] + edges[:-1])
    rotation, earth = attitude(edges), Rotation.from_rotvec(SITE.earth_rate_n / rate)
    angular_rate = (rotation[:-1].inv() * earth * rotation[1:]).as_rotvec() * rate
    angular_rate = angular_rate * (1.0 + ripple * np.sin(2.0 * np.pi * 3.3 * middle))[:, None]
    force = attitude(middle).inv().apply([0.0, 0.0, -SITE.gravity])
    rng = np.random.default_rng(seed)
    return Recording(
        time=middle,
        specific_force=force + noise[0] * rng.standard_normal(force.shape),
        angular_rate=angular_rate + noise[1] * rng.standard_normal(force.shape),
        specific_force_unit="m/s^2",
        angular_rate_unit="rad/s",
        rate=rate,
    )


def spun(*rates: float, seconds: float = 20.0, rest: float = 5.0) -> list[Part]:
    return [Part(rest), *(part for rate in rates for part in (Part(seconds, rate), Part(rest)))]


def plateaus(parts: list[Part]) -> list[tuple[float, float]]:
    ends = np.cumsum([part.duration for part in parts])
    return [
        (float(end - part.ramp - part.seconds), float(end - part.ramp))
        for part, end in zip(parts, ends, strict=True)
        if part.rate
    ]


def assert_found(recording: Recording, parts: list[Part], lost: float = 0.4) -> list[FoundSpin]:
    """Every plateau is found, nothing of its ramps, and `lost` s at most at each end."""
    timeline = find_timeline(recording)
    assert len(timeline.holds) == sum(not part.rate and not part.angle for part in parts)
    spins = find_spins(recording, timeline)
    assert len(spins) == len(plateaus(parts))
    for spin, (start, stop) in zip(spins, plateaus(parts), strict=True):
        assert start < recording.time[spin.start] < start + lost
        assert stop - lost < recording.time[spin.stop - 1] < stop
        assert spin.turn is not None
        assert timeline.turns[spin.turn].start <= spin.start < spin.stop <= timeline.turns[spin.turn].stop
    return spins


@pytest.mark.parametrize(
    ("noise", "rate"), [((0.0, 0.0), 400.0), ((1e-4, 1e-6), 100.0), ((0.05, 0.005), 25.0)]
)
def test_every_rate_of_a_table_is_found(noise: tuple[float, float], rate: float) -> None:
    parts = spun(*(sign * np.radians(speed) for speed in (10, 60, 200) for sign in (1, -1)))
    # at 10 deg/s and 25 Hz the noise hides the last eighth of the ramp
    assert_found(recorded(parts, noise=noise, rate=rate), parts, lost=0.7)


@pytest.mark.parametrize(
    "parts",
    [
        pytest.param(spun(RATE, RATE, RATE, 2 * RATE), id="always the same way"),
        pytest.param(
            [Part(5.0), Part(20.0, RATE), Part(20.0, -RATE), Part(5.0)], id="straight to the other way"
        ),
        pytest.param(spun(RATE, -RATE, seconds=300.0, rest=3.0), id="hardly ever at rest"),
        pytest.param(spun(np.radians(5.0), -np.radians(5.0), seconds=60.0), id="slow"),
        pytest.param([Part(5.0), Part(8.0, 5.0, ramp=0.5), Part(5.0)], id="fast, and quick to come to it"),
        pytest.param([Part(5.0), Part(30.0, RATE, ramp=10.0), Part(5.0)], id="slow to come to it"),
    ],
)
def test_spins_of_every_kind_are_found(parts: list[Part]) -> None:
    assert_found(recorded(parts), parts, lost=0.5)


@pytest.mark.parametrize("seconds", [0.8, 4.0, 20.0])
def test_a_turn_by_hand_has_no_plateau(seconds: float) -> None:
    parts = [Part(4.0)]
    for angle in (3.0, -2.0, 1.6, -3.1, 2.5, -1.8):
        parts += [Part(seconds, angle=angle), Part(4.0)]
    for noise in ((0.0, 0.0), (0.05, 0.005)):
        recording = recorded(parts, noise=noise, axis_b=(0.8, 0.0, 0.6))
        timeline = find_timeline(recording)
        assert len(timeline.holds) == 7
        assert find_spins(recording, timeline) == []


def ranges(spins: list[FoundSpin]) -> list[tuple[int, int]]:
    return [(spin.start, spin.stop) for spin in spins]


LYING = Rotation.from_rotvec([0.5 * np.pi, 0.1, 0.0])


@pytest.mark.parametrize(
    ("first", "seconds"), [(TILT, 6.0), (LYING, 6.0), (LYING, 33.3)], ids=["upright", "lying", "lying long"]
)
def test_without_noise_the_means_are_the_truth_whatever_the_window(first: Rotation, seconds: float) -> None:
    """6 s is 0.65 of a revolution; no window here is a whole number of samples per revolution."""
    parts = spun(RATE, -RATE, seconds=seconds)
    recording = recorded(parts, first=first, noise=(0.0, 0.0), rate=97.0)
    spins = find_spins(recording, find_timeline(recording))
    means = observe_spins(recording, ranges(spins), [PERIOD, PERIOD])
    along = first.inv().apply([SITE.earth_rate_n, [0.0, 0.0, -SITE.gravity]])[:, 2]
    assert means.angular_rate is not None
    assert means.specific_force is not None
    expected = np.zeros((2, 3))
    expected[:, 2] = np.array([RATE, -RATE]) + along[0]
    # arithmetic: a fit of some thousand samples whose condition is below ten
    np.testing.assert_allclose(means.angular_rate, expected, atol=1e-11)
    np.testing.assert_allclose(means.specific_force, np.tile([0.0, 0.0, along[1]], (2, 1)), atol=1e-10)


def test_a_table_off_its_nominal_rate_is_seen_by_the_phase_of_gravity() -> None:
    recording = recorded(spun(RATE * 1.003, seconds=60.0), first=LYING)
    means = observe_spins(recording, ranges(find_spins(recording, find_timeline(recording))), [PERIOD])
    assert means.specific_force is not None
    assert means.specific_force_covariance is not None
    # phase noise of 0.02 m/s² on 9.8 over 52 s: 1e-6 of the rate; five of them
    assert means.period[0] == pytest.approx(PERIOD / 1.003, rel=5e-6)
    sigma = np.sqrt(np.diagonal(means.specific_force_covariance[0]))
    # statistics: two components, 4.5 sigma; with the nominal period they would be off by 0.05 m/s²
    assert np.all(np.abs(means.specific_force[0, :2]) < 4.5 * sigma[:2])


def test_errors_of_the_means_have_their_stated_size_with_gravity_going_round() -> None:
    """Sixty spins about a lying axis: what goes round is 500 times the noise and must not be in sigma."""
    squares: list[np.ndarray] = []
    for seed in range(10):
        recording = recorded(spun(*[RATE, -RATE] * 3, seconds=10.0, rest=3.0), first=LYING, seed=seed)
        means = observe_spins(
            recording, ranges(find_spins(recording, find_timeline(recording))), [PERIOD] * 6
        )
        assert means.specific_force is not None
        assert means.specific_force_covariance is not None
        error = means.specific_force[:, :2]
        squares.append(error**2 / np.diagonal(means.specific_force_covariance, axis1=1, axis2=2)[:, :2])
    # 120 normalised errors: their mean square spreads by sqrt(2 / 120) = 0.13; four of these
    assert abs(np.mean(squares) - 1.0) < 0.52


def test_whole_revolutions_lie_in_the_middle() -> None:
    recording = recorded([Part(30.0)])
    with pytest.raises(SegmentationError, match="no spins to average"):
        observe_spins(recording, [], [])
    with pytest.raises(SegmentationError, match="fewer than two samples"):
        observe_spins(recording, [(3, 4)], [np.nan])
    start, stop = whole_revolutions(recording, 100, 2000, 6.0)
    assert (stop - start, start - 100, 2000 - stop) == (1800, 50, 50)
    assert whole_revolutions(recording, 100, 2000, 20.0) == (100, 2000)
    assert whole_revolutions(recording, 100, 2000, float("nan")) == (100, 2000)


NO_EARTH = Site.from_gravity(9.81)
MATRIX = np.array([[0.99, 0.021, -0.033], [-0.014, 1.03, 0.026], [0.037, -0.018, 0.97]])
BIAS = np.array([0.002, -0.003, 0.001])
MODEL = ImuModel(Triad(np.eye(3), np.zeros(3)), Triad(MATRIX, BIAS))
TABLE_RATE = np.radians(60.0)
AXIS = np.array([0.6, 0.8, 0.0])
ARC_SECOND = np.pi / 648000.0


def protocol() -> Protocol:
    """One axis both ways, and the faces about it, so that the poses are told."""
    level = Pose(np.array([0.0, 0.0, 1.0]), None, 0.05)
    rest = HoldStep(6.0, level, "at rest")
    angle = 2.0 * np.pi
    ways = [
        SpinStep(
            angle / TABLE_RATE - 2.0, s * TABLE_RATE, AXIS, angle=s * angle, angle_sigma=2.0 * ARC_SECOND
        )
        for s in (1.0, -1.0)
    ]
    faces = [
        step
        for up in (np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
        for step in (HoldStep(6.0, Pose(up, None, 0.05)), TurnStep(3.0))
    ]
    return Protocol("one axis", "turntable", (*faces, rest, ways[0], rest, ways[1], rest))


def played(
    told: Protocol, *, site: Site = NO_EARTH, table: TableErrors | None = None, model: ImuModel = MODEL
) -> tuple[Recording, Truth]:
    return simulate_protocol(
        told, 50.0, np.random.default_rng(2), site=site, model=model, placement=False, table=table
    )


def observed(told: Protocol, recording: Recording) -> list[TableRotation]:
    timeline = find_timeline(recording)
    means = observe_holds(recording, timeline)
    matching = match_protocol(told, recording, timeline, means)
    spins = observe_matched_spins(told, recording, matching)
    return observe_rotations(told, recording, timeline, matching, means, spins)


@pytest.mark.parametrize("spread", [0.0, 0.4])
def test_the_integral_from_rest_to_rest_is_the_angle_whatever_the_ramps(spread: float) -> None:
    """Samples are means over their intervals: their sum is the integral, to rounding."""
    told = protocol()
    stopped, truth = played(told, table=TableErrors(stops_early=((0, 0.6),)))
    early = observed(replace(told, steps=truth.steps), stopped)[0]
    assert early.is_from_rest
    assert early.angle == pytest.approx(0.6 * 2.0 * np.pi, rel=1e-12)
    expected = MATRIX @ (AXIS * early.angle) + BIAS * early.seconds
    np.testing.assert_allclose(early.integral, expected, rtol=0, atol=1e-11)
    recording, truth = played(told, table=TableErrors(ramp_spread=spread))
    rotations = observed(told, recording)
    ramps = [spin.ramps for spin in truth.spins]
    assert (ramps[0][0] != ramps[0][1]) == (spread > 0.0)
    for rotation, sign in zip(rotations, (1.0, -1.0), strict=True):
        assert rotation.is_from_rest
        assert rotation.angle == pytest.approx(sign * 2.0 * np.pi, rel=1e-15)
        assert rotation.angle_sigma == pytest.approx(2.0 * ARC_SECOND)
        expected = MATRIX @ (AXIS * rotation.angle) + BIAS * rotation.seconds
        np.testing.assert_allclose(rotation.integral, expected, rtol=0, atol=1e-11)


def test_without_an_angle_the_constant_rate_serves_and_it_is_said() -> None:
    told = protocol()
    recording, _ = played(told)
    bare = replace(
        told,
        steps=tuple(replace(s, angle=None) if isinstance(s, SpinStep) else s for s in told.steps),
    )
    for rotation, sign in zip(observed(bare, recording), (1.0, -1.0), strict=True):
        assert not rotation.is_from_rest
        assert rotation.why == "no angle was read off the table"
        assert (rotation.before, rotation.after) == (None, None)
        assert rotation.angle == pytest.approx(sign * TABLE_RATE * rotation.seconds, rel=1e-12)
        expected = MATRIX @ (AXIS * rotation.angle) + BIAS * rotation.seconds
        # the spin's mean is a fit over a window whose ends are found to a sample
        np.testing.assert_allclose(rotation.integral, expected, rtol=0, atol=1e-8)


def test_no_rotation_is_integrated_across_a_gap() -> None:
    told = protocol()
    recording, _ = played(told)
    middle = observed(told, recording)[0].start + 60
    time, force, rate = (
        np.delete(np.asarray(one), slice(middle, middle + 8), axis=0)
        for one in (recording.time, recording.specific_force, recording.angular_rate)
    )
    torn = replace(recording, time=time, specific_force=force, angular_rate=rate)
    first, second = observed(told, torn)
    assert first.why == "samples are missing for more than 0.1 s"
    assert second.is_from_rest
    expected = MATRIX @ (AXIS * first.angle) + BIAS * first.seconds
    np.testing.assert_allclose(first.integral, expected, rtol=0, atol=1e-8)


def test_ripple_counts_and_coarse_steps_do_not_matter_and_a_saturated_spin_says_so() -> None:
    parts = spun(RATE, -RATE)
    recording = recorded(parts, ripple=1e-3)
    force, rate = np.asarray(recording.specific_force), np.asarray(recording.angular_rate)
    counts = replace(
        recording,
        specific_force=np.round(force * 400.0 + 33_000.0),
        angular_rate=np.round(rate * 3000.0 + 32_000.0),
        specific_force_unit="counts",
        angular_rate_unit="counts",
    )
    assert_found(recording, parts)
    assert_found(counts, parts)
    blind = replace(recording, angular_rate=None)
    assert find_spins(blind, find_timeline(blind)) == []
    coarse = recorded(parts, noise=(0.0, 0.0))
    coarse = replace(coarse, angular_rate=np.round(np.asarray(coarse.angular_rate) / 0.01) * 0.01)
    assert all(spin.usable for spin in find_spins(coarse, find_timeline(coarse)))
    fast = recorded(spun(RATE, 2.0 * RATE, -RATE))
    clipped = replace(fast, angular_rate=np.clip(np.asarray(fast.angular_rate), -5.0, 1.5 * RATE))
    spins = find_spins(clipped, find_timeline(clipped))
    assert [spin.usable for spin in spins] == [True, False, True]
    assert spins[1].reason == "the gyro's z axis is at its extreme value: saturated"
