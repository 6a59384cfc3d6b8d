"""A calibration that contradicts itself is refused on reading; one that overflows writes no numbers."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble.document import read_calibration
from tumble.document.imported import calibration_from_model
from tumble.document.result import Calibration
from tumble.errors import CalibrationFileError, UsageError
from tumble.sensor import ImuModel, Triad

MATRIX = np.array([[1.012, 0.004, -0.007], [-0.009, 0.991, 0.006], [0.003, -0.012, 1.021]])
MODEL = ImuModel(
    Triad(MATRIX, np.array([0.11, -0.23, 0.34])),
    Triad(MATRIX.T, np.array([0.012, -0.034, 0.021])),
    1e-3 * MATRIX,
)


def document_of(model: ImuModel) -> Calibration:
    units, frame = ("m/s^2", "rad/s"), ("fixture", "its axes")
    return calibration_from_model(model, units, frame, [], procedure="by hand", remarks=[])


def written(folder: Path) -> tuple[Path, dict[str, Any]]:
    """A sound document's file, and what it holds."""
    calibration = document_of(MODEL)
    file = folder / "calibration.json"
    calibration.write(file)
    return file, json.loads(file.read_text())


def test_a_sound_document_is_read(tmp_path: Path) -> None:
    assert read_calibration(written(tmp_path)[0]).model.g_sensitivity is not None


@pytest.mark.parametrize(
    ("triad", "key", "at", "factor"),
    [
        ("accelerometer", "matrix", (1, 2), 1e6),
        ("accelerometer", "matrix", (0, 0), 1.001),
        ("accelerometer", "bias", (2,), 1.01),
        ("gyroscope", "bias", (0,), -1.0),
        ("gyroscope", "g_sensitivity", (0, 1), 1e3),
        ("gyroscope", "matrix", (2, 2), 1e300),
    ],
)
def test_a_number_that_was_changed_contradicts_the_test_vectors(
    tmp_path: Path, triad: str, key: str, at: tuple[int, ...], factor: float
) -> None:
    file, document = written(tmp_path)
    place: Any = document[triad][key]
    for index in at[:-1]:
        place = place[index]
    place[at[-1]] *= factor
    file.write_text(json.dumps(document))
    with pytest.raises(CalibrationFileError, match=rf"contradicts the {triad}'s|cannot be inverted"):
        read_calibration(file)


@pytest.mark.parametrize("text", ["x\nimport os\n#", "a\u2028b", "g\x00h", "\u202egnihton"])
def test_a_name_with_a_control_character_is_refused(tmp_path: Path, text: str) -> None:
    file, document = written(tmp_path)
    document["imu"]["model"] = text
    file.write_text(json.dumps(document))
    with pytest.raises(CalibrationFileError, match=r"imu\.model: it holds a line break or another control"):
        read_calibration(file)


@pytest.mark.parametrize(
    "text", ["[" * 50_000, '{"format": "\\ud800"}', '{"version": ' + "1" * 5000 + "}", "\xff"]
)
def test_a_file_that_is_no_document_is_refused_in_words(tmp_path: Path, text: str) -> None:
    file = tmp_path / "calibration.json"
    file.write_bytes(text.encode("latin-1"))
    with pytest.raises(CalibrationFileError, match="cannot be read as a calibration: it "):
        read_calibration(file)


def test_corrected_numbers_that_overflow_are_refused() -> None:
    calibration = document_of(ImuModel(Triad(0.1 * MATRIX, np.zeros(3)), None))
    with pytest.raises(CalibrationFileError, match="specific force of sample 2 is not finite"):
        calibration.correct(np.array([[1.0, 2.0, 3.0], [1e308, -1e308, 1e308]]), None)


def test_a_raw_number_that_is_none_stays_none() -> None:
    force, _ = document_of(MODEL).correct(np.array([[1.0, np.nan, 3.0], [1.0, 2.0, 3.0]]), None)
    assert force is not None
    assert np.isfinite(force).all(axis=1).tolist() == [False, True]


def test_an_infinite_temperature_is_refused() -> None:
    from tumble.document.corrector import _given_temperature

    with pytest.raises(UsageError, match="sample 2 is infinite"):
        _given_temperature(np.array([20.0, np.inf]), 2, begun=True)
