"""`tumble simulate` as a user meets it."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

FILES = {"recording.csv", "protocol.yaml", "truth.json"}


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("protocol", ["six-position", "multi-position-26"])
def test_what_it_says_to_type_next_works(
    tumble: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, protocol: str
) -> None:
    """Simulate, then type the line that is printed: a calibration that is fit for use."""
    monkeypatch.chdir(tmp_path)
    answer = tumble("simulate", protocol, "--sample-rate", 50, "--site", "48.1,520", "-o", "trial")
    assert answer.status == 0, answer
    assert answer.err == ""
    following = re.search(r"^Next: tumble (.*)$", answer.out, re.M)
    assert following is not None
    calibrated = tumble(*following[1].split())
    assert calibrated.status == 0, calibrated
    document = json.loads((tmp_path / "trial" / "calibration" / "calibration.json").read_text("utf-8"))
    assert document["procedure"] == "joint"
    assert document["site"]["latitude_deg"] == pytest.approx(48.1)


def test_a_unit_at_rest_is_simulated_and_its_noise_found_by_the_command_printed(
    tumble: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    answer = tumble("simulate", "rest", "--duration", 120, "--sample-rate", 50, "-o", "trial")
    assert answer.status == 0, answer
    assert "gyroscope: N 0.2121 °/√h, B 20 °/h, K 0 °/h/√h" in answer.out
    following = re.search(r"^Next: tumble (noise .*)$", answer.out, re.M)
    assert following is not None
    assert tumble(*following[1].split()).status == 0
    found = json.loads((tmp_path / "trial" / "noise" / "noise.json").read_text("utf-8"))
    truth = json.loads((tmp_path / "trial" / "truth.json").read_text("utf-8"))["noise"]
    assert found["samples_at_rest"] == 6000
    for triad in ("accelerometer", "gyroscope"):
        white, step = (truth[triad][key]["value"] for key in ("random_walk", "resolution"))
        both = (white**2 + step**2 / 12.0 / 50.0) ** 0.5  # the converter's rounding is white, too
        assert found["triads"][triad]["terms"]["N"]["mean_of_variances"] == pytest.approx(both, rel=0.04)


def test_it_prints_the_truth_with_units_and_every_file(tumble: Any, tmp_path: Path) -> None:
    answer = tumble(
        "simulate", "six-position", "--imu", "hg1700", "--sample-rate", 5, "-o", tmp_path / "trial"
    )
    for words in (
        "No site was given",
        "grade hg1700 (seed 0)",
        "accelerometer bias x y z",
        " mg\n",
        "gyro scale factor error x y z",
        "ppm",
        "(six-position, in the frame fixture):",
        "its mean in this session",
        "accelerometer misalignment xy xz yx",
        "mrad",
    ):
        assert words in answer.out
    truth = json.loads((tmp_path / "trial" / "truth.json").read_text("utf-8"))
    named = {row["name"]: row["value"] for row in truth["parameters_in_fixture"]}
    line = re.search(r"^ *gyro scale factor error x y z +(\S+) +(\S+) +(\S+) ppm$", answer.out, re.M)
    assert line is not None
    for text, axis in zip(line.groups(), "xyz", strict=True):
        # six digits are printed
        assert float(text) == pytest.approx(1e6 * named[f"gyro scale factor error {axis}"], rel=1e-5)
    (written,) = re.findall(r"^written: (.*)$", answer.out, re.M)
    assert written.startswith(str((tmp_path / "trial").resolve()))
    assert all(name in written for name in FILES)


def test_parameters_are_printed_in_the_frame_in_which_the_protocol_s_procedure_answers(
    tumble: Any, tmp_path: Path
) -> None:
    answer = tumble("simulate", "multi-position-9", "--sample-rate", 5, "-o", tmp_path / "trial")
    assert "(multi-position, in the frame accelerometer-x):" in answer.out
    assert "rotation between the triads x y z" in answer.out


def test_json_is_the_truth_and_the_files_and_quiet_the_next_command(tumble: Any, tmp_path: Path) -> None:
    answer = tumble("simulate", "six-position", "--sample-rate", 5, "-o", tmp_path, "--json")
    assert answer.status == 0
    said = json.loads(answer.out)
    assert said["truth"] == json.loads((tmp_path / "truth.json").read_text("utf-8"))
    assert {Path(file).name for file in said["files"]} == FILES
    assert said["next"].startswith("tumble calibrate --protocol ")
    quiet = tumble("simulate", "six-position", "--sample-rate", 5, "-o", tmp_path, "-q")
    assert quiet.out == f"Next: {said['next']}\n"
    assert set(contents(tmp_path)) == FILES


def test_another_simulation_in_the_folder_is_kept(tumble: Any, tmp_path: Path) -> None:
    call = ("simulate", "multi-position-9", "--sample-rate", 5, "-o", tmp_path)
    assert tumble(*call, "--seed", 5, "-q").status == 0
    before = contents(tmp_path)
    (tmp_path / "notes.txt").write_text("mine")
    said = tumble(*call).out
    (kept,) = (path for path in tmp_path.iterdir() if path.is_dir())
    assert f"kept in {kept}" in said
    assert contents(kept) == before
    assert {path.name for path in tmp_path.iterdir()} == FILES | {kept.name, "notes.txt"}


def test_without_an_output_the_folder_is_named_after_the_protocol(
    tumble: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert tumble("simulate", "six-position", "--sample-rate", 5, "-q").status == 0
    assert set(contents(tmp_path / "six-position-simulated")) == FILES


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ["sixposition"],
            ["no protocol 'sixposition': give a protocol file", "Did you mean six-position?"],
        ),
        (["six-position", "--imu", "hg170"], ["no IMU grade 'hg170'", "ring-laser", "Did you mean hg1700?"]),
        (["nowhere.yaml"], ["There is no protocol file", "nowhere.yaml"]),
        (["six-position", "--seed", "1.5"], ["--seed 1.5 is no whole number"]),
        (["six-position", "--gravity", "abc"], ["Gravity of 'abc' is no number", "9.80788±0.00002"]),
        (["six-position", "--errors", "none.yaml"], ["no file of errors none.yaml"]),
        (["six-position", "--site", "95"], ["beyond the poles"]),
        (["six-position", "--duration", "60"], ["--duration is for a unit at rest"]),
        (["rest", "--duration", "0"], ["at least one second"]),
        (["res"], ["Did you mean rest?"]),
    ],
)
def test_wrong_usage_is_one_sentence_and_touches_nothing(
    tumble: Any, tmp_path: Path, arguments: list[str], words: list[str]
) -> None:
    tumble("simulate", *arguments, "-o", tmp_path / "new").is_told(2, *words)
    assert contents(tmp_path) == {}


def told(tumble: Any, tmp_path: Path, protocol: str, errors: str) -> Any:
    path = tmp_path / "errors.yaml"
    path.write_text(errors, encoding="utf-8")
    return tumble("simulate", protocol, "--errors", path, "--sample-rate", 50, "-o", tmp_path / "trial")


@pytest.mark.parametrize(
    ("protocol", "errors", "words"),
    [
        ("turntable-9", "table_wobble_arcsec: -1", "a number from 0 to 36000"),
        (
            "turntable-9",
            "table_stops_percent: {99: 60}",
            "stop spin 99 early, and the protocol's last one is number 12",
        ),
        ("six-position", "fixture_zero_mrad: 1", "six-position has no sequence of rotations"),
        ("six-position", "magnetic_dip_deg: 60", "give --magnetometer"),
        ("thermal-soak", "table_tilt_deg: 1", "no table in this chamber"),
    ],
)
def test_errors_that_cannot_be_are_refused_in_a_sentence(
    tumble: Any, tmp_path: Path, protocol: str, errors: str, words: str
) -> None:
    told(tumble, tmp_path, protocol, errors).is_told(2, words)
    assert not (tmp_path / "trial").exists()


def test_errors_of_the_fixture_and_of_the_sensors_reach_the_files(tumble: Any, tmp_path: Path) -> None:
    errors = (
        "fixture_installation_mrad: 1\nfixture_rate_deg_per_s: 90\nfixture_pause_s: 0.5\nasymmetry_ppm: 400\n"
        "angle_pulse_arcsec: 0.5\nvelocity_pulse_mm_per_s: 2\nnoise: false\n"
    )
    answer = told(tumble, tmp_path, "strapdown-rotation", errors)
    assert answer.status == 0, answer
    truth = json.loads((tmp_path / "trial" / "truth.json").read_text("utf-8"))
    assert truth["fixture"]["rate"] == pytest.approx(0.5 * 3.141592653589793)
    assert truth["fixture"]["pause"] == 0.5
    assert truth["fixture"]["orthogonality"] == 0.0
    assert abs(truth["gyroscope"]["asymmetry"][0]) < 2e-3
    rows = (tmp_path / "trial" / "recording.csv").read_text("utf-8").splitlines()[1:]
    for row in rows[100:2000:97]:
        numbers = [float(word) for word in row.split(",")]
        # Whole pulses within an interval of 20 ms: 2 mm/s are 0.1 m/s², 0.5 arc-seconds 1.21e-4 rad/s.
        for value, pulse in zip(numbers[1:], 3 * [0.1] + 3 * [50.0 * 0.5 / 206264.80624709636], strict=True):
            assert value / pulse == pytest.approx(round(value / pulse), abs=1e-6)
