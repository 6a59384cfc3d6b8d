"""`tumble plan` of a test of poses, as a user meets it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

COMMAND = ("plan", "multi-position", "--imu", "tactical", "--site", "48.1")
JIG = """\
format: tumble protocol
version: 1
procedure: multi-position
site: {latitude_deg: 48}
steps:
"""


def jig(path: Path, *ups: str) -> Path:
    steps = "".join(f"  - hold: stop {k}\n    up: {up}\n    seconds: 10\n" for k, up in enumerate(ups, 1))
    path.write_text(JIG + steps, encoding="utf-8")
    return path


def test_a_plan_is_written_simulated_and_calibrated(tumble: Any, tmp_path: Path) -> None:
    """The calibration's own uncertainties are those that the plan foretells."""
    folder = tmp_path / "plan"
    answer = tumble("plan", "multi-position", "--imu", "ring-laser", "--site", "48.1", "--poses", 12, "--hold", 8,
                    "-o", folder, "--json")  # fmt: skip
    assert answer.status == 0, answer
    document = json.loads(answer.out)
    assert {file.name for file in folder.iterdir()} == {"protocol.yaml", "plan.json", "sheet.html"}
    assert document == json.loads((folder / "plan.json").read_text(encoding="utf-8"))
    sheet = (folder / "sheet.html").read_text(encoding="utf-8")
    assert sheet.count('class="box"') == 12
    assert "8 s</b> at rest" in sheet
    assert "<script" not in sheet
    played = tumble("simulate", folder / "protocol.yaml", "--imu", "ring-laser", "-o", tmp_path / "played")
    assert played.status == 0, played
    done = tumble("calibrate", "--protocol", tmp_path / "played" / "protocol.yaml", "-o", tmp_path / "cal")
    assert done.status in (0, 1), done
    calibration = json.loads((tmp_path / "cal" / "calibration.json").read_text(encoding="utf-8"))
    stated = {one["name"]: one["standard_uncertainty"] for one in calibration["parameters"]}
    foretold = {one["name"]: one["standard_uncertainty"] for one in document["parameters"]}
    ratios = [stated[f"accelerometer bias {axis}"] / foretold[f"accelerometer bias {axis}"] for axis in "xyz"]
    assert 0.7 < np.exp(np.mean(np.log(ratios))) < 1.4


def test_the_schemes_of_the_papers_stand_beside_the_plan(tumble: Any) -> None:
    answer = tumble(*COMMAND, "--time", 4)
    assert answer.status == 0, answer
    said = " ".join(answer.out.split())
    for words in ("4.0 min", "nine of Zhang", "twelve edges", "all 26", "non-orthogonality", "ppm", "µg"):
        assert words in said
    assert "six faces: does not determine" in said


def test_a_recording_of_five_faces_wants_the_sixth(tumble: Any, tmp_path: Path) -> None:
    """And a calibration of them all, less one edge, wants poses that are no faces."""
    protocol = jig(tmp_path / "five.yaml", "x", "y", "z", "-y", "-z")
    tumble("simulate", protocol, "--imu", "tactical", "-o", tmp_path / "five")
    answer = tumble(*COMMAND, "--given", tmp_path / "five" / "recording.csv", "-q")
    assert answer.status == 0, answer
    said = " ".join(answer.out.split())
    assert "5 different poses" in said
    assert "Not determined yet" in said
    assert "Next: hold -x up for 30 s" in said


def test_wrong_input_is_refused_in_one_sentence(tumble: Any, tmp_path: Path) -> None:
    for options, words in (
        (("--poses", 8), ("8 poses determine 8 numbers", "9 poses or more")),
        (("--poses", 0), ("--poses 0",)),
        (("--poses", 9, "--time", 5), ("not both",)),
        (("--time", 0.5), ("too short for the 9 poses",)),
        (("--time", 5, "--hold", 9), ("leave --hold out",)),
        (("--targets", "bias=-3"), ("--targets",)),
        (("--given", tmp_path / "none.csv"), ("no such file",)),
        (("--data-sheet", "tactcal"), ("tactical",)),
        (("--turn-seconds", 0), ("--turn-seconds 0",)),
        (("--reach", "sphere"), ("--reach has left",)),
        (("--set", "criterion=D"), ("--criterion has left",)),
    ):
        tumble(*COMMAND, *options).is_told(2, *words)
    tumble("plan", "six-position", "--poses", 9).is_told(2, "six faces")
    file = tmp_path / "file"
    file.write_text("mine", encoding="utf-8")
    tumble(*COMMAND, "-o", file).is_told(2, "is a file")
    assert file.read_text(encoding="utf-8") == "mine"
