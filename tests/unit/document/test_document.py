"""What can stand in a calibration, by closed form, what follows from it, and what a notebook shows of it."""

import json
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs
from tests.fuzz.seeds import seeds
from tests.laws.test_calibration_document import EXAMPLE, document_of
from tests.unit.export.a_unit import RAW_A, RAW_G, WHOLE, thermal_document

from tumble.document import read_calibration
from tumble.document.predictions import answers
from tumble.document.soundness import covariance_fault
from tumble.errors import CalibrationFileError, UsageError
from tumble.sensor import TemperatureBasis, ThermalModel
from tumble.simulation import find_grade
from tumble.workflows import predict

CALIBRATION = Path(__file__).resolve().parents[2] / "reference" / "drive_rtk" / "calibration.json"
NAMES = ["bias x", "bias y", "bias z"]
ROOT = np.array([[1.0, 0.0, 0.0], [0.3, 2e-6, 0.0], [-0.5, 1e-6, 3e4]])
SOUND = ROOT @ ROOT.T


def test_variances_of_any_size_beside_one_another_and_one_exact_direction_are_sound():
    assert covariance_fault(np.zeros((0, 0)), []) is None
    for sound in (SOUND, np.diag([0.0, 1e-300, 1e300]), np.outer([1.0, 2.0, -3.0], [1.0, 2.0, -3.0])):
        assert covariance_fault(sound, NAMES) is None


@pytest.mark.parametrize(
    ("place", "value", "words"),
    [
        ((0, 1), 2.0, "not symmetric"),
        ((1, 1), -1e-9, "bias y has a variance below zero"),
        ((2, 2), np.inf, "not finite at bias z"),
        ((1, 1), 0.0, "bias y has no variance and is correlated"),
    ],
)
def test_what_is_no_covariance_is_said(place, value, words):
    wrong = SOUND.copy()
    wrong[place] = value
    assert words in str(covariance_fault(wrong, NAMES))


def test_three_correlations_that_contradict_one_another_are_said():
    # x and y alike, y and z alike, x and z opposite: each pair can be, the three cannot
    wrong = np.array([[1.0, 0.9, -0.9], [0.9, 1.0, 0.9], [-0.9, 0.9, 1.0]])
    assert "a combination" in str(covariance_fault(wrong, NAMES))
    assert "shape" in str(covariance_fault(wrong[:2], NAMES))


def test_without_uncertainties_nothing_is_predicted_and_one_that_can_be_none_is_refused(tmp_path):
    file = tmp_path / "calibration.json"
    file.write_bytes(seeds()["calibration"][0][1])
    document = read_calibration(file)
    assert document.covariance_matrix.shape == (0, 0)
    for predicted in (answers, predict):
        with pytest.raises(CalibrationFileError, match="states no uncertainties"):
            predicted(document)
    covariance = {"covariance_parameters": NAMES[:2], "covariance": [[1.0, 2.0], [2.0, 1.0]]}
    file.write_text(json.dumps(json.loads(file.read_text()) | covariance))
    with pytest.raises(CalibrationFileError, match=r"bias x and bias y are correlated by 2\.00"):
        read_calibration(file)


def test_the_worst_pose_is_the_worst_of_each_column():
    every = answers(read_calibration(CALIBRATION), grade=find_grade("consumer-mems"))
    at_rest = [a for a in every if a.kind == "position"]
    assert at_rest
    for mean, worst in zip(at_rest[::2], at_rest[1::2], strict=True):
        assert "rms" in mean.question
        assert "worst" in worst.question
        for column in ("after", "before", "sheet"):
            assert getattr(worst, column) >= getattr(mean, column)


def test_an_infinite_temperature_is_refused():
    basis = TemperatureBasis("polynomial", 22.0, order=1)
    warm = ThermalModel(WHOLE, basis, {"gyroscope.bias": 1e-5 * np.ones((1, 3))}, span_celsius=(0.0, 50.0))
    with pytest.raises(UsageError, match="sample 2 is infinite"):
        thermal_document(warm).correct(RAW_A[:2], RAW_G[:2], temperature_celsius=np.array([20.0, np.inf]))


def test_a_notebook_shows_verdict_parameters_and_no_markup_of_names():
    calibration = document_of(EXAMPLE)
    imu = structs.replace(calibration.imu, model="<script>", serial_number="7")
    shown = structs.replace(calibration, imu=imu)._repr_html_()
    assert "of &lt;script&gt; 7" in shown
    assert "<script>" not in shown
    assert "accelerometer bias x" in shown
    assert "10.20 ± 0.10" in shown
    assert ("NOT fit" in shown) is not calibration.verdict.fit
