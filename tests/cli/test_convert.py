"""`tumble convert` and `diff` as a user meets them."""

from pathlib import Path

import numpy as np
import pytest
from msgspec import structs
from tests.cli.program import Bench
from tests.unit.export import a_unit

from tumble.document import read_calibration
from tumble.export import targets
from tumble.sensor import ImuModel, Triad

MATRIX = np.array([[1.01, 0.002, -0.003], [-0.001, 0.99, 0.004], [0.003, -0.002, 1.02]])


def write(path: Path, bias: float) -> None:
    """A calibration whose biases are known to 1 mm/s² and 1 mrad/s."""
    triad = Triad(MATRIX, np.array([bias, -0.2, 0.05]))
    document = a_unit.document(ImuModel(triad, triad))
    names = [f"{t}.bias[{i}]" for t in ("accelerometer", "gyroscope") for i in range(3)]
    known = {"covariance_parameters": names, "covariance": (1e-6 * np.eye(6)).tolist()}
    structs.replace(document, **known).write(path)


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    write(tmp_path / "calibration.json", 0.1)
    write(tmp_path / "other.json", 0.12)
    return Bench(tmp_path)


def matrix(bench: Bench, name: str) -> np.ndarray:
    triad = read_calibration(bench.folder / name).accelerometer
    return np.array(triad.matrix)


def test_without_arguments_all_targets_are_listed(bench: Bench) -> None:
    rows = {row["name"]: row for row in bench("convert --json").json}
    assert set(rows) == set(targets())
    assert rows["px4"]["holds"] == "scale factors, biases, temperature, magnetometer"
    assert rows["c"]["directions"] == "to"
    assert "imu-tk" in bench("convert").out


def test_a_calibration_goes_out_and_comes_back_and_a_change_of_frame_is_said(bench: Bench) -> None:
    bench("convert calibration.json --to imu-tk -o both")
    bench("convert both --from imu-tk --units m/s^2,rad/s -o back.json")
    # In another frame: a turn of the body's axes is what M Mᵀ does not see.
    here, there = matrix(bench, "back.json"), matrix(bench, "calibration.json")
    assert np.allclose(here @ here.T, there @ there.T, rtol=0, atol=1e-13)
    said = bench("convert calibration.json --to kalibr").out
    assert "frame accelerometer-x, not in the calibration's fixture" in said
    bench("convert calibration.json --frame accelerometer-z -o z.json")
    upper = matrix(bench, "z.json")
    assert np.allclose(upper, np.triu(upper), atol=1e-15)


def test_diff_says_what_changed_and_whether_it_matters(bench: Bench) -> None:
    """0.02 m/s² with 1.4 mm/s² uncertainty: 14 sigmas, some 2,000 µg."""
    answer = bench("diff calibration.json other.json", status=1)
    for words in ("+14.1", "more than its uncertainty", "less than 0.001 %"):
        assert words in answer.out
    bench("diff calibration.json other.json --allowed 5000,5000")
    told = bench("diff calibration.json other.json --json", status=1).json
    assert told["matters"]
    assert told["force"]["value"] == pytest.approx(0.02 / 1.01, rel=0.01)
    same = bench("diff calibration.json calibration.json")
    assert all(words in same.out for words in ("no more than chance", "0 µrad"))


def test_diff_with_the_truth_says_whether_it_is_recovered(bench: Bench) -> None:
    """The truth is what the simulator drew, by which the estimator was not told; another unit's is far off."""
    for seed in "34":
        bench(f"simulate hand-held --seed {seed} -o {seed} -q")
    bench("calibrate 3/recording.csv --site 45,0 -o made -q")
    assert bench("diff 3/truth.json made").out.startswith("Recovered: all ")
    assert bench("diff 4/truth.json made -q", status=1).out.startswith("Not recovered: ")
    bench.put("bad.json", '{"format": "tumble truth", "raw_units": [5]}')
    bench.refuses("diff bad.json made", "no truth.json")
    bench.refuses("diff 3/truth.json made --allowed 5,5", "--allowed")
