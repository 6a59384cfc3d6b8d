"""A magnetometer's block: calibrated alone where there are no holds, applied, compared and held against limits."""

import dataclasses
import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import structs
from tests.unit.export import a_unit
from tests.unit.given import given as known
from tests.unit.recording.test_magnetometer import plain, slow_field

import tumble
from tumble.calibration import NAMES, named_parameters
from tumble.document import Calibration, compare_calibrations, read_calibration
from tumble.errors import TumbleError, UsageError
from tumble.limits import decide, read_limits
from tumble.recording import MagneticField, Recording, write_recording
from tumble.sensor import ImuModel
from tumble.workflows.corrected import CorrectedField
from tumble.workflows.difference import Recovery
from tumble.workflows.magnetometer import given_field, left_out_of
from tumble.workflows.several import join_recordings

# --- calibrated alone

TURNED_M = np.array([[1.10, 0.05, -0.02], [0.05, 0.92, 0.04], [-0.02, 0.04, 1.19]])
TURNED_H = np.array([12.0, -30.0, 44.0])
OTHERS = ",ax [m/s^2],ay [m/s^2],az [m/s^2],gx [rad/s],gy [rad/s],gz [rad/s]"
FIELD = ",mx [uT],my [uT],mz [uT]"


def table(path: Path, header: str, *columns: Any) -> Path:
    rows = np.column_stack([0.02 * np.arange(len(columns[0])), *columns])
    np.savetxt(path, rows, delimiter=",", header=f"t{header}", comments="", fmt="%.6f")
    return path


def turned(path, *, cap=-1.0, rows=800, others=False, field=FIELD):
    """Write a file of a unit that is turned about; `cap` is the least z of a field's direction."""
    rng = np.random.default_rng(8)
    # Down a spiral of twenty turns: the unit never rests.
    z = np.linspace(0.99, max(cap, -0.99), rows)
    around, across = np.linspace(0.0, 40.0 * np.pi, rows), np.sqrt(1.0 - z**2)
    up = np.column_stack([across * np.cos(around), across * np.sin(around), z])
    values = 49.0 * up @ TURNED_M.T + TURNED_H + rng.normal(0.0, 0.3, up.shape)
    if not others:
        return table(path, field, values)
    rate = -np.cross(up, np.gradient(up, 0.02, axis=0)) + rng.normal(0.0, 0.01, up.shape)
    return table(path, OTHERS + field, 9.81 * up + rng.normal(0.0, 0.05, up.shape), rate, values)


@pytest.mark.parametrize("others", [False, True])
def test_without_holds_the_magnetometer_alone_is_calibrated(tmp_path: Path, others: bool) -> None:
    file = turned(tmp_path / "turned.csv", others=others)
    assert tumble.calibrate(file, output=tmp_path / "out", field="49±0.1uT").accepted
    document = read_calibration(tmp_path / "out")
    assert document.verdict.fit
    assert document.verdict.reasons[0].startswith("Only the magnetometer is calibrated.")
    assert "gyros' biases are not determined" in document.verdict.reasons[0]
    assert (document.accelerometer, document.gyroscope) == (None, None)
    block = known(document.magnetometer)
    assert (block.frame, known(block.verdict).use) == ("magnetometer", "fit with reservations")
    sigma = np.sqrt(np.diag(block.covariance))
    found = np.array(known(block.matrix))[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    true = 1e6 * TURNED_M[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    assert np.all(np.abs(found - true) < 4.0 * sigma[:6])
    assert np.all(np.abs(np.array(known(block.bias)) - TURNED_H) < 4.0 * sigma[6:])
    corrected = known(document.correct_field(np.array([49.0 * TURNED_M[:, 0] + TURNED_H])))
    np.testing.assert_allclose(corrected, [[49e-6, 0.0, 0.0]], atol=2e-7)
    assert "magnetometer-sphere" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_directions_on_one_side_do_not_determine_it_and_wrong_units_are_not_fit(tmp_path: Path) -> None:
    run = tumble.calibrate(turned(tmp_path / "half.csv", cap=0.45))
    assert known(run.calibration.magnetometer).matrix is None
    assert not run.accepted
    assert any("Turn the unit" in text for text in run.calibration.verdict.reasons)
    assert run.calibration.correct_field(np.zeros((1, 3))) is None
    file = turned(tmp_path / "turned.csv", field=FIELD.replace("uT", "gauss"))
    document = tumble.calibrate(file, output=tmp_path / "out", field="49±0.1uT").calibration
    block = known(document.magnetometer)
    assert known(block.verdict).use == "not fit"
    assert "of what the unit gauss says" in known(block.verdict).reasons[0]
    assert "--units" in known(block.verdict).reasons[0]
    assert (block.matrix, block.bias, block.covariance, block.test_vectors) == (None, None, [], [])
    assert len(block.parameters) == 9
    assert read_calibration(tmp_path / "out").correct_field(np.zeros((1, 3))) is None


def test_a_recording_that_is_too_short_or_constant_is_refused_in_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(TumbleError, match=r"too short: it lasts 3\.0 s, .* The magnetometer"):
        tumble.calibrate(turned(tmp_path / "short.csv", cap=0.45, rows=150, others=True))
    with pytest.raises(TumbleError):
        tumble.calibrate(turned(tmp_path / "few.csv", rows=20))
    with pytest.raises(TumbleError, match=r"^[^\n]+$"):
        tumble.calibrate(table(tmp_path / "still.csv", FIELD, np.tile([20.0, -3.0, 44.0], (500, 1))))


def test_what_was_asked_for_is_done_for_a_magnetometer_alone_or_refused(tmp_path: Path) -> None:
    file, limits = turned(tmp_path / "turned.csv"), tmp_path / "limits.yaml"
    limits.write_text("rule: simple\nlimits:\n  gyro bias: {within: 0.001 deg/s}\n", encoding="utf-8")
    notes = ["operator=Eve <7>"]
    run = tumble.calibrate(file, limits=limits, notes=notes, field="49uT", output=tmp_path / "out")
    document = read_calibration(tmp_path / "out")
    assert (document.verdict.fit, known(document.limits).decision, run.accepted) == (True, "undecided", False)
    assert document.notes == {"operator": "Eve <7>"}
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "nothing was compared with its limits" in page
    assert "Eve &lt;7&gt;" in page
    for option, value in {"prior": "tactical", "monte_carlo": 1000, "estimator": "six-position"}.items():
        with pytest.raises(UsageError, match=rf"^--{option[:5]}.* only the magnetometer .* leave it out\. "):
            tumble.calibrate(file, **{option: value})  # type: ignore[arg-type]
    with pytest.raises(TumbleError):
        tumble.calibrate(file, procedure="hand-held")


def test_what_field_means_is_read_or_refused(tmp_path: Path) -> None:
    field = known(given_field("0.492±0.003 gauss, dip 66"))
    assert (field.norm, field.norm_sigma) == pytest.approx((49.2e-6, 0.3e-6))
    assert field.dip == pytest.approx(np.radians(66.0))
    plain = known(given_field("49.2uT"))
    assert (plain.norm_sigma, plain.dip) == (pytest.approx(0.492e-6), None)
    for wrong in ("49.2", "49.2 furlongs", "4900uT", "49uT,120", "uT", "49.2uT,66,3", "-49uT"):
        with pytest.raises(TumbleError, match="--field"):
            given_field(wrong)
    for beyond in ("15uT", "21.9uT", "67.1uT", "70uT", "0.7gauss"):
        with pytest.raises(TumbleError, match="22 to 67 µT"):
            given_field(beyond)
    for limit in ("22uT", "67uT", "0.22gauss", "670mgauss", "22000nT"):
        assert given_field(limit) is not None
    force = np.random.default_rng(1).normal([0.0, 0.0, 9.81, 0.0, 0.0, 0.0], 1e-3, (3000, 6))
    with pytest.raises(TumbleError, match="no magnetometer"):
        tumble.calibrate(table(tmp_path / "six.csv", OTHERS, force), field="49uT")
    eight = np.tile([0.1, 0.2, 9.8, 0.0, 0.0, 0.01, 20.0, -3.0], (500, 1))
    with pytest.raises(TumbleError, match="and no mz; a triad needs all three") as caught:
        tumble.calibrate(table(tmp_path / "eight.csv", OTHERS + ",mx [uT],my [uT]", eight), field="49uT")
    assert "leave it out" not in str(caught.value)


def test_the_world_magnetic_model_gives_the_field_of_a_place_and_day(monkeypatch: pytest.MonkeyPatch) -> None:
    """Norm and dip are those that MATLAB's wrldmagm prints for 1000 m over Natick, by WMM2025 and WMM2020."""
    pytest.importorskip("pygeomag")
    natick = tumble.Site.from_latitude(math.radians(42.283), 1000.0)
    for day, norm, dip, sigma, dip_sigma in (
        ("2028-07-04", 50.940e-6, 65.9899, 138e-9, 0.20),
        ("2020-07-04", 51.733e-6, 66.8184, 148e-9, 0.21),
    ):
        found = known(given_field(f"wmm,-71.35,{day}", natick))
        assert found.norm == pytest.approx(norm, abs=1e-9)
        assert found.dip == pytest.approx(math.radians(dip), abs=2e-5)
        assert (found.norm_sigma, found.dip_sigma) == pytest.approx((sigma, math.radians(dip_sigma)))
    for wrong, said in (
        ("wmm", "longitude"),
        ("wmm,east,2026-05-03", "longitude"),
        ("wmm,11.6,yesterday", "longitude"),
        ("wmm,11.6,2012-05-03", "2015 to 2029"),
        ("wmm,500,2026-05-03", "-180 to 360"),
    ):
        with pytest.raises(TumbleError, match=said):
            given_field(wrong, natick)
    for nowhere in (None, tumble.Site.from_gravity(9.81)):
        with pytest.raises(TumbleError, match="needs the place"):
            given_field("wmm,11.6,2026-05-03", nowhere)
    monkeypatch.setitem(sys.modules, "pygeomag", None)
    with pytest.raises(TumbleError, match=r"pip install pygeomag"):
        given_field("wmm,11.6,2026-05-03", natick)


# --- applied

M, H = 1e-6 * a_unit.M_M, a_unit.B_M
TRUE = np.array([[20.0, -3.0, 44.0], [-31.0, 12.0, 35.0], [5.0, 40.0, -28.0]])
MIRRORED = {"use": "not fit", "reasons": ["Its axes are mirrored."]}


def document(**changed: Any) -> Calibration:
    magnetometer = a_unit.compass(**{"field": None, **changed})
    return structs.replace(a_unit.document(ImuModel.ideal()), magnetometer=magnetometer)


WITHOUT = structs.replace(document(), magnetometer=None)


def recording(unit: str = "uT", factor: float = 1.0) -> Recording:
    rng = np.random.default_rng(2)
    values = factor * (TRUE[np.arange(150) % 3] @ M.T + H)
    return Recording(
        time=np.arange(600) / 100.0,
        specific_force=rng.normal(size=(600, 3)) + np.array([0.0, 0.0, 9.8]),
        angular_rate=0.01 * rng.normal(size=(600, 3)),
        specific_force_unit="m/s^2",
        angular_rate_unit="rad/s",
        rate=100.0,
        magnetic_field=MagneticField(np.arange(150) / 25.0 + 0.003, values, unit),
    )


@pytest.mark.parametrize(("unit", "factor"), [("uT", 1.0), ("gauss", 0.01)])
def test_a_corrected_file_has_the_true_field_or_none_of_one_that_is_not_fit(tmp_path, unit, factor):
    raw = write_recording(recording(unit, factor), tmp_path / "raw.csv")
    made = tumble.apply(document(), raw, output=tmp_path / "out.csv")
    back = known(tumble.read_recording(made.file).magnetic_field)
    assert back.unit == "uT"
    np.testing.assert_allclose(back.values, TRUE[np.arange(150) % 3], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(back.time, np.arange(150) / 25.0 + 0.003, atol=1e-9)
    # A file may still have the matrix beside its verdict.
    against = document(verdict=MIRRORED)
    made = tumble.apply(against, raw, output=tmp_path / "unfit.csv")
    assert tumble.read_recording(made.file).magnetic_field is None
    assert any("magnetometer is not fit for use" in text for text in made.remarks)
    assert against.correct_field(TRUE) is None


def test_blocks_have_one_form_and_the_numbers_of_the_whole_and_what_is_left_out_is_said() -> None:
    whole = recording()
    how = CorrectedField.of(document(), whole, "table")
    parts = [how.of_block(whole.between(k, k + 1 if k == 599 else k + 2)) for k in range(0, 600, 2)]
    joined = np.concatenate([known(part).values for part in parts])
    np.testing.assert_allclose(joined, known(how.of_block(whole)).values, rtol=1e-14, atol=1e-13)
    with pytest.raises(UsageError, match="magnetic field is in counts"):
        CorrectedField.of(document(), recording("counts"), "table")
    local = CorrectedField.of(document(raw_unit="counts", unit="local field"), recording("counts"), "table")
    assert any("units of the local field" in text for text in local.remarks)
    assert "no magnetometer" in CorrectedField.of(WITHOUT, whole, "table").remarks[0]
    assert "tables" in CorrectedField.of(document(), whole, "euroc").remarks[0]
    plain = replace(whole, magnetic_field=None)
    assert left_out_of([plain]) == []
    (said,) = left_out_of([plain, whole])
    assert "left out of several turn-ons" in said


# --- compared, and held against limits


def stated(matrix, bias, unit, sigma, source=None):
    """A magnetometer with parameters and a covariance: `sigma` µT of each bias, 1e-3 of each entry of the matrix.

    With a `source` the norm of the field is uncertain by 5 % more: given as that, or not given where it is empty.
    """
    factor = {"uT": 1.0, "gauss": 0.01}[unit]
    numbers = factor * np.concatenate([1e6 * matrix.ravel(), bias])
    spread = np.diag(np.repeat([factor * 1e3, factor * sigma], [9, 3]) ** 2)
    field = None
    if source is not None:
        along = np.concatenate([numbers[:9], np.zeros(3)])
        spread += 0.05**2 * np.outer(along, along)
        field = {
            "norm": 48e-6,
            "norm_standard_uncertainty": 2.4e-6,
            "norm_given": source != "",
            "source": source,
        }
    named = named_parameters(numbers, spread, unit, "T")
    return document(
        raw_unit=unit,
        matrix=numbers[:9].reshape(3, 3).tolist(),
        bias=numbers[9:].tolist(),
        parameters=[dataclasses.asdict(p) for p in named],
        covariance_parameters=list(NAMES),
        covariance=spread.tolist(),
        field=field,
    )


def test_a_comparison_says_where_the_magnetometer_is_not_in_it() -> None:
    made, local = document(), document(unit="local field")
    for other, said in ((WITHOUT, "not both have one"), (local, "units of different kinds")):
        assert any(said in remark for remark in compare_calibrations(made, other).remarks)
        assert any(said in remark for remark in compare_calibrations(other, made).remarks)
    for pair in ((WITHOUT, WITHOUT), (made, made)):
        assert not any("magnetometer" in remark for remark in compare_calibrations(*pair).remarks)
    assert any("not compared" in remark for remark in Recovery(made, [], 3.0).remarks)
    assert Recovery(WITHOUT, [], 3.0).remarks == []


@pytest.mark.parametrize("source", ["", "a model"])
def test_a_norm_that_both_assume_is_counted_in_no_difference(source: str) -> None:
    """0.5 % of another scale are found below the 5 % that both assume; not where another norm was given."""

    def matrices(first: str | None, second: str | None, unit: str = "gauss") -> Any:
        one, other = stated(M, H, "uT", 0.03, first), stated(1.005 * M, H, unit, 0.03, second)
        return compare_calibrations(one, other)

    found, without, apart = (
        next(g.chi_square for g in made.groups if g.name == "magnetometer: matrix")
        for made in (matrices(source, source), matrices(None, None), matrices(source, "another model"))
    )
    # 0.5 % of the 5 % are no longer common: 0.00025 of what each entry is uncertain by 0.001.
    assert found == pytest.approx(without, rel=0.1)
    assert apart < without / 3.0
    both = matrices(source, source, "uT")
    change = {p.name: p for p in both.parameters}["magnetometer scale factor x"]
    assert change.standard_uncertainty == pytest.approx(np.sqrt(2.0) * 1e3, rel=0.2)
    assert any("same norm of the magnetic field" in remark for remark in both.remarks)


@pytest.mark.parametrize("unit", ["uT", "gauss"])
def test_what_changed_of_a_magnetometer_is_in_sigmas_and_in_the_first_ones_unit(unit: str) -> None:
    moved = np.array([0.4, -0.1, 0.0])
    first = stated(M, H, "uT", 0.03)
    found = compare_calibrations(first, stated(M, H + moved, unit, 0.04))
    of = {p.name: p for p in found.parameters}
    for axis, by in zip("xyz", moved, strict=True):
        change = of[f"magnetometer bias {axis}"]
        assert change.second - change.first == pytest.approx(by, abs=1e-9)
        assert change.standard_uncertainty == pytest.approx(0.05)
        assert change.sigmas == pytest.approx(by / 0.05, abs=1e-6)
    assert of["magnetometer scale factor z"].sigmas == 0.0
    groups = {g.name: g.chi_square for g in found.groups}
    assert groups["magnetometer: biases"] == pytest.approx(float(moved @ moved) / 0.05**2)
    assert groups["magnetometer: matrix"] == pytest.approx(0.0, abs=1e-9)
    assert found.significant
    # A triad that is turned by 2 mrad about its own z against b, and stretched along it.
    turn = np.array([[1.0, 2e-3, 0.0], [-2e-3, 1.0, 0.0], [0.0, 0.0, 1.0]])
    other = compare_calibrations(first, stated(np.diag([1, 1, 1.01]) @ M, H, unit, 0.03))
    assert {p.name: p for p in other.parameters}["magnetometer scale factor z"].sigmas > 3.0
    other = compare_calibrations(stated(np.eye(3), H, "uT", 0.03), stated(turn, H, unit, 0.03))
    rotation = {p.name: p for p in other.parameters}["rotation of the magnetometer z"]
    assert rotation.second - rotation.first == pytest.approx(-2e-3, rel=1e-3)
    # Its x along −y and its y along x: other axes, of which the small angles say nothing.
    swapped = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    crossed = compare_calibrations(first, stated(M @ swapped, H, unit, 0.03))
    assert not any("rotation of the magnetometer" in p.name for p in crossed.parameters)
    assert any("axes lie is not compared" in remark for remark in crossed.remarks)


def test_limits_hold_a_magnetometer_that_is_fit_and_miss_one_that_is_not(tmp_path: Path) -> None:
    file = tmp_path / "limits.yaml"
    text = "name: lot\nlimits:\n  magnetometer bias: 0.4 gauss\n  magnetometer bias z: 50 uT\n"
    file.write_text(text, "utf-8")
    made = stated(M, H, "uT", 0.03)
    decisions = {one.name: one.decision for one in decide(made, read_limits(file)).parameters}
    assert decisions == {f"magnetometer bias {axis}": "passed" for axis in "xyz"}
    block, against = known(made.magnetometer), known(document(verdict=MIRRORED).magnetometer).verdict
    unfit = structs.replace(made, magnetometer=structs.replace(block, verdict=against))
    assert decide(unfit, read_limits(file)).decision == "undecided"
    said = ["The magnetometer is not fit for use. Its axes are mirrored."]
    assert (known(unfit.magnetometer).reasons_against, block.reasons_against) == (said, [])
    assert len(unfit.every_parameter) + 12 == len(made.every_parameter)


def test_joined_recordings_move_the_stamps_of_the_field_with_their_own() -> None:
    later = replace(plain(4.0), time=plain(4.0).time + 50.0, magnetic_field=slow_field(4.0, begin=50.02))
    whole, spans = join_recordings([plain(), later])
    assert len(whole.magnetic_field) == 200 + 80
    assert whole.magnetic_field.time[200] == pytest.approx(spans[1][0] + 0.02)
    assert join_recordings([plain(), replace(later, magnetic_field=None)])[0].magnetic_field is None
