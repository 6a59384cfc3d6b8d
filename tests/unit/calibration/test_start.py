"""Start values, axes, lag and place: from nothing known to something to adjust from."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.unit.adjusted import adjusted

from tumble.calibration.checks.scores import score_turns
from tumble.calibration.checks.triad_agreement import estimate_time_lag, refuse_contradicting_axes
from tumble.calibration.equations.gathering import gather
from tumble.calibration.prior import stable_knowledge
from tumble.calibration.session import Session
from tumble.earth import Site
from tumble.errors import CalibrationFileError, RecordingError, SiteError
from tumble.protocol import named_protocol
from tumble.recording import Recording
from tumble.segmentation import find_timeline, observe_holds
from tumble.simulation import Motion, find_grade, poses_26, simulate_recording

# Hold means of the gyros and their covariance: the power of a unit that they are in.
MEANS = (("", 1), ("_covariance", 2))


def test_a_contradiction_of_axes_or_units_is_told(tumbled: Any) -> None:
    recording = tumbled.recording
    refuse_contradicting_axes(recording, np.eye(3) + 0.02)
    with pytest.raises(RecordingError, match="gx, gy, -gz"):
        refuse_contradicting_axes(recording, np.diag([1.0, 1.0, -1.0]))
    with pytest.raises(RecordingError, match=r"deg/s"):
        refuse_contradicting_axes(recording, np.eye(3) * np.pi / 180.0)
    counts = replace(recording, angular_rate_unit="counts")
    refuse_contradicting_axes(counts, np.eye(3) / 4780.0)


def test_gyros_of_too_few_turns_are_not_fit(tumbled: Any) -> None:
    few = tumbled.without_turns(*range(4, len(tumbled.timeline.turns)))
    estimate = adjusted(few.recording, few.timeline, Site.from_gravity(9.81), few.means)
    assert any("does not determine all of the gyros" in said for said in estimate.objections)


@pytest.mark.parametrize("lag", [0.012, -0.02, 0.0])
def test_a_lag_between_the_triads_is_found_with_its_sign(play: Any, model: Any, lag: float) -> None:
    """At each stamp the accelerometer shows what was `lag` before, the gyro what is."""
    tumbled = play(holds=14)
    recording = tumbled.recording
    # f sampled later by `lag`: at stamp t stands what belongs to t - lag of an accelerometer in time.
    late = np.column_stack(
        [
            np.interp(recording.time - lag, recording.time, recording.specific_force[:, axis])
            for axis in range(3)
        ]
    )
    found = estimate_time_lag(replace(tumbled.data(), raw_force=late), model)
    assert found.lag == pytest.approx(lag, abs=4.0 * found.sigma)
    assert found.sigma < 0.003


def test_too_few_turns_tell_no_lag(play: Any, model: Any) -> None:
    assert estimate_time_lag(play(holds=5).data(), model) is None


def test_a_prior_is_the_angles_of_the_matrix_with_their_covariance() -> None:
    """sin(yz) = 0.01 for a unit row; a relative error of the scale moves no angle."""
    matrix = np.array([[1.0, 0.0, 0.0], [-0.01, np.sqrt(1.0 - 1e-4), 0.0], [0.0, 0.0, 1.0]])
    covariance = 1e-8 * np.eye(9)
    known = stable_knowledge(matrix, covariance)
    np.testing.assert_allclose(known.angles, [np.arcsin(0.01), 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(np.sqrt(np.diag(known.angle_covariance)), 1e-4, rtol=0.5)
    counts = stable_knowledge(400.0 * matrix, 400.0**2 * covariance)
    np.testing.assert_allclose(counts.angle_covariance, known.angle_covariance, rtol=1e-9)
    with pytest.raises(CalibrationFileError, match="no uncertainty"):
        stable_knowledge(matrix, np.zeros((9, 9)))


@pytest.mark.parametrize(("unit", "counts"), [("rad/s", 1.0), ("counts", 4780.0)])
def test_a_unit_that_swings_round_an_elbow_is_no_gyro_of_another_unit(play, model, site, unit, counts):
    """Turned by 126° in 2 s at an arm of 1.3 m, as by 250° in 1 s at 8 cm: accelerations as large as gravity.

    A rigid body: ω × (ω × r) + dω/dt × r, with r and ω in b.
    """
    tumbled = play(holds=20)
    recording = tumbled.recording
    arm, rate = np.array([0.9, -0.6, 0.75]), model.gyroscope.correct(recording.angular_rate)
    smooth = np.column_stack([np.convolve(rate[:, axis], np.ones(9) / 9.0, "same") for axis in range(3)])
    swing = np.cross(smooth, np.cross(smooth, arm)) + np.cross(
        np.gradient(smooth, recording.time, axis=0), arm
    )
    for hold in tumbled.timeline.holds:
        swing[hold.start : hold.stop] = 0.0
    raw = {
        "specific_force": recording.specific_force + swing @ model.accelerometer.matrix.T,
        "angular_rate": counts * recording.angular_rate,
        "angular_rate_unit": unit,
    }
    swung = replace(recording, **raw)
    held = {
        f"angular_rate{end}": counts**n * getattr(tumbled.means, f"angular_rate{end}") for end, n in MEANS
    }
    found = adjusted(swung, tumbled.timeline, site, replace(tumbled.means, **held)).model.gyroscope
    np.testing.assert_allclose(found.matrix / counts, model.gyroscope.matrix, atol=0.005)


def test_turns_of_gyros_whose_two_ways_differ_are_scored_by_the_model_that_says_so() -> None:
    """One per cent of a turn of 90° is most of a degree; what the sensors' noise leaves is a tenth."""
    site, grade = Site.from_latitude(0.8), find_grade("consumer-mems")
    rng = np.random.default_rng(6)
    headings = Rotation.from_rotvec(np.outer(rng.uniform(0.0, 6.28, 12), [0.0, 0.0, 1.0]))
    motion = Motion.between_poses(headings * poses_26()[:12], np.full(12, 4.0), np.full(11, 2.0))
    model = grade.simulate_model(np.random.default_rng(9))
    plain = replace(model, gyroscope=replace(model.gyroscope, asymmetry=None))
    crooked = replace(model, gyroscope=replace(model.gyroscope, asymmetry=np.array([0.01, -0.012, 0.008])))
    recording, _ = simulate_recording(motion, 50.0, rng, site=site, grade=grade, distort=crooked.distort)
    timeline = find_timeline(recording)
    data = gather(recording, timeline, observe_holds(recording, timeline))

    def missed(of: object) -> float:
        return float(np.degrees(np.sqrt(np.nanmean(score_turns(of, data).angle ** 2))))  # type: ignore[arg-type]

    assert missed(crooked) < 0.2
    assert missed(plain) > 3.0 * missed(crooked)


def session(gravity: float) -> Session:
    """Of a protocol at 48°, with a gravity that the user gives."""
    rows = np.zeros((4, 3))
    recording = Recording(
        time=np.arange(4.0),
        specific_force=rows,
        angular_rate=None,
        specific_force_unit="m/s²",
        angular_rate_unit="rad/s",
        rate=1.0,
    )
    protocol = replace(named_protocol("six-position"), site=Site.from_latitude(np.radians(48.0), 520.0))
    return Session(recording, protocol, given_site=Site.from_gravity(gravity))


def test_a_gravity_beside_the_protocol_s_latitude_keeps_the_latitude() -> None:
    site = session(9.8073).site
    assert (site.gravity, site.height) == (9.8073, 520.0)
    assert site.gravity_sigma == pytest.approx(0.00005 / 3**0.5)
    assert site.latitude == np.radians(48.0)


def test_a_gravity_that_contradicts_the_protocol_s_latitude_is_refused() -> None:
    with pytest.raises(SiteError, match="contradicts the latitude 48°"):
        _ = session(9.85).site
