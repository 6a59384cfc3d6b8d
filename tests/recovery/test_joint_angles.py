"""A table's angle that was misread, through the joint estimator: left out, and said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.attitude.directions import twenty_six_directions
from tumble.calibration.joint import calibrate_joint
from tumble.earth import Site
from tumble.protocol.steps import HoldStep, Pose, Protocol, SpinStep, Step, TurnStep
from tumble.segmentation import find_timeline, observe_holds
from tumble.segmentation.matching import match_protocol, observe_matched_spins
from tumble.segmentation.rotations import observe_rotations
from tumble.simulation import find_grade, simulate_protocol

SITE = Site.from_latitude(0.8)
TURNED, RATE, SIGMA = 2.0 * np.pi, np.radians(60.0), 1e-5


def _protocol() -> Protocol:
    """Twelve poses by hand, then a table both ways about x and y, which lie level."""
    steps: list[Step] = []
    for up_b in twenty_six_directions()[:12]:
        steps += [TurnStep(2.0)] if steps else []
        steps.append(HoldStep(4.0, Pose(up_b, None, 0.09)))
    for axis in range(2):
        pose = Pose(np.eye(3)[2], None, 0.09)
        steps += [TurnStep(2.0), HoldStep(4.0, pose)]
        for sign in (1.0, -1.0):
            seconds = TURNED / RATE - 1.0
            spin = SpinStep(
                seconds, sign * RATE, np.eye(3)[axis], ramp=1.0, angle=sign * TURNED, angle_sigma=SIGMA
            )
            steps += [spin, HoldStep(4.0, pose)]
    return Protocol("mine", "turntable", tuple(steps))


def test_a_misread_angle_is_left_out_and_the_gyros_are_as_without_it() -> None:
    protocol = _protocol()
    recording, truth = simulate_protocol(
        *(protocol, 100.0, np.random.default_rng(6)), site=SITE, grade=find_grade("tactical")
    )
    timeline = find_timeline(recording)
    means = observe_holds(recording, timeline)
    matching = match_protocol(protocol, recording, timeline, means)
    spins = observe_matched_spins(protocol, recording, timeline, matching)
    rotations = observe_rotations(protocol, recording, timeline, matching, means, spins)
    assert len(rotations) == 4
    # Read a fifth of a degree too far.
    rotations[1] = replace(rotations[1], angle=rotations[1].angle + np.radians(0.2))
    estimate = calibrate_joint(*(recording, timeline, means, SITE), rotations=rotations, optional_terms=False)
    left_out = [left for left in estimate.left_out if left.kind == "spin"]
    assert len(left_out) == 1
    assert "misread" in left_out[0].reason
    assert truth.model is not None
    assert truth.model.gyroscope is not None
    assert estimate.model.gyroscope is not None
    at = estimate.names.index("gyroscope.matrix[0,0]")
    off = estimate.model.gyroscope.matrix[0, 0] - truth.model.gyroscope.matrix[0, 0]
    # A fifth of a degree of a turn would be 6e-4. The fixture's frame and the sensors' differ by a rotation of 1e-3.
    assert abs(off) < 4.0 * np.sqrt(estimate.covariance[at, at]) + 2e-6
