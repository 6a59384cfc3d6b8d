"""Laws of calibrations computed from calibrations: what they correct to, and the covariance against a simulation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tumble.document.algebra import inverted, merged, polar_rotation, turned_to
from tumble.document.composed import compose_calibrations
from tumble.document.difference import compare_calibrations
from tumble.document.entries import entry_names, model_of_vector, stacked, vector_of_model
from tumble.document.imported import calibration_from_model
from tumble.document.merging import merge_models
from tumble.document.result import Calibration
from tumble.errors import UsageError
from tumble.sensor import FRAMES, ImuModel, Triad, change_frame
from tumble.sensor.gauge import mean_gyro_rotation
from tumble.workflows.algebra import verdict

M_A = np.array([[1.012, 0.004, -0.007], [-0.009, 0.991, 0.006], [0.003, -0.012, 1.021]])
M_G = np.array([[0.985, -0.011, 0.008], [0.006, 1.017, -0.004], [-0.013, 0.005, 1.008]])
G = np.array([[1.1e-3, -4e-4, 2e-4], [3e-4, -9e-4, 6e-4], [-7e-4, 5e-4, 8e-4]])
MODEL = ImuModel(Triad(M_A, np.array([0.11, -0.23, 0.34])), Triad(M_G, np.array([0.012, -0.034, 0.021])), G)
OTHER = ImuModel(
    Triad(M_G + 0.01 * M_A.T, np.array([-0.03, 0.05, 0.07])),
    Triad(M_A.T.copy(), np.array([0.004, 0.001, -0.002])),
    2 * G.T,
)
RAW_A = np.array([[1.0, 2.0, 9.5], [-8.0, 3.0, -4.0], [0.3, -9.9, 1.2]])
RAW_G = np.array([[0.1, -0.2, 0.3], [-1.5, 0.7, 0.2], [0.0, 2.0, -1.0]])


def document(model: ImuModel, seed: int = 1, **update: Any) -> Calibration:
    """A document with a full covariance: 1e-4 of matrices, 1e-3 of biases, all correlated."""
    bare = calibration_from_model(
        model, ("m/s^2", "rad/s"), ("fixture", "axes"), [], procedure="by hand", remarks=[]
    )
    names = [n for n in entry_names() if "asymmetry" not in n and "quadratic" not in n]
    size = np.array([1e-3 if "bias" in n else 1e-5 if "g_sens" in n else 1e-4 for n in names])
    root = np.random.default_rng(seed).normal(size=(len(names), 2 * len(names))) / np.sqrt(2 * len(names))
    covariance = (root @ root.T) * np.outer(size, size)
    return bare.model_copy(
        update={"covariance_parameters": names, "covariance": covariance.tolist(), **update}
    )


def samples_of(calibration: Calibration, count: int, seed: int) -> np.ndarray:
    values, covariance = stacked(calibration)
    return np.random.default_rng(seed).multivariate_normal(values, covariance, size=count, method="eigh")


def assert_covariances_agree(stated: np.ndarray, drawn: np.ndarray) -> None:
    """150 draws know a standard deviation to 6 % and a correlation to 0.08 (one sigma): five of these."""
    scale = np.sqrt(np.diag(stated))
    kept = scale > 1e-9
    found = np.cov(drawn.T)
    ratio = np.sqrt(np.diag(found)[kept]) / scale[kept]
    assert np.all(np.abs(ratio - 1) < 0.3)
    correlation = (found / np.outer(np.maximum(scale, 1e-30), np.maximum(scale, 1e-30)))[np.ix_(kept, kept)]
    expected = (stated / np.outer(np.maximum(scale, 1e-30), np.maximum(scale, 1e-30)))[np.ix_(kept, kept)]
    assert np.allclose(correlation, expected, atol=0.4)


@pytest.mark.parametrize("frame", FRAMES)
def test_a_change_of_frame_turns_corrected_vectors_and_nothing_else(frame: str) -> None:
    turned = turned_to(document(MODEL), frame)
    force, rate = turned.correct(RAW_A, RAW_G)
    before_force, before_rate = document(MODEL).correct(RAW_A, RAW_G)
    assert force is not None
    assert rate is not None
    assert before_force is not None
    assert before_rate is not None
    C = np.linalg.lstsq(before_force, force, rcond=None)[0].T
    assert np.allclose(C @ C.T, np.eye(3), atol=1e-12)
    assert np.allclose(before_rate @ C.T, rate, atol=1e-12)
    expected = change_frame(MODEL, frame)
    assert expected.gyroscope is not None
    assert turned.own_model.gyroscope is not None
    assert np.allclose(turned.own_model.gyroscope.matrix, expected.gyroscope.matrix, atol=1e-12)


@pytest.mark.parametrize("frame", FRAMES)
def test_the_covariance_in_another_frame_is_that_of_turned_draws(frame: str) -> None:
    calibration = document(MODEL)
    drawn = []
    for values in samples_of(calibration, 150, 3):
        drawn.append(vector_of_model(change_frame(model_of_vector(values, MODEL), frame)))
    assert_covariances_agree(stacked(turned_to(calibration, frame))[1], np.array(drawn))


def test_there_and_back_is_the_same() -> None:
    once = turned_to(document(MODEL), "accelerometer-x")
    back = turned_to(turned_to(once, "accelerometer-z"), "accelerometer-x")
    values, covariance = stacked(once)
    again, spread = stacked(back)
    assert np.allclose(again, values, atol=1e-13)
    assert np.allclose(spread, covariance, rtol=0, atol=1e-9 * covariance.max())


def test_the_polar_rotation_is_that_of_the_singular_values() -> None:
    assert np.allclose(polar_rotation(M_G), mean_gyro_rotation(M_G), atol=1e-14)


def test_the_inverse_undoes_a_calibration() -> None:
    calibration = document(MODEL)
    inverse = inverted(calibration)
    force, rate = calibration.correct(RAW_A, RAW_G)
    back = inverse.correct(force, rate)
    assert np.allclose(back[0], RAW_A, rtol=0, atol=1e-12)
    assert np.allclose(back[1], RAW_G, rtol=0, atol=1e-12)
    assert inverse.input_corrected_by == [calibration.identity]
    twice = stacked(inverted(inverse.model_copy(update={"input_corrected_by": []})))
    assert np.allclose(twice[0], stacked(calibration)[0], atol=1e-13)
    assert np.allclose(twice[1], stacked(calibration)[1], rtol=0, atol=1e-15)


def test_merged_calibrations_correct_as_one_after_another() -> None:
    first = document(MODEL)
    second = document(OTHER, 2, input_corrected_by=[first.identity])
    composed = compose_calibrations(first, second)
    one = merged(composed)
    for got, wanted in zip(one.correct(RAW_A, RAW_G), composed.correct(RAW_A, RAW_G), strict=True):
        assert np.allclose(got, wanted, rtol=0, atol=1e-12)
    drawn = []
    for a, b in zip(samples_of(first, 150, 5), samples_of(second, 150, 6), strict=True):
        drawn.append(vector_of_model(merge_models(model_of_vector(a, MODEL), model_of_vector(b, OTHER))))
    assert_covariances_agree(stacked(one)[1], np.array(drawn))


@pytest.mark.parametrize("operation", [inverted, merged])
def test_what_has_no_such_form_is_refused(operation: Any) -> None:
    bent = Triad(M_A, np.zeros(3), np.array([1e-4, 0.0, 0.0]))
    first = document(ImuModel(bent, MODEL.gyroscope))
    calibration = first
    if operation is merged:
        second = document(OTHER, 2, input_corrected_by=[first.identity])
        calibration = compose_calibrations(first, second)
    with pytest.raises(UsageError, match="asymmetry"):
        operation(calibration)


def test_two_draws_of_one_unit_differ_by_chance_alone() -> None:
    """Of 15 pairs of draws, chi-square is its degrees of freedom on average: 5 sigma of three of them are 1.05."""
    calibration = document(MODEL)
    draws = samples_of(calibration, 30, 11)
    ratios = np.zeros(5)
    for a, b in zip(draws[:15], draws[15:30], strict=True):
        pair = [document(model_of_vector(values, MODEL)) for values in (a, b)]
        found = compare_calibrations(pair[0], pair[1])
        ratios += [group.chi_square / group.degrees_of_freedom / 15 for group in found.groups]
    assert np.all(np.abs(ratios - 1) < 1.05)


def test_a_true_change_shows_with_its_size_in_another_frame_and_unit() -> None:
    """A bias moved by 0.02 m/s² on x is 20 mm/s² of every corrected force, whatever frame and unit it is told in."""
    calibration = document(MODEL)
    assert MODEL.accelerometer is not None
    moved = ImuModel(
        Triad(M_A, MODEL.accelerometer.bias + np.array([0.02, 0.0, 0.0])),
        MODEL.gyroscope,
        MODEL.g_sensitivity,
    )
    later = turned_to(document(moved), "accelerometer-x")
    found = compare_calibrations(turned_to(calibration, "accelerometer-z"), later)
    assert found.force is not None
    expected = np.linalg.norm(np.linalg.solve(M_A, [0.02, 0.0, 0.0]))
    assert found.force.value == pytest.approx(expected, rel=1e-6)
    assert found.significant
    named = {p.name: p for p in found.parameters}
    assert named["accelerometer bias x"].second - named["accelerometer bias x"].first == pytest.approx(0.02)
    assert abs(named["accelerometer bias x"].sigmas) > 10
    assert found.rate_scale is not None
    assert found.rate_scale.value < 1e-12


def test_a_term_that_only_one_has_is_listed_and_judged() -> None:
    """G-sensitivity of 1e-3 rad/s per m/s² with 1e-5 of uncertainty against none: a hundred sigmas, and it matters."""
    without = document(ImuModel(MODEL.accelerometer, MODEL.gyroscope))
    found = compare_calibrations(document(MODEL), without)
    rows = {p.name: p for p in found.parameters}
    assert rows["gyro g-sensitivity xy"].first == pytest.approx(-4e-4)
    assert rows["gyro g-sensitivity xy"].second == 0.0
    assert abs(rows["gyro g-sensitivity xx"].sigmas) > 30
    assert next(g for g in found.groups if g.name == "gyros: g-sensitivity").probability < 1e-12
    assert any("Only the first has gyroscope g-sensitivity" in remark for remark in found.remarks)
    assert found.significant
    assert verdict(found, None)[0]


def test_asymmetry_and_quadratic_terms_are_in_rows_and_effect() -> None:
    """An asymmetry of 1e-3 on a unit matrix alone: 1 mg of a force of 1 g along that axis."""
    unit = Triad(np.eye(3), np.zeros(3))
    bent = Triad(np.eye(3), np.zeros(3), asymmetry=np.array([0.0, 1e-3, 0.0]))
    found = compare_calibrations(document(ImuModel(unit, None)), document(ImuModel(bent, None)))
    assert found.force is not None
    assert found.force.value == pytest.approx(9.80665e-3, rel=1e-9)
    assert {p.name: p.second for p in found.parameters}["accelerometer asymmetry y"] == 1e-3


def test_rounding_is_no_change() -> None:
    """Turned there and back: zeros of the frame come back as 1e-18 with an uncertainty as small."""
    first = turned_to(document(MODEL), "accelerometer-x")
    again = turned_to(turned_to(first, "accelerometer-z"), "accelerometer-x")
    found = compare_calibrations(first, again)
    assert all(np.isnan(p.sigmas) or abs(p.sigmas) < 1e-6 for p in found.parameters)
    assert all(p.first == p.second for p in found.parameters if p.name == "accelerometer misalignment xy")
    assert not found.significant
    assert not verdict(found, None)[0]
    nothing = {"covariance_parameters": [], "covariance": []}
    bare, other = first.model_copy(update=nothing), again.model_copy(update=nothing)
    assert not verdict(compare_calibrations(bare, other), None)[0]


def test_the_verdict_follows_the_rows() -> None:
    """What matters is significant, whatever the draw; one that nothing is known of is judged by its size."""
    calibration = document(MODEL)
    draws = samples_of(calibration, 40, 12)
    for a, b in zip(draws[:20], draws[20:], strict=True):
        found = compare_calibrations(*(document(model_of_vector(values, MODEL)) for values in (a, b)))
        matters, sentences = verdict(found, None)
        assert found.significant or not matters
        assert ("differ by more than chance" in sentences[0]) == found.significant
