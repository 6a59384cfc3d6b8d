"""Start values, axes and lag: from nothing known to something to adjust from."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.unit.adjusted import adjusted

from tumble.calibration.checks.scores import hold_norm_errors, score_turns
from tumble.calibration.checks.triad_agreement import estimate_time_lag, refuse_contradicting_axes
from tumble.calibration.equations.triad_unknowns import rough_gyro_matrix, rough_triad
from tumble.calibration.poses import twenty_six_directions
from tumble.calibration.prior import stable_knowledge
from tumble.earth import Site
from tumble.errors import CalibrationFileError, RecordingError

# Hold means of the gyros and their covariance: the power of a unit that they are in.
MEANS = (("", 1), ("_covariance", 2))
SCALE, BIAS = np.array([1.3, 0.7, 1.1]), np.array([0.5, -1.2, 2.0])


@pytest.mark.parametrize("factor", [1.0, 412.0], ids=["SI", "counts"])
def test_a_rough_triad_is_exact_where_axes_are_perpendicular(factor: float) -> None:
    """An ellipsoid along the axes is what it fits: scale factors of 1.3 and biases of 0.2 g come out whole."""
    raw = factor * (9.81 * twenty_six_directions() * SCALE + BIAS) + (33000.0 if factor > 1.0 else 0.0)
    unknowns = rough_triad(raw, 9.81)
    np.testing.assert_allclose(unknowns[3:6], factor * SCALE, rtol=1e-9)
    np.testing.assert_allclose(
        unknowns[:3], factor * BIAS + (33000.0 if factor > 1.0 else 0.0), rtol=1e-9, atol=1e-9
    )
    np.testing.assert_array_equal(unknowns[6:], 0.0)


def test_a_rough_triad_of_six_faces_is_the_six_position_solution() -> None:
    faces = 9.81 * np.vstack([np.eye(3), -np.eye(3)]) * SCALE + BIAS
    unknowns = rough_triad(faces, 9.81)
    np.testing.assert_allclose(unknowns[3:6], SCALE, rtol=1e-9)
    np.testing.assert_allclose(unknowns[:3], BIAS, atol=1e-9)


def gyro_start(tumbled: Any, model: Any, raw_rate: np.ndarray) -> np.ndarray:
    recording = tumbled.recording
    stretches = [(turn.start, turn.stop) for turn in tumbled.timeline.turns]
    return rough_gyro_matrix(
        *(recording.time, raw_rate, recording.specific_force, model.accelerometer),
        *(np.mean(raw_rate[:300], axis=0), stretches),
    )[0]


@pytest.mark.parametrize(
    "mixing",
    [
        pytest.param(np.eye(3), id="as they are"),
        pytest.param(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]), id="axes permuted, one reversed"),
        pytest.param(4780.0 * np.diag([1.0, -1.0, 1.0]), id="counts, left-handed"),
    ],
)  # fmt: skip
def test_a_rough_gyro_matrix_needs_no_order_no_sign_and_no_scale(
    tumbled: Any, model: Any, mixing: np.ndarray
) -> None:
    """Rad/s per raw unit; within 3 % of the axes' size, whatever the columns are."""
    raw = tumbled.recording.angular_rate @ mixing.T
    found = gyro_start(tumbled, model, raw)
    expected = np.linalg.inv(mixing @ model.gyroscope.matrix)
    np.testing.assert_allclose(found, expected, atol=0.03 * np.max(np.abs(expected)))


def test_turns_about_one_axis_only_do_not_tell_the_others(tumbled: Any, model: Any) -> None:
    """The rates about y and z are taken away: the gyro's columns y and z hold nothing."""
    rate = tumbled.recording.angular_rate.copy()
    rate[:, 1:] = 0.0
    with pytest.raises(ValueError, match=r"no turn goes about its [yz] axis"):
        gyro_start(tumbled, model, rate)


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


def test_the_true_model_scores_nothing_but_noise(tumbled: Any, quiet: Any, model: Any, site: Any) -> None:
    """Without noise: the Earth turns by 7e-5 x 2 s during a turn, which a score counts as error."""
    assert np.max(np.abs(hold_norm_errors(model, quiet.means.specific_force, site.gravity))) < 1e-8
    scores = score_turns(model, quiet.data())
    assert np.nanmax(scores.angle) < 2e-4
    assert np.isnan(scores.angle[-1])
    np.testing.assert_allclose(scores.duration[:-1], 2.0, atol=0.03)
    wrong = replace(model, gyroscope=replace(model.gyroscope, matrix=1.01 * model.gyroscope.matrix))
    # 1 % of a turn of a radian and more, seen across gravity.
    assert np.sqrt(np.nanmean(score_turns(wrong, quiet.data()).angle ** 2)) > 5e-3
    assert np.nanmax(score_turns(model, tumbled.data()).angle) < 0.01


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
def test_a_unit_that_swings_round_an_elbow_is_no_gyro_of_another_unit(
    play: Any, model: Any, site: Any, unit: str, counts: float
) -> None:
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
