"""`tumble plan` of any protocol, as a user meets it."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

SHORT = """\
format: tumble protocol
version: 1
procedure: turntable
site: {latitude_deg: 48}
steps:
  - hold: first
    up: z
    uncertainty_deg: 3
    seconds: 8
  - spin: there
    axis: x
    rate_deg_per_s: 10
    seconds: 34
    angle_deg: 360
  - hold: second
    seconds: 8
  - turn: by hand
    seconds: 3
  - hold: third
    up: x
    uncertainty_deg: 3
    seconds: 8
"""


@pytest.fixture
def short(tmp_path: Path) -> Path:
    path = tmp_path / "short.yaml"
    path.write_text(SHORT, encoding="utf-8")
    return path


def test_a_protocol_file_is_judged_as_it_is(tumble: Any, short: Path, tmp_path: Path) -> None:
    answer = tumble("plan", short, "--imu", "tactical", "-o", tmp_path / "plan")
    assert answer.status == 0, answer
    said = " ".join(answer.out.split())
    for words in (
        "3 holds, 1 rotations",
        "accelerometer bias",
        "not determined",
        "Not determined better",
        "Next:",
        "mg",
    ):
        assert words in said, words
    assert {one.name for one in (tmp_path / "plan").iterdir()} == {"protocol.yaml", "plan.json", "sheet.html"}
    document = json.loads((tmp_path / "plan" / "plan.json").read_text(encoding="utf-8"))
    assert len(document["parameters"]) == 21
    assert any(not one["told"] and one["standard_uncertainty"] is None for one in document["parameters"])
    assert document["not_told"]
    sheet = (tmp_path / "plan" / "sheet.html").read_text(encoding="utf-8")
    assert sheet.count('class="box"') == 4
    for words in ("counter-clockwise", "1 turns (360°)", "display before", "+x", "angle_deg"):
        assert words in sheet
    assert "<script" not in sheet


def test_what_holds_and_turns_tell_of_a_hand_held_test_is_foretold(tumble: Any) -> None:
    answer = tumble("plan", "hand-held", "--imu", "tactical", "--site", "48", "--poses", 9, "--json")
    assert answer.status == 0, answer
    found = {one["name"]: one for one in json.loads(answer.out)["parameters"]}
    assert len(found) == 21
    # a nominal sample rate, 1 % over the root of three, which a tactical gyro's own part is far below
    assert found["gyro scale factor error x"]["standard_uncertainty"] == pytest.approx(0.0057735, rel=1e-2)


def test_a_stated_sample_rate_is_in_the_gyro_scale_factors_and_in_their_target(tumble: Any) -> None:
    """With a clock of 3000 and one of 0.1 ppm: squares differ by the clocks', which the Earth hardly tells."""
    found, said = {}, {}
    for rate in ("100±0.3", "100±0.00001"):
        answer = tumble(
            *("plan", "multi-position-26", "--imu", "tactical", "--rate", rate),
            *("--targets", "gyro-scale=2000", "--json"),
        )
        assert answer.status == 0, answer
        said[rate] = answer.out
        found[rate] = {
            one["name"]: one["standard_uncertainty"] for one in json.loads(answer.out)["parameters"]
        }
    wide, narrow = found.values()
    for axis in "xyz":
        name = f"gyro scale factor error {axis}"
        assert wide[name] ** 2 - narrow[name] ** 2 == pytest.approx(9e-6, rel=2e-2)
    assert wide["accelerometer bias x"] == pytest.approx(narrow["accelerometer bias x"], rel=1e-6)
    assert "The target is not reached by gyro scale factor error x" in said["100±0.3"]
    assert "All targets are reached" in said["100±0.00001"]


def test_the_next_step_after_a_recording_is_said(tumble: Any, tmp_path: Path) -> None:
    """Four holds are too few for a calibration; with all 26 there is one, and its targets are far."""
    steps = "".join(
        f"  - hold: {up}\n    up: {up}\n    seconds: 5\n    uncertainty_deg: 3\n"
        for up in ("x", "y", "z", "-x")
    )
    few = tmp_path / "few.yaml"
    few.write_text(
        SHORT.split("steps:")[0].replace("turntable", "hand-held") + "steps:\n" + steps, encoding="utf-8"
    )
    tumble("simulate", few, "--imu", "tactical", "-o", tmp_path / "few")
    recording = tmp_path / "few" / "recording.csv"
    answer = tumble("plan", few, "--imu", "tactical", "--given", recording, "-q")
    assert answer.status == 0, answer
    said = " ".join(answer.out.split())
    assert "4 holds" in said
    assert "Not determined yet" in said
    assert "Next: " in said


def test_wrong_input_is_refused_in_one_sentence(tumble: Any, short: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.json"
    other.write_text("{}", encoding="utf-8")
    for arguments, words in (
        (("turntabel-9",), ("turntabel-9", "Did you mean turntable-9?")),
        (("turntable",), ("strapdown-rotation", "multi-position")),
        (("thermal-soak",), ("temperature", "multi-position-9")),
        ((short, "--poses", 9), ("--poses", "a protocol as it is")),
        ((short, "--hold", 9), ("--hold", "leave it out")),
        ((short, "--no-steps"), ("--no-steps has left",)),
        ((short, "--protocol", short), ("--given",)),
        ((short, "--given", tmp_path / "no.csv"), ("no such file",)),
        ((short, "--targets", "gyro-bias=0"), ("--targets", "gyro-bias in °/h")),
        ((short, "--noise", other), ("--noise", "no noise document")),
        ((short, "--imu", "tactcal"), ("tactical",)),
        ((short, "--data-sheet", "nobody"), ("nobody",)),
        ((short, "--seed", -1), ("--seed",)),
        (("multi-position", "--protocol", short), ("--protocol", "multi-position")),
    ):
        tumble("plan", *arguments).is_told(2, *words)
    file = tmp_path / "file"
    file.write_text("mine", encoding="utf-8")
    tumble("plan", short, "-o", file).is_told(2, "is a file")
    assert file.read_text(encoding="utf-8") == "mine"


def test_a_calibration_shows_what_the_plan_beside_its_protocol_predicted(tumble: Any, tmp_path: Path) -> None:
    folder, made = tmp_path / "table", tmp_path / "made"
    unit = ("--imu", "tactical", "--site", "48.14,520")
    assert tumble("simulate", "turntable-9", *unit, "--seed", "3", "-o", folder, "-q").status == 0
    tumble("plan", "turntable-9", *unit, "--rate", "100±0.0001", "-o", tmp_path / "plan", "-q")
    (tmp_path / "plan" / "plan.json").rename(folder / "plan.json")
    answer = tumble("calibrate", "--protocol", folder / "protocol.yaml", "-o", made)
    said = " ".join(answer.out.split())
    found = re.search(r"median uncertainty is ([\d.]+) times the predicted one", said)
    assert found is not None, said
    assert 0.7 < float(found[1]) < 1.5
    page = (made / "report.html").read_text(encoding="utf-8")
    assert "achieved over predicted" in page
