"""Laws of a change of frame and of differences: what they correct to, and the covariance against a simulation."""

from typing import Any

import numpy as np
import pytest
from msgspec import structs
from tests.unit.export.a_unit import B_A, B_G, M_A, M_G, RAW_A, RAW_G, G

from tumble.document import (
    Calibration,
    calibration_from_model,
    compare_calibrations,
    entry_names,
    model_of_vector,
    read_part,
    stacked,
    thermal_block,
    turned_to,
    vector_of_model,
)
from tumble.errors import UsageError
from tumble.sensor import FRAMES, ImuModel, TemperatureBasis, ThermalModel, Triad, change_frame
from tumble.workflows import verdict

FORCE, GYRO = Triad(M_A, B_A), Triad(M_G, B_G)
MODEL = ImuModel(FORCE, GYRO, G)


def bare(model: ImuModel, units: tuple[str, str] = ("m/s^2", "rad/s"), frame: str = "fixture") -> Calibration:
    return calibration_from_model(model, units, (frame, "axes"), [], procedure="by hand", remarks=[])


def document(model: ImuModel = MODEL, seed: int = 1, **update: Any) -> Calibration:
    """A document with a full covariance: 1e-4 of matrices, 1e-3 of biases, all correlated."""
    names = [n for n in entry_names() if "asymmetry" not in n and "quadratic" not in n]
    size = np.array([1e-3 if "bias" in n else 1e-5 if "g_sens" in n else 1e-4 for n in names])
    root = np.random.default_rng(seed).normal(size=(len(names), 2 * len(names))) / np.sqrt(2 * len(names))
    covariance = (root @ root.T) * np.outer(size, size)
    known = {"covariance_parameters": names, "covariance": covariance.tolist()}
    return structs.replace(bare(model), **known | update)


def samples_of(calibration: Calibration, count: int, seed: int) -> np.ndarray:
    values, covariance = stacked(calibration)
    return np.random.default_rng(seed).multivariate_normal(values, covariance, size=count, method="eigh")


def turn_between(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """The rotation C with ``after = before C'``."""
    C = np.linalg.lstsq(before, after, rcond=None)[0].T
    assert np.allclose(C @ C.T, np.eye(3), atol=1e-12)
    return C


def turn_to(frame: str) -> np.ndarray:
    """The rotation of all corrected vectors of the model to a frame."""
    return turn_between(
        document().correct(RAW_A, RAW_G)[0], turned_to(document(), frame).correct(RAW_A, RAW_G)[0]
    )


@pytest.mark.parametrize("frame", FRAMES)
def test_a_change_of_frame_turns_corrected_vectors_and_nothing_else(frame: str) -> None:
    C, turned = turn_to(frame), turned_to(document(), frame)
    assert np.allclose(document().correct(RAW_A, RAW_G)[1] @ C.T, turned.correct(RAW_A, RAW_G)[1], atol=1e-12)
    expected = change_frame(MODEL, frame).correct(RAW_A, RAW_G)
    assert np.allclose(turned.correct(RAW_A, RAW_G), expected, atol=1e-12)


@pytest.mark.parametrize("frame", FRAMES)
def test_the_covariance_in_another_frame_is_that_of_turned_draws(frame: str) -> None:
    """150 draws know a standard deviation to 6 % and a correlation to 0.08 (one sigma): five of these."""
    values = samples_of(document(), 150, 3)
    drawn = np.cov(
        np.array([vector_of_model(change_frame(model_of_vector(v, MODEL), frame)) for v in values]).T
    )
    stated = stacked(turned_to(document(), frame))[1]
    kept = np.sqrt(np.diag(stated)) > 1e-9
    stated, drawn = stated[np.ix_(kept, kept)], drawn[np.ix_(kept, kept)]
    scale = np.sqrt(np.diag(stated))
    assert np.all(np.abs(np.sqrt(np.diag(drawn)) / scale - 1) < 0.3)
    assert np.allclose(drawn / np.outer(scale, scale), stated / np.outer(scale, scale), atol=0.4)


def test_two_draws_of_one_unit_differ_by_chance_alone_and_the_verdict_follows_the_rows() -> None:
    """Of 15 pairs of draws, chi-square is its degrees of freedom on average: 5 sigma of three of them are 1.05.

    What matters is significant, whatever the draw; one that nothing is known of is judged by its size.
    """
    draws = samples_of(document(), 30, 11)
    ratios = np.zeros(5)
    for a, b in zip(draws[:15], draws[15:30], strict=True):
        found = compare_calibrations(*(document(model_of_vector(values, MODEL)) for values in (a, b)))
        ratios += [group.chi_square / group.degrees_of_freedom / 15 for group in found.groups]
        matters, sentences = verdict(found, None)
        assert found.significant or not matters
        assert ("differ by more than chance" in sentences[0]) == found.significant
    assert np.all(np.abs(ratios - 1) < 1.05)


def test_a_true_change_shows_with_its_size_in_another_frame_and_unit() -> None:
    """A bias moved by 0.02 m/s² on x is 20 mm/s² of every corrected force, whatever frame and unit it is told in."""
    moved = ImuModel(Triad(M_A, B_A + np.array([0.02, 0.0, 0.0])), GYRO, G)
    later = turned_to(document(moved), "accelerometer-x")
    found = compare_calibrations(turned_to(document(), "accelerometer-z"), later)
    expected = np.linalg.norm(np.linalg.solve(M_A, [0.02, 0.0, 0.0]))
    assert found.force.value == pytest.approx(expected, rel=1e-6)
    assert found.significant
    bias = {p.name: p for p in found.parameters}["accelerometer bias x"]
    assert bias.second - bias.first == pytest.approx(0.02)
    assert abs(bias.sigmas) > 10
    assert found.rate_scale.value < 1e-12


def test_a_term_that_only_one_has_is_listed_and_judged() -> None:
    """G-sensitivity of 1e-3 rad/s per m/s² with 1e-5 of uncertainty against none: a hundred sigmas, and it matters."""
    found = compare_calibrations(document(), document(ImuModel(FORCE, GYRO)))
    rows = {p.name: p for p in found.parameters}
    row = rows["g-sensitivity of gyro x to force y"]
    assert (row.first, row.second) == (pytest.approx(-4e-4), 0.0)
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
    assert found.force.value == pytest.approx(9.80665e-3, rel=1e-9)
    assert {p.name: p.second for p in found.parameters}["accelerometer asymmetry y"] == 1e-3


def with_clock(model: ImuModel, rate: float | None, *, seen: bool = False) -> Calibration:
    """Gyros that share 0.58 % of a clock, nominal at `rate` or of a crystal; `seen`: determined to 20 ppm."""
    made, share = document(model), 0.0058
    along = np.zeros(45)
    along[18:27] = model.gyroscope.matrix.ravel()
    spread = stacked(made)[1] + (2e-5 if seen else share) ** 2 * np.outer(along, along)
    numbers = {"relative_standard_uncertainty": share, "nominal_rate_hz": rate}
    unseen = [{"source": "sample rate", "because": "as given", **numbers}]
    quality = read_part(type(made.quality), {**structs.asdict(made.quality), "unseen": unseen})
    known = {"covariance_parameters": entry_names(), "covariance": spread.tolist()}
    return structs.replace(made, **known, quality=quality)


def test_one_clock_that_both_assume_is_counted_in_no_difference() -> None:
    """The change's uncertainty is that without the clock, and 0.2 % of another clock are found by it."""
    faster = ImuModel(FORCE, Triad(1.002 * M_G, B_G), G)
    same = "same nominal one"
    without = compare_calibrations(document(), document(faster))
    found = compare_calibrations(with_clock(MODEL, 100.0), with_clock(faster, 100.0))
    both = [{g.name: g for g in one.groups}["gyros: matrix"] for one in (without, found)]
    # 0.2 % of 0.58 % is no longer common.
    assert both[1].chi_square == pytest.approx(both[0].chi_square, rel=0.05)
    assert any(same in remark for remark in found.remarks)
    for other in (with_clock(faster, 200.0), with_clock(faster, None), with_clock(faster, 100.0, seen=True)):
        apart = compare_calibrations(with_clock(MODEL, 100.0), other)
        assert not any(same in remark for remark in apart.remarks)
        assert {g.name: g for g in apart.groups}["gyros: matrix"].chi_square < both[0].chi_square / 3.0
        assert found.rate_scale.standard_uncertainty < 0.5 * apart.rate_scale.standard_uncertainty


def test_rounding_is_no_change() -> None:
    """Turned there and back: zeros of the frame come back as 1e-18 with an uncertainty as small."""
    first = turned_to(document(), "accelerometer-x")
    again = turned_to(turned_to(first, "accelerometer-z"), "accelerometer-x")
    found = compare_calibrations(first, again)
    assert all(np.isnan(p.sigmas) or abs(p.sigmas) < 1e-6 for p in found.parameters)
    assert all(p.first == p.second for p in found.parameters if p.name == "accelerometer misalignment xy")
    assert not found.significant
    assert not verdict(found, None)[0]
    nothing = {"covariance_parameters": [], "covariance": []}
    plain, other = structs.replace(first, **nothing), structs.replace(again, **nothing)
    assert not verdict(compare_calibrations(plain, other), None)[0]


def thermal_document() -> Calibration:
    """Everything changes with temperature, by two functions; biases loop, too."""
    rng = np.random.default_rng(3)
    sizes = {"accelerometer.bias": 1e-3, "accelerometer.matrix": 1e-4, "gyroscope.bias": 1e-4}
    sizes |= {"gyroscope.matrix": 1e-4, "g_sensitivity": 1e-6}
    terms = {n: s * rng.normal(size=(2, 3) if "bias" in n else (2, 3, 3)) for n, s in sizes.items()}
    loops = {"gyroscope.bias": np.array([1e-4, -2e-4, 3e-4])}
    basis = TemperatureBasis("polynomial", 25.0, order=2)
    model = ThermalModel(MODEL, basis, terms, hysteresis=loops, span_celsius=(-10.0, 60.0))
    size = len(model.names)
    root = np.random.default_rng(8).normal(size=(size, 2 * size)) * 1e-6
    return document(thermal=thermal_block(model, model.names, root @ root.T), temperature_celsius=25.0)


def test_a_calibration_with_temperature_is_turned_at_every_temperature() -> None:
    """One rotation for all: corrected vectors at any temperature and direction of the loop are turned by it."""
    before, after = (
        thermal_document().thermal_model,
        turned_to(thermal_document(), "accelerometer-z").thermal_model,
    )
    C = turn_between(before.at(25.0).correct(RAW_A, RAW_G)[0], after.at(25.0).correct(RAW_A, RAW_G)[0])
    for at in ((-10.0, 0.0, 1.0), (48.0, 0.0, -1.0), (60.0, 0.0, 0.3)):
        expected = np.array(before.at(*at).correct(RAW_A, RAW_G)) @ C.T
        assert np.allclose(after.at(*at).correct(RAW_A, RAW_G), expected, rtol=0, atol=1e-12)


def test_the_covariance_of_coefficients_is_turned_with_them() -> None:
    """``M C^T`` is linear in the coefficients: block for block the covariance is ``E P E^T``, of Kronecker products."""
    block, after = (
        one.thermal for one in (thermal_document(), turned_to(thermal_document(), "accelerometer-z"))
    )
    assert list(after.covariance_parameters) == list(block.covariance_parameters)
    C = turn_to("accelerometer-z")
    assert np.degrees(np.arccos((np.trace(C) - 1) / 2)) > 0.3
    # two functions: 6 of a bias, 18 of a matrix (six rows of three); and three of the loop
    six, rows = np.eye(6), np.kron(np.eye(6), C)
    size, at = len(block.covariance_parameters), 0
    effect = np.zeros((size, size))
    for one in (six, rows, six, rows, rows, np.eye(3)):
        effect[at : at + len(one), at : at + len(one)] = one
        at += len(one)
    assert at == size
    before = np.array(block.covariance)
    expected, found = effect @ before @ effect.T, np.array(after.covariance)
    assert np.allclose(found, expected, rtol=0, atol=1e-9 * np.abs(before).max())
    assert np.abs(found - before).max() > 1e-3 * np.abs(before).max()


def test_lever_arms_are_turned_with_the_frame() -> None:
    arms = ((0.003, 0.0, 0.001), (0.0, 0.004, -0.002), (0.005, 0.0, 0.012))
    turned = turned_to(document(lever_arms=arms), "accelerometer-x")
    expected = np.array(arms) @ turn_to("accelerometer-x").T
    assert np.allclose(np.array(turned.lever_arms), expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("at", "model", "frame", "other"),
    [
        (0, ImuModel(FORCE, None), "accelerometer-x", "mean-gyro"),
        (1, ImuModel(None, GYRO), "mean-gyro", "accelerometer-z"),
    ],
)
def test_one_triad_alone_is_turned(at: int, model: ImuModel, frame: str, other: str) -> None:
    raw = (RAW_A, None) if at == 0 else (None, RAW_G)
    true, turned = (one.correct(*raw)[at] for one in (document(model), turned_to(document(model), frame)))
    assert np.allclose(np.linalg.norm(turned, axis=1), np.linalg.norm(true, axis=1), rtol=1e-12)
    with pytest.raises(UsageError, match="which is not calibrated"):
        turned_to(document(model), other)


def test_one_unit_told_in_two_units_or_fixed_frames_has_not_changed() -> None:
    """In g and °/s, and against a table that is turned by 20° about z: both in a frame of the unit's own."""
    c, s = np.cos(np.radians(20.0)), np.sin(np.radians(20.0))
    C = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    degrees = Triad(np.degrees(M_G), np.degrees(B_G))
    in_g = bare(ImuModel(Triad(M_A / 9.80665, B_A / 9.80665), degrees, np.degrees(G)), ("g", "deg/s"))
    table = bare(ImuModel(Triad(M_A @ C.T, B_A), Triad(M_G @ C.T, B_G), G @ C.T), frame="table")
    for other in (in_g, table):
        found = compare_calibrations(document(), other)
        assert found.force.value < 1e-12
        assert found.rate_scale.value < 1e-12
    assert any("both were turned to accelerometer-x" in remark for remark in found.remarks)
    warm, cold = (document(temperature_celsius=celsius) for celsius in (25.0, -5.0))
    assert "They are of 25.0 °C and -5.0 °C" in " ".join(compare_calibrations(warm, cold).remarks)


def test_what_cannot_be_compared_or_turned_is_refused() -> None:
    counts = structs.replace(document().raw_units, angular_rate="counts")
    mirrored = ImuModel(Triad(M_A @ np.diag([1.0, -1.0, 1.0]), np.zeros(3)), GYRO)
    alone = document(ImuModel(FORCE, None)), document(ImuModel(None, GYRO))
    for call, words in (
        (
            lambda: compare_calibrations(document(), document(raw_units=counts)),
            "takes rad/s, the other counts",
        ),
        (lambda: compare_calibrations(*alone), "no triad in common"),
        (lambda: turned_to(document(), "accelerometer-y"), "There is no frame 'accelerometer-y'"),
        (lambda: turned_to(document(mirrored), "accelerometer-x"), "left-handed: an axis is reversed"),
    ):
        with pytest.raises(UsageError, match=words):
            call()
