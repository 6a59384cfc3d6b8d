"""What the gyros add up to from rest to rest is the table's angle, however it turned; otherwise the rate serves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tumble.earth import Site
from tumble.errors import SegmentationError
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep, TurnStep
from tumble.recording.recording import Recording
from tumble.segmentation import find_timeline, observe_holds
from tumble.segmentation.matching import match_protocol, observe_matched_spins
from tumble.segmentation.rotations import Rotation, observe_rotations
from tumble.sensor import ImuModel, Triad
from tumble.simulation import TableErrors, simulate_protocol
from tumble.simulation.recordings import Truth

NO_EARTH = Site.from_gravity(9.81)
MATRIX = np.array([[0.99, 0.021, -0.033], [-0.014, 1.03, 0.026], [0.037, -0.018, 0.97]])
BIAS = np.array([0.002, -0.003, 0.001])
MODEL = ImuModel(Triad(np.eye(3), np.zeros(3)), Triad(MATRIX, BIAS))
RATE = np.radians(60.0)
AXIS = np.array([0.6, 0.8, 0.0])
ARC_SECOND = np.pi / 648000.0


def protocol() -> Protocol:
    """One axis both ways, and the faces about it, so that the poses are told."""
    level = Pose(np.array([0.0, 0.0, 1.0]), None, 0.05)
    rest = HoldStep(6.0, level, "at rest")
    angle = 2.0 * np.pi
    ways = [
        SpinStep(angle / RATE - 2.0, s * RATE, AXIS, angle=s * angle, angle_sigma=2.0 * ARC_SECOND)
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


def observed(told: Protocol, recording: Recording) -> list[Rotation]:
    timeline = find_timeline(recording)
    means = observe_holds(recording, timeline)
    matching = match_protocol(told, recording, timeline, means)
    spins = observe_matched_spins(told, recording, matching)
    return observe_rotations(told, recording, timeline, matching, means, spins)


@pytest.mark.parametrize("spread", [0.0, 0.4])
def test_the_integral_from_rest_to_rest_is_the_angle_whatever_the_ramps(spread: float) -> None:
    """Samples are means over their intervals: their sum is the integral, to rounding."""
    told = protocol()
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
        assert rotation.angle == pytest.approx(sign * RATE * rotation.seconds, rel=1e-12)
        expected = MATRIX @ (AXIS * rotation.angle) + BIAS * rotation.seconds
        # the spin's mean is a fit over a window whose ends are found to a sample
        np.testing.assert_allclose(rotation.integral, expected, rtol=0, atol=1e-8)


def test_no_rotation_is_integrated_across_a_gap() -> None:
    told = protocol()
    recording, _ = played(told)
    assert recording.specific_force is not None
    assert recording.angular_rate is not None
    middle = observed(told, recording)[0].start + 60
    kept = np.ones(recording.time.size, dtype=bool)
    kept[middle : middle + 8] = False
    torn = replace(
        recording,
        time=recording.time[kept],
        specific_force=recording.specific_force[kept],
        angular_rate=recording.angular_rate[kept],
    )
    first, second = observed(told, torn)
    assert first.why == "samples are missing for more than 0.1 s"
    assert second.is_from_rest
    expected = MATRIX @ (AXIS * first.angle) + BIAS * first.seconds
    np.testing.assert_allclose(first.integral, expected, rtol=0, atol=1e-8)


def test_a_table_that_stopped_early_is_integrated_over_what_it_did() -> None:
    told = protocol()
    recording, truth = played(told, table=TableErrors(stops_early=((0, 0.6),)))
    rotation = observed(replace(told, steps=truth.steps), recording)[0]
    assert rotation.is_from_rest
    assert rotation.angle == pytest.approx(0.6 * 2.0 * np.pi, rel=1e-12)
    expected = MATRIX @ (AXIS * rotation.angle) + BIAS * rotation.seconds
    np.testing.assert_allclose(rotation.integral, expected, rtol=0, atol=1e-11)


def test_a_recording_without_a_gyro_is_refused() -> None:
    told = protocol()
    recording, _ = played(told)
    timeline = find_timeline(recording)
    means = observe_holds(recording, timeline)
    matching = match_protocol(told, recording, timeline, means)
    spins = observe_matched_spins(told, recording, matching)
    with pytest.raises(SegmentationError, match="no gyro: rotations have nothing to add up"):
        observe_rotations(told, replace(recording, angular_rate=None), timeline, matching, means, spins)
