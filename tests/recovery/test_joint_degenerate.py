"""Motions that tell too little: what is told comes out right, the rest is named, or a sentence refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from recovery.played import by_hand, jointly
from tumble.calibration import Session
from tumble.calibration.estimate import Estimate
from tumble.calibration.objections import say_of_prior
from tumble.calibration.outcome.description import canonical_names
from tumble.calibration.prior import StableKnowledge
from tumble.earth import Site
from tumble.errors import ObservabilityError
from tumble.recording import Recording
from tumble.segmentation import Timeline
from tumble.segmentation.turns import find_saturated_axis
from tumble.sensor import ImuModel, Triad

SITE = Site(9.81, 0.0, float(np.radians(48.0)), 300.0, "as simulated")
MODEL = ImuModel(
    Triad(np.array([[1.01, 0.0, 0.0], [-0.011, 0.99, 0.0], [0.013, -0.009, 1.02]]), np.array([0.11, -0.13, 0.09])),
    Triad(
        np.array([[0.99, 0.011, -0.013], [-0.014, 1.01, 0.006], [0.007, -0.018, 0.98]]),
        np.array([0.011, -0.013, 0.014]),
    ),
)  # fmt: skip


def _played(poses: Rotation) -> tuple[Recording, Timeline]:
    return by_hand(poses, MODEL, SITE)


def _calibrated(recording: Recording, timeline: Timeline, prior: StableKnowledge | None = None) -> Estimate:
    session = Session(recording, None, SITE)
    return jointly(session, timeline=timeline, prior=prior, optional_terms=False)


def _worst(estimate: Estimate) -> float:
    """The largest error of a parameter that is named, in its sigmas."""
    values: dict[str, float] = {}
    for kind in ("accelerometer", "gyroscope"):
        own, true = getattr(estimate.model, kind), getattr(MODEL, kind)
        if own is None:
            continue
        off = np.concatenate([(own.matrix - true.matrix).ravel(), own.bias - true.bias])
        names = [n for n in canonical_names(frozenset(), "full") if n.startswith(kind)]
        values |= dict(zip(names, off.tolist(), strict=True))
    sigma = np.sqrt(np.diag(estimate.covariance))
    error = np.array([values[name] for name in estimate.names])
    return float(np.max(np.abs(error[sigma > 0]) / sigma[sigma > 0]))


ANYHOW = Rotation.random(12, np.random.default_rng(2))


def test_poses_in_one_plane_and_turns_about_one_axis_leave_the_third_sensor_and_two_gyros_untold() -> None:
    about_z = Rotation.from_rotvec(np.outer(np.radians(np.arange(12) * 77.0), [0.0, 0.0, 1.0]))
    lying = Rotation.from_euler("x", 90.0, degrees=True)
    estimate = _calibrated(*_played(lying * about_z))
    # One of some twenty in a thousand is beyond 4 sigma once in a hundred recordings.
    assert _worst(estimate) < 4.0
    assert "accelerometer.matrix[0,0]" in estimate.names
    assert "gyroscope.matrix[2,2]" in estimate.names
    assert "accelerometer.matrix[2,2]" not in estimate.names
    assert "gyroscope.matrix[0,0]" not in estimate.names
    said = " ".join(estimate.not_determined)
    assert "scale factor of accelerometer z" in said
    assert "a turn about x while x lies level" in said or "a turn about y while y lies level" in said


def test_one_pose_again_and_again_is_refused() -> None:
    still = Rotation.from_quat(np.tile(ANYHOW.as_quat()[0], (6, 1)))
    with pytest.raises(ObservabilityError, match="determine nothing of the accelerometers"):
        _calibrated(*_played(still))


def test_without_a_gyro_the_accelerometers_are_calibrated_and_the_gyros_named() -> None:
    recording, timeline = _played(ANYHOW)
    estimate = _calibrated(replace(recording, angular_rate=None), timeline)
    assert _worst(estimate) < 4.0
    assert estimate.model.gyroscope is None
    assert not any(name.startswith("gyroscope") for name in estimate.names)
    assert any("recording has none" in sentence for sentence in estimate.not_determined)


def test_without_accelerometers_a_sentence_says_what_to_do() -> None:
    recording, timeline = _played(ANYHOW)
    with pytest.raises(ObservabilityError, match="no accelerometer"):
        _calibrated(replace(recording, specific_force=None), timeline)


def test_a_saturated_turn_breaks_the_section_and_harms_nothing() -> None:
    recording, timeline = _played(ANYHOW)
    assert recording.angular_rate is not None
    largest = np.max(np.abs(recording.angular_rate), axis=0)
    axis = int(np.argmax(largest))
    clipped = recording.angular_rate.copy()
    clipped[:, axis] = np.clip(clipped[:, axis], -0.85 * largest[axis], 0.85 * largest[axis])
    saturated = replace(recording, angular_rate=clipped)
    turns = tuple(
        replace(t, usable=find_saturated_axis(saturated, timeline.holds, t.start, t.stop) is None)
        for t in timeline.turns
    )
    assert [t.usable for t in turns].count(False) == 1
    estimate = _calibrated(saturated, replace(timeline, turns=turns))
    assert _worst(estimate) < 4.0
    assert any("falls into 2 parts" in remark for remark in estimate.remarks)


def test_a_prior_of_another_unit_is_objected_to_and_the_units_own_is_not() -> None:
    recording, timeline = _played(ANYHOW)
    own = _calibrated(recording, timeline)
    angles = np.array(
        [p.value for p in own.parameters if p.name.startswith("accelerometer non-orthogonality")]
    )
    for off, objected in ((np.zeros(3), False), (np.array([0.01, -0.02, 0.015]), True)):
        believed = StableKnowledge(angles + off, 1e-8 * np.eye(3))
        estimate = _calibrated(recording, timeline, believed)
        session = Session(recording, None, SITE)
        session.timeline = timeline
        say_of_prior(estimate, [session], believed)
        assert any("contradicts" in sentence for sentence in estimate.objections) == objected
