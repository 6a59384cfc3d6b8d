"""The strapdown rotation test as a user meets it: simulated, a file a sequence, calibrated, read."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from tumble.protocol import read_protocol, sequence_steps
from tumble.protocol.file import write_protocol


@pytest.fixture(scope="module")
def folder(tumble: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("strapdown") / "fixture"
    errors = folder.parent / "errors.yaml"
    errors.write_text("fixture_zero_mrad: 1\nfixture_mounting_mrad: 1\n", encoding="utf-8")
    answer = tumble(
        "simulate", "strapdown-rotation", "--imu", "tactical", "--sample-rate", 50, "--site", "48.1,520", "--seed", 2,
        "--errors", errors, "-o", folder,
    )  # fmt: skip
    assert answer.status == 0, answer
    cut_by_sequence(folder)
    return folder


def cut_by_sequence(folder: Path) -> None:
    """Make the recording a file a sequence, as of a fixture that is moved anyhow in between."""
    protocol, truth = (
        read_protocol(folder / "protocol.yaml"),
        json.loads((folder / "truth.json").read_text("utf-8")),
    )
    rows, steps = pl.read_csv(folder / "recording.csv"), list(protocol.steps)
    for number, sequence in enumerate(sequence_steps(protocol), 1):
        span = [truth["steps"][sequence.start]["start_s"], truth["steps"][sequence.end]["stop_s"]]
        rows.filter(pl.col("t").is_between(*span)).write_csv(folder / f"step-{number:02d}.csv")
        for step in range(sequence.start, sequence.end + 1):
            steps[step] = replace(steps[step], file=f"step-{number:02d}.csv")
    (folder / "recording.csv").unlink()
    write_protocol(replace(protocol, recordings=(), steps=tuple(steps)), folder / "protocol.yaml")


def test_a_file_a_sequence_is_calibrated_to_the_truth_of_its_own_frame(
    tumble: Any, folder: Path, tmp_path: Path
) -> None:
    assert len(list(folder.glob("step-*.csv"))) == 17
    answer = tumble("calibrate", "--protocol", folder / "protocol.yaml", "-o", tmp_path)
    assert answer.status == 0, answer
    document = json.loads((tmp_path / "calibration.json").read_text("utf-8"))
    assert document["procedure"] == "joint"
    assert document["frame"]["name"] == "mean-gyro"
    truth = json.loads((folder / "truth.json").read_text("utf-8"))
    wanted = {row["name"]: row["value"] for row in truth["parameters_in_mean_gyro"]}
    told = {row["name"]: row for row in document["parameters"]}
    looked_at = 0
    for name, row in told.items():
        if "bias" in name or "sensitivity" in name:
            continue  # a bias wanders from what was drawn
        error = (row["value"] - wanted.get(name, 0.0)) / row["standard_uncertainty"]
        assert abs(error) < 4.5, name  # by chance once in 150,000
        looked_at += 1
    assert looked_at >= 21


def test_a_file_that_is_gone_is_told_by_its_name(tumble: Any, folder: Path, tmp_path: Path) -> None:
    for path in folder.iterdir():
        if path.is_file() and path.name != "step-01.csv":
            (tmp_path / path.name).write_bytes(path.read_bytes())
    answer = tumble("calibrate", "--protocol", tmp_path / "protocol.yaml", "-o", tmp_path / "out")
    answer.is_told(2, "step-01.csv")
    assert "Traceback" not in answer.err
    assert not (tmp_path / "out").exists()


def test_without_a_protocol_it_is_said_what_is_needed(tumble: Any, folder: Path, tmp_path: Path) -> None:
    answer = tumble(
        "calibrate", folder / "step-01.csv", "--procedure", "strapdown-rotation", "--gravity", 9.81,
        "-o", tmp_path / "out",
    )  # fmt: skip
    assert answer.status != 0
    assert "--protocol" in answer.err
    assert not (tmp_path / "out").exists()


def test_gyros_in_degrees_that_are_called_radians_are_not_fit_for_use(
    tumble: Any, folder: Path, tmp_path: Path
) -> None:
    for path in folder.iterdir():
        if path.suffix == ".csv":
            lines = path.read_text("utf-8").splitlines()
            values = np.loadtxt(lines[1:], delimiter=",")
            values[:, 4:7] = np.degrees(values[:, 4:7])
            rows = [",".join(f"{value:.10g}" for value in row) for row in values]
            (tmp_path / path.name).write_text("\n".join([lines[0], *rows, ""]), encoding="utf-8")
        elif path.name == "protocol.yaml":
            (tmp_path / path.name).write_bytes(path.read_bytes())
    answer = tumble("calibrate", "--protocol", tmp_path / "protocol.yaml", "-o", tmp_path / "out")
    assert "Traceback" not in answer.err
    assert answer.status != 0, answer
    assert "deg/s" in answer.err + answer.out
