"""`tumble apply` corrects the magnetometer too, whatever its rate, in blocks as in one."""

from __future__ import annotations

import dataclasses
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

import tumble
from tumble.calibration.magnetometer.estimate import NAMES, named_parameters
from tumble.document.difference import compare_calibrations
from tumble.document.imported import calibration_from_model
from tumble.document.magnetometer_block import (
    FieldBlock,
    FieldParameter,
    FieldVerdictBlock,
    MagnetometerBlock,
)
from tumble.document.result import Calibration
from tumble.errors import UsageError
from tumble.limits import decide, read_limits
from tumble.recording import Recording
from tumble.recording.formats.output import write_recording
from tumble.recording.samples import MagneticField
from tumble.sensor import ImuModel, Triad
from tumble.workflows.corrected import CorrectedField
from tumble.workflows.difference import Recovery
from tumble.workflows.magnetometer import left_out_of

M = np.array([[1.07, 0.031, -0.052], [-0.083, 0.94, 0.047], [0.021, -0.066, 1.12]])
H = np.array([12.5, -31.0, 47.25])
TRUE = np.array([[20.0, -3.0, 44.0], [-31.0, 12.0, 35.0], [5.0, 40.0, -28.0]])


def document(**changed: object) -> Calibration:
    block = MagnetometerBlock(
        raw_unit="uT",
        unit="T",
        frame="b",
        method="holds and turns",
        matrix=tuple(tuple(float(1e6 * v) for v in row) for row in M),  # type: ignore[arg-type]
        bias=tuple(float(v) for v in H),  # type: ignore[arg-type]
    )
    made = calibration_from_model(
        ImuModel(Triad(np.eye(3), np.zeros(3)), Triad(np.eye(3), np.zeros(3))),
        ("m/s^2", "rad/s"),
        ("fixture", "the axes of the fixture"),
        [],
        procedure="by hand",
        remarks=[],
    )
    return structs.replace(made, magnetometer=structs.replace(block, **changed))


def recording(unit: str = "uT", factor: float = 1.0) -> Recording:
    time = np.arange(600) / 100.0
    rng = np.random.default_rng(2)
    of_field = np.arange(150) / 25.0 + 0.003
    values = factor * (TRUE[np.arange(150) % 3] @ M.T + H)
    return Recording(
        time=time,
        specific_force=rng.normal(size=(600, 3)) + np.array([0.0, 0.0, 9.8]),
        angular_rate=0.01 * rng.normal(size=(600, 3)),
        specific_force_unit="m/s^2",
        angular_rate_unit="rad/s",
        rate=100.0,
        magnetic_field=MagneticField(of_field, values, unit),
    )


@pytest.mark.parametrize(("unit", "factor"), [("uT", 1.0), ("gauss", 0.01)])
def test_a_corrected_file_has_the_true_field(tmp_path: Path, unit: str, factor: float) -> None:
    write_recording(recording(unit, factor), tmp_path / "raw.csv")
    document().write(tmp_path / "calibration.json")
    made = tumble.apply(tmp_path / "calibration.json", tmp_path / "raw.csv", output=tmp_path / "out.csv")
    back = tumble.read_recording(made.file).magnetic_field
    assert back is not None
    assert back.unit == "uT"
    np.testing.assert_allclose(back.values, TRUE[np.arange(150) % 3], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(back.time, np.arange(150) / 25.0 + 0.003, atol=1e-9)


def test_a_magnetometer_that_is_not_fit_is_left_out_and_that_is_said(tmp_path: Path) -> None:
    write_recording(recording(), tmp_path / "raw.csv")
    against = FieldVerdictBlock(use="not fit", reasons=["Its axes are mirrored."])
    # A file may still have the matrix beside its verdict.
    document(verdict=against).write(tmp_path / "calibration.json")
    made = tumble.apply(tmp_path / "calibration.json", tmp_path / "raw.csv", output=tmp_path / "out.csv")
    assert tumble.read_recording(made.file).magnetic_field is None
    assert any("magnetometer is not fit for use" in text for text in made.remarks)
    assert document(verdict=against).correct_field(TRUE) is None


def test_a_comparison_says_that_the_magnetometer_is_not_in_it() -> None:
    with_one, without = document(), structs.replace(document(), magnetometer=None)
    local = document(unit="local field")
    for other, said in ((without, "not both have one"), (local, "units of different kinds")):
        assert any(said in remark for remark in compare_calibrations(with_one, other).remarks)
        assert any(said in remark for remark in compare_calibrations(other, with_one).remarks)
    for pair in ((without, without), (with_one, with_one)):
        assert not any("magnetometer" in remark for remark in compare_calibrations(*pair).remarks)
    assert any("not compared" in remark for remark in Recovery(with_one, [], 3.0).remarks)
    assert Recovery(without, [], 3.0).remarks == []


def stated(
    matrix: np.ndarray, bias: np.ndarray, unit: str, sigma: float, source: str | None = None
) -> Calibration:
    """A magnetometer with parameters and a covariance: `sigma` µT of each bias, 1e-3 of each entry of the matrix.

    With a `source` the norm of the field is uncertain by 5 % more: given as that, or not given where it is empty.
    """
    factor = {"uT": 1.0, "gauss": 0.01}[unit]
    numbers = factor * np.concatenate([1e6 * matrix.ravel(), bias])
    spread = np.diag(np.repeat([factor * 1e3, factor * sigma], [9, 3]) ** 2)
    if source is not None:
        along = np.concatenate([numbers[:9], np.zeros(3)])
        spread += 0.05**2 * np.outer(along, along)
    named = named_parameters(numbers, spread, unit, "T")
    return document(
        raw_unit=unit,
        matrix=numbers[:9].reshape(3, 3).tolist(),
        bias=numbers[9:].tolist(),
        parameters=[FieldParameter(**dataclasses.asdict(p)) for p in named],
        covariance_parameters=list(NAMES),
        covariance=spread.tolist(),
        field=None
        if source is None
        else FieldBlock(norm=48e-6, norm_standard_uncertainty=2.4e-6, norm_given=source != "", source=source),
    )


@pytest.mark.parametrize("source", ["", "a model"])
def test_a_norm_that_both_assume_is_counted_in_no_difference(source: str) -> None:
    """0.5 % of another scale are found below the 5 % that both assume; not where another norm was given."""
    found, without, apart = (
        {g.name: g for g in compare_calibrations(one, two).groups}["magnetometer: matrix"].chi_square
        for one, two in (
            (stated(M, H, "uT", 0.03, source), stated(1.005 * M, H, "gauss", 0.03, source)),
            (stated(M, H, "uT", 0.03), stated(1.005 * M, H, "gauss", 0.03)),
            (stated(M, H, "uT", 0.03, source), stated(1.005 * M, H, "gauss", 0.03, "another model")),
        )
    )
    # 0.5 % of the 5 % are no longer common: 0.00025 of what each entry is uncertain by 0.001.
    assert found == pytest.approx(without, rel=0.1)
    assert apart < without / 3.0
    both = compare_calibrations(stated(M, H, "uT", 0.03, source), stated(1.005 * M, H, "uT", 0.03, source))
    change = {p.name: p for p in both.parameters}["magnetometer scale factor x"]
    assert change.standard_uncertainty == pytest.approx(np.sqrt(2.0) * 1e3, rel=0.2)
    assert any("same norm of the magnetic field" in remark for remark in both.remarks)


def test_limits_hold_a_magnetometer_that_is_fit_and_miss_one_that_is_not(tmp_path: Path) -> None:
    file = tmp_path / "limits.yaml"
    file.write_text(
        "name: lot\nlimits:\n  magnetometer bias: 0.4 gauss\n  magnetometer bias z: 50 uT\n", "utf-8"
    )
    made = stated(M, H, "uT", 0.03)
    found = decide(made, read_limits(file))
    assert {one.name: one.decision for one in found.parameters} == {
        "magnetometer bias x": "passed",
        "magnetometer bias y": "passed",
        "magnetometer bias z": "passed",
    }
    assert made.magnetometer is not None
    against = FieldVerdictBlock(use="not fit", reasons=["Its axes are mirrored."])
    unfit = structs.replace(made, magnetometer=structs.replace(made.magnetometer, verdict=against))
    assert decide(unfit, read_limits(file)).decision == "undecided"
    assert unfit.magnetometer is not None
    said = ["The magnetometer is not fit for use. Its axes are mirrored."]
    assert (unfit.magnetometer.reasons_against, made.magnetometer.reasons_against) == (said, [])
    assert len(unfit.every_parameter) + 12 == len(made.every_parameter)


def test_what_takes_no_magnetometer_says_so() -> None:
    assert left_out_of([replace(recording(), magnetic_field=None)]) == []
    (said,) = left_out_of([replace(recording(), magnetic_field=None), recording()])
    assert "left out of several turn-ons" in said


@pytest.mark.parametrize("unit", ["uT", "gauss"])
def test_what_changed_of_a_magnetometer_is_in_sigmas_and_in_the_first_ones_unit(unit: str) -> None:
    moved = np.array([0.4, -0.1, 0.0])
    found = compare_calibrations(stated(M, H, "uT", 0.03), stated(M, H + moved, unit, 0.04))
    of = {p.name: p for p in found.parameters}
    for axis, by in zip("xyz", moved, strict=True):
        change = of[f"magnetometer bias {axis}"]
        assert change.second - change.first == pytest.approx(by, abs=1e-9)
        assert change.standard_uncertainty == pytest.approx(0.05)
        assert change.sigmas == pytest.approx(by / 0.05, abs=1e-6)
    assert of["magnetometer scale factor z"].sigmas == 0.0
    groups = {g.name: g for g in found.groups}
    assert groups["magnetometer: biases"].chi_square == pytest.approx(float(moved @ moved) / 0.05**2)
    assert groups["magnetometer: matrix"].chi_square == pytest.approx(0.0, abs=1e-9)
    assert found.significant
    # A triad that is turned by 2 mrad about its own z against b, and stretched along it.
    turn = np.array([[1.0, 2e-3, 0.0], [-2e-3, 1.0, 0.0], [0.0, 0.0, 1.0]])
    other = compare_calibrations(stated(M, H, "uT", 0.03), stated(np.diag([1, 1, 1.01]) @ M, H, unit, 0.03))
    assert {p.name: p for p in other.parameters}["magnetometer scale factor z"].sigmas > 3.0
    turned = compare_calibrations(stated(np.eye(3), H, "uT", 0.03), stated(turn, H, unit, 0.03))
    rotation = {p.name: p for p in turned.parameters}["rotation of the magnetometer z"]
    assert rotation.second - rotation.first == pytest.approx(-2e-3, rel=1e-3)
    # Its x along −y and its y along x: other axes, of which the small angles say nothing.
    swapped = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    crossed = compare_calibrations(stated(M, H, "uT", 0.03), stated(M @ swapped, H, unit, 0.03))
    assert not any("rotation of the magnetometer" in p.name for p in crossed.parameters)
    assert any("axes lie is not compared" in remark for remark in crossed.remarks)


def test_blocks_have_one_form_and_the_numbers_of_the_whole() -> None:
    whole, made = recording(), document()
    how = CorrectedField.of(made, whole, "table")
    at_once = how.of_block(whole)
    parts = [how.of_block(whole.between(k, k + 1 if k == 599 else k + 2)) for k in range(0, 600, 2)]
    assert at_once is not None
    assert all(part is not None for part in parts)
    joined = np.concatenate([p.values for p in parts if p is not None])
    np.testing.assert_allclose(joined, at_once.values, rtol=1e-14, atol=1e-13)


def test_counts_are_not_taken_for_microtesla_and_what_is_not_written_is_said() -> None:
    with pytest.raises(UsageError, match="magnetic field is in counts"):
        CorrectedField.of(document(), recording("counts"), "table")
    local = CorrectedField.of(document(raw_unit="counts", unit="local field"), recording("counts"), "table")
    assert any("units of the local field" in text for text in local.remarks)
    without = structs.replace(document(), magnetometer=None)
    assert "no magnetometer" in CorrectedField.of(without, recording(), "table").remarks[0]
    assert "tables" in CorrectedField.of(document(), recording(), "euroc").remarks[0]
