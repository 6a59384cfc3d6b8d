"""`tumble convert` and `diff` as a user meets them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from tumble.document import read_calibration
from tumble.document.imported import calibration_from_model
from tumble.export.target import targets
from tumble.sensor import ImuModel, Triad

TARGETS = targets()

MATRIX = np.array([[1.01, 0.002, -0.003], [-0.001, 0.99, 0.004], [0.003, -0.002, 1.02]])


def written(path: Path, bias: float = 0.1) -> Path:
    triad = Triad(MATRIX, np.array([bias, -0.2, 0.05]))
    document = calibration_from_model(
        ImuModel(triad, triad), ("m/s^2", "rad/s"), ("fixture", "axes"), [], procedure="by hand", remarks=[]
    )
    names = [f"{t}.bias[{i}]" for t in ("accelerometer", "gyroscope") for i in range(3)]
    known = {"covariance_parameters": names, "covariance": (1e-6 * np.eye(6)).tolist()}
    structs.replace(document, **known).write(path)
    return path


@pytest.fixture
def calibration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return written(tmp_path / "calibration.json")


def test_without_arguments_all_targets_are_listed(tumble: Any) -> None:
    answer = tumble("convert", "--json")
    rows = {row["name"]: row for row in json.loads(answer.out)}
    assert set(rows) == set(TARGETS)
    assert rows["px4"]["holds"] == "scale factors, biases, temperature, magnetometer"
    assert rows["c"]["directions"] == "to"
    assert "imu-tk" in tumble("convert").out


def test_a_calibration_goes_out_and_comes_back(tumble: Any, calibration: Path, tmp_path: Path) -> None:
    out = tumble("convert", calibration, "--to", "imu-tk", "-o", "both")
    assert out.status == 0
    call = ("convert", tmp_path / "both", "--from", "imu-tk", "--units", "m/s^2,rad/s")
    assert tumble(*call, "-o", "back.json").status == 0
    back, before = read_calibration("back.json"), read_calibration(calibration)
    # In another frame: a turn of the body's axes is what M Mᵀ does not see.
    here, there = (np.array(one.accelerometer.matrix) for one in (back, before))  # type: ignore[union-attr]
    assert np.allclose(here @ here.T, there @ there.T, rtol=0, atol=1e-13)


def test_a_change_of_frame_is_said(tumble: Any, calibration: Path) -> None:
    answer = tumble("convert", calibration, "--to", "kalibr")
    assert "frame accelerometer-x, not in the calibration's fixture" in answer.out
    assert tumble("convert", calibration, "--frame", "accelerometer-z", "-o", "z.json").status == 0
    matrix = np.array(read_calibration("z.json").accelerometer.matrix)  # type: ignore[union-attr]
    assert np.allclose(matrix, np.triu(matrix), atol=1e-15)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("calibration.json",), ("--from TARGET",)),
        (("calibration.json", "--frame", "accelerometer-x", "--units", "g"), ("about reading",)),
        (("calibration.json", "--to", "kalibur"), ("kalibur", "choose one of")),
        (("calibration.json", "--to", "px4", "--from", "px4"), ("exclude",)),
        (("calibration.json", "--to", "px4", "--largest-loss", "10"), ("ppm", "--largest-loss")),
        (("calibration.json", "--to", "px4", "--noise", "n.json"), ("holds no noise",)),
        (("calibration.json", "--to", "kalibr", "--noise", "n.json"), ("no noise file n.json",)),
        (("calibration.json", "--to", "kalibr", "--noise", "calibration.json"), ("no noise.json",)),
        (("calibration.json", "--to", "kalibr", "--frame", "accelerometer-z"), ("only be in the frame",)),
        (("calibration.json", "--to", "kalibr", "--consumer-rate", "2"), ("--noise",)),
        (("calibration.json", "--to", "kalibr", "-o", "calibration.json"), ("one of the inputs",)),
        (("calibration.json", "--frame", "sideways"), ("sideways",)),
        (("calibration.json", "--from", "c"), ("written only", "imu-tk takes any matrix")),
        (("calibration.json", "--from", "kalibr"), ("imu0",)),
        (("--to", "kalibr"), ("calibration.json first",)),
        (("--from", "kalibr"), ("Name the file",)),
        (("nowhere.yaml", "--from", "kalibr"), ("no Kalibr file nowhere.yaml",)),
    ],
)
def test_wrong_usage_is_one_sentence(
    tumble: Any, calibration: Path, arguments: tuple[str, ...], words: tuple[str, ...]
) -> None:
    before = sorted(Path.cwd().iterdir())
    tumble("convert", *arguments).is_told(2, *words)
    assert sorted(Path.cwd().iterdir()) == before


def test_diff_says_what_changed_and_whether_it_matters(
    tumble: Any, calibration: Path, tmp_path: Path
) -> None:
    """0.02 m/s² with 1.4 mm/s² uncertainty: 14 sigmas, some 2,000 µg."""
    other = written(tmp_path / "other.json", 0.12)
    answer = tumble("diff", calibration, other)
    assert answer.status == 1
    for words in ("+14.1", "more than its uncertainty", "less than 0.001 %"):
        assert words in answer.out
    assert tumble("diff", calibration, other, "--allowed", "5000,5000").status == 0
    told = json.loads(tumble("diff", calibration, other, "--json").out)
    assert told["matters"]
    assert told["force"]["value"] == pytest.approx(0.02 / 1.01, rel=0.01)
    same = tumble("diff", calibration, calibration)
    assert same.status == 0
    assert all(words in same.out for words in ("no more than chance", "0 µrad"))
    tumble("convert", calibration, "--frame", "x", "--ros-topic", "y").is_told(2, "--ros-topic goes")
    tumble("diff", calibration, other, "--allowed", "few").is_told(2, "2 numbers")


@pytest.mark.parametrize(
    "option",
    [
        ("--largest-loss", "nan"),
        ("--largest-loss", "-1"),
        ("--consumer-rate", "0"),
    ],
)
def test_numbers_that_no_conversion_can_work_with_are_refused(
    tumble: Any, tmp_path: Path, option: tuple[str, str]
) -> None:
    tumble("convert", tmp_path, "--to", "imu-tk", *option, "-o", tmp_path / "new").is_told(2, option[0])
    assert not (tmp_path / "new").exists()


def test_diff_with_the_truth_says_whether_it_is_recovered(tumble: Any, tmp_path: Path) -> None:
    """The truth is what the simulator drew, by which the estimator was not told; another unit's is far off."""
    for seed in (3, 4):
        tumble("simulate", "hand-held", "--seed", seed, "-o", tmp_path / str(seed), "-q")
    truth = tmp_path / "3" / "truth.json"
    made = tmp_path / "made"
    tumble("calibrate", tmp_path / "3" / "recording.csv", "--site", "45,0", "-o", made, "-q")
    answer = tumble("diff", truth, made)
    assert answer.status == 0
    assert answer.out.startswith("Recovered: all ")
    other = tumble("diff", tmp_path / "4" / "truth.json", made, "-q")
    assert other.status == 1
    assert other.out.startswith("Not recovered: ")
    (tmp_path / "bad.json").write_text('{"format": "tumble truth", "raw_units": [5]}', encoding="utf-8")
    tumble("diff", tmp_path / "bad.json", made).is_told(2, "no truth.json")
    tumble("diff", truth, made, "--allowed", "5,5").is_told(2, "--allowed")
