"""`tumble mount` as a user meets it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble.attitude import matrix_from_rotation_vector, rotation_vector_from_matrix
from tumble.document import read_calibration
from tumble.simulation import find_grade
from tumble.simulation.noise import simulate_noise

GRAVITY, RATE = 9.81, 50.0
GAMMA = np.array([4e-3, -7e-3, 11e-3])
LEVEL_UP, PITCHED_UP = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
C_MB = matrix_from_rotation_vector(GAMMA)


def rest(up_m: np.ndarray, seed: int, *, seconds: float = 20.0, shaken: bool = False) -> np.ndarray:
    """Rows of the unit that `calibrated` is of, at rest on a mount."""
    rng = np.random.default_rng(seed)
    grade = find_grade("consumer-mems")
    model = grade.simulate_model(np.random.default_rng(100))
    count = int(seconds * RATE)
    force = np.tile(GRAVITY * C_MB.T @ up_m, (count, 1))
    rate = np.zeros((count, 3))
    if shaken:
        force += rng.normal(0.0, 3.0, (count, 3))
        rate += rng.normal(0.0, 1.0, (count, 3))
    raw_force, raw_rate = model.distort(force, rate)
    raw_force = raw_force + simulate_noise(grade.accelerometer.noise, count, RATE, rng)
    raw_rate = raw_rate + simulate_noise(grade.gyroscope.noise, count, RATE, rng)
    return np.column_stack([np.arange(count) / RATE, raw_force, raw_rate])


@pytest.fixture
def files(tmp_path: Path, written: Any, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Path]:
    monkeypatch.chdir(tmp_path)
    return (
        written(tmp_path / "level.csv", rest(LEVEL_UP, 1)),
        written(tmp_path / "pitched.csv", rest(PITCHED_UP, 2)),
    )


def test_the_rotation_is_found_within_its_uncertainty(
    tumble: Any, files: tuple[Path, Path], calibrated: Path
) -> None:
    """Against the truth carried into the calibration's frame, whose x is the x accelerometer's axis."""
    answer = tumble("mount", *files, "--calibration", calibrated)
    assert answer.status == 0, answer
    assert "mrad" in answer.out
    document = json.loads(Path("mount.json").read_text(encoding="utf-8"))
    # C_cb, from the axes that the unit was drawn in to the calibration's: L Q of the accelerometers' matrix
    truth = find_grade("consumer-mems").simulate_model(np.random.default_rng(100))
    assert truth.accelerometer is not None
    q, r = np.linalg.qr(truth.accelerometer.matrix.T)
    C_cb = (q * np.sign(np.diag(r))).T
    true = rotation_vector_from_matrix(C_MB @ C_cb.T)
    sigma = np.array(document["standard_uncertainty"])
    # three angles within four sigma, and sigmas that say something
    assert np.all(np.abs(np.array(document["gamma"]) - true) < 4.0 * sigma)
    assert np.all(sigma < 2e-3)


def test_the_file_explains_itself_and_its_test_vector_holds(
    tumble: Any, files: tuple[Path, Path], calibrated: Path, tmp_path: Path
) -> None:
    answer = tumble("mount", *files, "-c", calibrated, "-o", tmp_path / "out" / "mount.json", "--json")
    assert answer.status == 0, answer
    document = json.loads(answer.out)
    vector = document["test_vector"]
    np.testing.assert_allclose(np.array(document["C_MB"]) @ vector["v_B"], vector["v_M"], rtol=1e-12)
    assert "v_M = C_MB * v_B" in document["formula"]
    assert [recording["name"] for recording in document["recordings"]] == ["level.csv", "pitched.csv"]
    assert document == json.loads((tmp_path / "out" / "mount.json").read_text(encoding="utf-8"))
    frame = read_calibration(calibrated).frame.name
    assert document["calibration"]["frame"]["name"] == frame


def test_a_mount_known_to_a_milliradian_adds_it_to_each_angle(
    tumble: Any, files: tuple[Path, Path], calibrated: Path
) -> None:
    exact = json.loads(tumble("mount", *files, "-c", calibrated, "--json").out)
    felt = json.loads(tumble("mount", *files, "-c", calibrated, "--mount-mrad", 3, "--json").out)
    grown = np.array(felt["standard_uncertainty"]) ** 2 - np.array(exact["standard_uncertainty"]) ** 2
    np.testing.assert_allclose(grown, 9e-6, rtol=1e-9)


def test_wrong_recordings_are_refused_in_one_sentence(
    tumble: Any, files: tuple[Path, Path], calibrated: Path, written: Any, tmp_path: Path, recording: Path
) -> None:
    level, pitched = files
    tumble("mount", pitched, level, "-c", calibrated).is_told(2, "swapped", "pitched.csv has x up")
    tumble("mount", level, level, "-c", calibrated).is_told(2, "given twice")
    moving = written(tmp_path / "moving.csv", rest(LEVEL_UP, 3, shaken=True))
    tumble("mount", moving, pitched, "-c", calibrated).is_told(2, "moving.csv")
    tumble("mount", recording, pitched, "-c", calibrated).is_told(2, "tumbled.csv", "rests in", "apart")
    on_side = written(tmp_path / "side.csv", rest(np.array([0.0, 1.0, 0.0]), 6))
    tumble("mount", on_side, pitched, "-c", calibrated).is_told(2, "side.csv has y up")
    tumble("mount", level, pitched, "-c", tmp_path / "none.json").is_told(2, "none.json")
    tumble("mount", level, pitched, "-c", calibrated, "-o", level).is_told(2, "one of the inputs")
    tumble("mount", level, pitched, "-c", calibrated, "--mount-mrad", -1).is_told(2, "--mount-mrad")
    assert not Path("mount.json").exists()
