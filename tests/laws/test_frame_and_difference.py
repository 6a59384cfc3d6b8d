"""Laws of a change of frame and of differences: what they correct to, and the covariance against a simulation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from msgspec import structs

from tumble.document.difference import compare_calibrations
from tumble.document.entries import entry_names, model_of_vector, stacked, turned_to, vector_of_model
from tumble.document.imported import calibration_from_model
from tumble.document.result import Calibration, UnseenBlock
from tumble.document.thermal_block import thermal_block
from tumble.errors import UsageError
from tumble.sensor import FRAMES, ImuModel, Triad, change_frame
from tumble.sensor.thermal import TemperatureBasis, ThermalModel
from tumble.workflows.difference import verdict

M_A = np.array([[1.012, 0.004, -0.007], [-0.009, 0.991, 0.006], [0.003, -0.012, 1.021]])
M_G = np.array([[0.985, -0.011, 0.008], [0.006, 1.017, -0.004], [-0.013, 0.005, 1.008]])
G = np.array([[1.1e-3, -4e-4, 2e-4], [3e-4, -9e-4, 6e-4], [-7e-4, 5e-4, 8e-4]])
MODEL = ImuModel(Triad(M_A, np.array([0.11, -0.23, 0.34])), Triad(M_G, np.array([0.012, -0.034, 0.021])), G)
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
    return structs.replace(
        bare, **{"covariance_parameters": names, "covariance": covariance.tolist(), **update}
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
    assert turned.model.gyroscope is not None
    assert np.allclose(turned.model.gyroscope.matrix, expected.gyroscope.matrix, atol=1e-12)


@pytest.mark.parametrize("frame", FRAMES)
def test_the_covariance_in_another_frame_is_that_of_turned_draws(frame: str) -> None:
    calibration = document(MODEL)
    drawn = []
    for values in samples_of(calibration, 150, 3):
        drawn.append(vector_of_model(change_frame(model_of_vector(values, MODEL), frame)))
    assert_covariances_agree(stacked(turned_to(calibration, frame))[1], np.array(drawn))


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
    assert rows["g-sensitivity of gyro x to force y"].first == pytest.approx(-4e-4)
    assert rows["g-sensitivity of gyro x to force y"].second == 0.0
    assert abs(rows["g-sensitivity of gyro x to force x"].sigmas) > 30
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


def with_clock(model: ImuModel, rate: float | None, *, seen: bool = False) -> Calibration:
    """Gyros that share 0.58 % of a clock, nominal at `rate` or of a crystal; `seen`: determined to 20 ppm."""
    made, share = document(model), 0.0058
    along = np.zeros(45)
    assert model.gyroscope is not None
    along[18:27] = model.gyroscope.matrix.ravel()
    _, own = stacked(made)
    spread = own + (2e-5 if seen else share) ** 2 * np.outer(along, along)
    unseen = [
        UnseenBlock(
            source="sample rate",
            relative_standard_uncertainty=share,
            because="as given",
            nominal_rate_hz=rate,
        )
    ]
    return structs.replace(
        made,
        covariance_parameters=entry_names(),
        covariance=spread.tolist(),
        quality=structs.replace(made.quality, unseen=unseen),
    )


def test_one_clock_that_both_assume_is_counted_in_no_difference() -> None:
    """The change's uncertainty is that without the clock, and 0.2 % of another clock are found by it."""
    assert MODEL.gyroscope is not None
    faster = ImuModel(
        MODEL.accelerometer, Triad(1.002 * MODEL.gyroscope.matrix, MODEL.gyroscope.bias), MODEL.g_sensitivity
    )
    without = compare_calibrations(document(MODEL), document(faster))
    found = compare_calibrations(with_clock(MODEL, 100.0), with_clock(faster, 100.0))
    both = [{g.name: g for g in one.groups}["gyros: matrix"] for one in (without, found)]
    # 0.2 % of 0.58 % is no longer common.
    assert both[1].chi_square == pytest.approx(both[0].chi_square, rel=0.05)
    assert any("same nominal one" in remark for remark in found.remarks)
    for other in (
        with_clock(faster, 200.0),
        with_clock(faster, None),
        with_clock(faster, 100.0, seen=True),
    ):
        apart = compare_calibrations(with_clock(MODEL, 100.0), other)
        assert not any("same nominal one" in remark for remark in apart.remarks)
        matrix = {g.name: g for g in apart.groups}["gyros: matrix"]
        assert matrix.chi_square < both[0].chi_square / 3.0
        assert found.rate_scale is not None
        assert apart.rate_scale is not None
        assert found.rate_scale.standard_uncertainty < 0.5 * apart.rate_scale.standard_uncertainty


def test_a_plan_takes_what_is_known_from_a_calibration_in_a_fixture() -> None:
    """What a fixture's axes add is no matter of the thirty parameters: the accelerometers' own frame has the same."""
    from tumble.workflows.planning.plan import information_of

    known = [
        information_of(one).matrix for one in (document(MODEL), turned_to(document(MODEL), "accelerometer-x"))
    ]
    assert np.allclose(known[0], known[1], rtol=1e-6)
    assert np.linalg.matrix_rank(known[0]) > 20


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
    bare, other = structs.replace(first, **nothing), structs.replace(again, **nothing)
    assert not verdict(compare_calibrations(bare, other), None)[0]


def test_the_verdict_follows_the_rows() -> None:
    """What matters is significant, whatever the draw; one that nothing is known of is judged by its size."""
    calibration = document(MODEL)
    draws = samples_of(calibration, 12, 12)
    for a, b in zip(draws[:6], draws[6:], strict=True):
        found = compare_calibrations(*(document(model_of_vector(values, MODEL)) for values in (a, b)))
        matters, sentences = verdict(found, None)
        assert found.significant or not matters
        assert ("differ by more than chance" in sentences[0]) == found.significant


def thermal_model(seed: int = 3) -> ThermalModel:
    """Everything changes with temperature, by two functions; biases loop, too."""
    rng = np.random.default_rng(seed)
    terms = {
        "accelerometer.bias": 1e-3 * rng.normal(size=(2, 3)),
        "accelerometer.matrix": 1e-4 * rng.normal(size=(2, 3, 3)),
        "gyroscope.bias": 1e-4 * rng.normal(size=(2, 3)),
        "gyroscope.matrix": 1e-4 * rng.normal(size=(2, 3, 3)),
        "g_sensitivity": 1e-6 * rng.normal(size=(2, 3, 3)),
    }
    loops = {"gyroscope.bias": np.array([1e-4, -2e-4, 3e-4])}
    basis = TemperatureBasis("polynomial", 25.0, order=2)
    return ThermalModel(MODEL, basis, terms, hysteresis=loops, span_celsius=(-10.0, 60.0))


def thermal_document() -> Calibration:
    model = thermal_model()
    size = len(model.names)
    root = np.random.default_rng(8).normal(size=(size, 2 * size)) * 1e-6
    block = thermal_block(model, model.names, root @ root.T)
    return document(MODEL, thermal=block, temperature_celsius=25.0)


def test_a_calibration_with_temperature_is_turned_at_every_temperature() -> None:
    """One rotation for all: corrected vectors at any temperature and direction of the loop are turned by it."""
    calibration = thermal_document()
    turned = turned_to(calibration, "accelerometer-z")
    before, after = calibration.thermal_model, turned.thermal_model
    assert before is not None
    assert after is not None
    force, rate = before.at(25.0).correct(RAW_A, RAW_G)
    turned_force, _ = after.at(25.0).correct(RAW_A, RAW_G)
    C = np.linalg.lstsq(force, turned_force, rcond=None)[0].T
    assert np.allclose(C @ C.T, np.eye(3), atol=1e-12)
    for celsius, state in ((-10.0, 1.0), (48.0, -1.0), (60.0, 0.3)):
        force, rate = before.at(celsius, 0.0, state).correct(RAW_A, RAW_G)
        turned_force, turned_rate = after.at(celsius, 0.0, state).correct(RAW_A, RAW_G)
        assert np.allclose(turned_force, force @ C.T, rtol=0, atol=1e-12)
        assert np.allclose(turned_rate, rate @ C.T, rtol=0, atol=1e-12)


def test_the_covariance_of_coefficients_is_turned_with_them() -> None:
    """``M C^T`` is linear in the coefficients: block for block the covariance is ``E P E^T``, of Kronecker products."""
    calibration = thermal_document()
    turned = turned_to(calibration, "accelerometer-z")
    block, after = calibration.thermal, turned.thermal
    assert block is not None
    assert after is not None
    assert list(after.covariance_parameters) == list(block.covariance_parameters)
    force, _ = calibration.correct(RAW_A, RAW_G, temperature_celsius=25.0)
    turned_force, _ = turned.correct(RAW_A, RAW_G, temperature_celsius=25.0)
    C = np.linalg.lstsq(force, turned_force, rcond=None)[0].T
    assert np.degrees(np.arccos((np.trace(C) - 1) / 2)) > 0.3
    # two functions: 6 of a bias, 18 of a matrix (six rows of three); and three of the loop
    six, rows = np.eye(6), np.kron(np.eye(6), C)
    parts = (six, rows, six, rows, rows, np.eye(3))
    size, at = len(block.covariance_parameters), 0
    effect = np.zeros((size, size))
    for one in parts:
        effect[at : at + len(one), at : at + len(one)] = one
        at += len(one)
    assert at == size
    before = np.array(block.covariance)
    expected, found = effect @ before @ effect.T, np.array(after.covariance)
    assert np.allclose(found, expected, rtol=0, atol=1e-9 * np.abs(before).max())
    assert np.abs(found - before).max() > 1e-3 * np.abs(before).max()


def test_lever_arms_are_turned_with_the_frame() -> None:
    arms = ((0.003, 0.0, 0.001), (0.0, 0.004, -0.002), (0.005, 0.0, 0.012))
    calibration = document(MODEL, lever_arms=arms)
    turned = turned_to(calibration, "accelerometer-x")
    force, _ = document(MODEL).correct(RAW_A, RAW_G)
    turned_force, _ = turned_to(document(MODEL), "accelerometer-x").correct(RAW_A, RAW_G)
    C = np.linalg.lstsq(force, turned_force, rcond=None)[0].T
    assert turned.lever_arms is not None
    assert np.allclose(np.array(turned.lever_arms), np.array(arms) @ C.T, rtol=0, atol=1e-15)


@pytest.mark.parametrize("which", ["accelerometer", "gyroscope"])
def test_one_triad_alone_is_turned(which: str) -> None:
    def alone(model: ImuModel) -> ImuModel:
        return (
            ImuModel(model.accelerometer, None)
            if which == "accelerometer"
            else ImuModel(None, model.gyroscope)
        )

    first = document(alone(MODEL))
    raw = {"accelerometer": (RAW_A, None), "gyroscope": (None, RAW_G)}[which]
    at = 0 if which == "accelerometer" else 1
    true = first.correct(*raw)[at]
    frame = "accelerometer-x" if which == "accelerometer" else "mean-gyro"
    turned = turned_to(first, frame).correct(*raw)[at]
    assert np.allclose(np.linalg.norm(turned, axis=1), np.linalg.norm(true, axis=1), rtol=1e-12)
    other = "mean-gyro" if which == "accelerometer" else "accelerometer-z"
    with pytest.raises(UsageError, match="which is not calibrated"):
        turned_to(first, other)


def test_one_unit_told_in_two_units_has_not_changed() -> None:
    in_g = ImuModel(
        Triad(M_A / 9.80665, np.array([0.11, -0.23, 0.34]) / 9.80665),
        Triad(np.degrees(M_G), np.degrees(np.array([0.012, -0.034, 0.021]))),
        np.degrees(G),
    )
    calibration = calibration_from_model(
        in_g, ("g", "deg/s"), ("fixture", "axes"), [], procedure="by hand", remarks=[]
    )
    counts = structs.replace(
        calibration, raw_units=structs.replace(calibration.raw_units, angular_rate="counts")
    )
    found = compare_calibrations(document(MODEL), calibration)
    assert found.force is not None
    assert found.force.value < 1e-12
    assert found.rate_scale is not None
    assert found.rate_scale.value < 1e-12
    with pytest.raises(UsageError, match="takes rad/s, the other counts: they cannot be compared"):
        compare_calibrations(document(MODEL), counts)


def test_a_frame_that_is_unknown_or_of_a_mirrored_triad_is_refused() -> None:
    with pytest.raises(UsageError, match="There is no frame 'accelerometer-y'"):
        turned_to(document(MODEL), "accelerometer-y")
    mirrored = ImuModel(Triad(M_A @ np.diag([1.0, -1.0, 1.0]), np.zeros(3)), MODEL.gyroscope)
    with pytest.raises(UsageError, match="left-handed: an axis is reversed"):
        turned_to(document(mirrored), "accelerometer-x")


def test_frames_that_are_fixed_from_outside_are_compared_in_one_of_the_unit_s_own() -> None:
    """The same unit against a fixture and against a table that is turned by 20° about z: no change."""
    c, s = np.cos(np.radians(20.0)), np.sin(np.radians(20.0))
    C = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    assert MODEL.accelerometer is not None
    assert MODEL.gyroscope is not None
    turned = ImuModel(
        Triad(M_A @ C.T, MODEL.accelerometer.bias), Triad(M_G @ C.T, MODEL.gyroscope.bias), G @ C.T
    )
    table = calibration_from_model(
        turned, ("m/s^2", "rad/s"), ("table", "axes"), [], procedure="by hand", remarks=[]
    )
    found = compare_calibrations(document(MODEL), table)
    assert found.force is not None
    assert found.force.value < 1e-12
    assert any("both were turned to accelerometer-x" in remark for remark in found.remarks)
    warm, cold = document(MODEL, temperature_celsius=25.0), document(MODEL, temperature_celsius=-5.0)
    said = " ".join(compare_calibrations(warm, cold).remarks)
    assert "They are of 25.0 °C and -5.0 °C" in said
    with pytest.raises(UsageError, match="no triad in common"):
        compare_calibrations(
            document(ImuModel(MODEL.accelerometer, None)), document(ImuModel(None, MODEL.gyroscope))
        )
