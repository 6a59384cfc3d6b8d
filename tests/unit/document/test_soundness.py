"""What can stand in a document, by closed form: correlations, round-off, what is fixed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tumble.document import read_calibration
from tumble.document.predictions import answers
from tumble.document.soundness import covariance_fault
from tumble.errors import CalibrationFileError
from tumble.workflows.predict import predict

NAMES = ["bias x", "bias y", "bias z"]
ROOT = np.array([[1.0, 0.0, 0.0], [0.3, 2e-6, 0.0], [-0.5, 1e-6, 3e4]])
SOUND = ROOT @ ROOT.T


def test_variances_of_any_size_beside_one_another_are_sound() -> None:
    assert covariance_fault(SOUND, NAMES) is None
    assert covariance_fault(np.zeros((0, 0)), []) is None
    assert covariance_fault(np.diag([0.0, 1e-300, 1e300]), NAMES) is None


def test_one_direction_that_is_known_exactly_is_sound() -> None:
    assert covariance_fault(np.outer([1.0, 2.0, -3.0], [1.0, 2.0, -3.0]), NAMES) is None


@pytest.mark.parametrize(
    ("place", "value", "words"),
    [
        ((0, 1), 2.0, "not symmetric"),
        ((1, 1), -1e-9, "bias y has a variance below zero"),
        ((2, 2), np.inf, "not finite at bias z"),
        ((1, 1), 0.0, "bias y has no variance and is correlated"),
    ],
)
def test_what_is_no_covariance_is_said(place: tuple[int, int], value: float, words: str) -> None:
    wrong = SOUND.copy()
    wrong[place] = value
    assert words in str(covariance_fault(wrong, NAMES))


def test_three_correlations_that_contradict_one_another_are_said() -> None:
    # x and y alike, y and z alike, x and z opposite: each pair can be, the three cannot
    wrong = np.array([[1.0, 0.9, -0.9], [0.9, 1.0, 0.9], [-0.9, 0.9, 1.0]])
    assert "a combination" in str(covariance_fault(wrong, NAMES))
    assert "shape" in str(covariance_fault(wrong[:2], NAMES))


def without_uncertainties(folder: Path) -> Path:
    from tests.fuzz.seeds import seeds

    file = folder / "calibration.json"
    file.write_bytes(seeds()["calibration"][0][1])
    return file


def test_without_uncertainties_nothing_is_predicted(tmp_path: Path) -> None:
    document = read_calibration(without_uncertainties(tmp_path))
    assert document.covariance_matrix.shape == (0, 0)
    with pytest.raises(CalibrationFileError, match="states no uncertainties"):
        answers(document)
    with pytest.raises(CalibrationFileError, match="states no uncertainties"):
        predict(document)


def test_a_covariance_that_can_be_none_is_refused_on_reading(tmp_path: Path) -> None:
    file = without_uncertainties(tmp_path)
    document = json.loads(file.read_text())
    document |= {"covariance_parameters": NAMES[:2], "covariance": [[1.0, 2.0], [2.0, 1.0]]}
    file.write_text(json.dumps(document))
    with pytest.raises(CalibrationFileError, match=r"bias x and bias y are correlated by 2\.00"):
        read_calibration(file)
