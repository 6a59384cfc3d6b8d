"""Every input that is no recording, or contradicts itself, ends in one sentence, status 2, and nothing written."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

Change = Callable[[np.ndarray], None]


def spoiled(change: Change) -> Callable[[np.ndarray], np.ndarray]:
    def spoil(rows: np.ndarray) -> np.ndarray:
        changed = rows.copy()
        change(changed)
        return changed

    return spoil


def unchanged(_: np.ndarray) -> None:
    """A good recording, of which something wrong is said."""


def constant_time(rows: np.ndarray) -> None:
    rows[:, 0] = 5.0


def backward_time(rows: np.ndarray) -> None:
    rows[:, 0] = rows[::-1, 0].copy()


def jump_back(rows: np.ndarray) -> None:
    rows[1000:, 0] -= 10.0


def zeros(rows: np.ndarray) -> None:
    rows[:, 1:] = 0.0


def in_g(rows: np.ndarray) -> None:
    rows[:, 1:4] /= 9.80665


def in_degrees(rows: np.ndarray) -> None:
    rows[:, 4:] = np.degrees(rows[:, 4:])


def swapped_triads(rows: np.ndarray) -> None:
    rows[:, 1:] = rows[:, [4, 5, 6, 1, 2, 3]]


def left_handed_gyro(rows: np.ndarray) -> None:
    rows[:, 6] *= -1.0


def swapped_gyro_axes(rows: np.ndarray) -> None:
    rows[:, [4, 5]] = rows[:, [5, 4]]


def turned_gyro_axes(rows: np.ndarray) -> None:
    rows[:, 4:] = rows[:, [5, 6, 4]]


def left_handed_accelerometer(rows: np.ndarray) -> None:
    rows[:, 1] *= -1.0


def reversed_gyro(rows: np.ndarray) -> None:
    rows[:, 4:] *= -1.0


DECLARED = ("--units", "m/s^2,rad/s")


@pytest.mark.parametrize(
    ("change", "options", "words"),
    [
        pytest.param(constant_time, (), ["time column never changes", "--rate"], id="constant time"),
        pytest.param(backward_time, (), ["line 3", "time steps back"], id="time running backward"),
        pytest.param(jump_back, (), ["line 1002", "19.99 to 10.01", "Split"], id="time stepping back"),
        pytest.param(zeros, (), ["all zeros", "switched on"], id="all zeros"),
        pytest.param(in_g, DECLARED, ["0.101 times gravity", "--units g"], id="g declared as m/s²"),
        pytest.param(unchanged, ("--units", "g,rad/s"), ["look like m/s^2: give --units m/s^2"], id="m/s² as g"),
        pytest.param(unchanged, ("--units", "m/s^2,deg/s"), ["looks like rad/s: say so"], id="rad/s as deg/s"),
        pytest.param(in_degrees, DECLARED, ["declared to be in rad/s", "deg/s", "--units"], id="degrees for radians"),
        pytest.param(swapped_triads, (), ["triads seem exchanged", "--columns"], id="swapped triads"),
        pytest.param(left_handed_gyro, (), ["contradict", "gx, gy, -gz", "--columns"], id="left-handed gyro"),
        pytest.param(swapped_gyro_axes, (), ["contradict", "gy, gx, gz", "--columns"], id="swapped gyro axes"),
        pytest.param(turned_gyro_axes, (), ["contradict", "gy, gz, gx", "--columns"], id="permuted gyro axes"),
        pytest.param(left_handed_accelerometer, (), ["contradict", "--columns"], id="left-handed accelerometer"),
        pytest.param(reversed_gyro, (), ["contradict", "-gx, -gy, -gz"], id="gyro reversed in all axes"),
    ],
)  # fmt: skip
def test_a_recording_that_contradicts_itself_is_refused(
    tumble: Any,
    written: Any,
    rows: np.ndarray,
    tmp_path: Path,
    change: Change,
    options: tuple[str, ...],
    words: list[str],
) -> None:
    path = written(tmp_path / "spoiled.csv", spoiled(change)(rows))
    tumble("calibrate", path, "--gravity", 9.81, "-o", tmp_path / "results", *options).is_told(2, *words)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["spoiled.csv"]


def test_following_the_advice_on_the_columns_is_enough(
    tumble: Any, written: Any, rows: np.ndarray, tmp_path: Path
) -> None:
    """The refusal of a left-handed gyro names the columns; declared so, the recording serves."""
    path = written(tmp_path / "spoiled.csv", spoiled(left_handed_gyro)(rows))
    refused = tumble("calibrate", path, "--gravity", 9.81, "-o", tmp_path / "results")
    named = re.search(r"gyro's columns (\S+, \S+, \S+) with", refused.err)
    assert named is not None
    columns = "t,ax,ay,az," + named.group(1).replace(" ", "")
    answer = tumble(
        "calibrate", path, "--gravity", 9.81, "-o", tmp_path / "results", "--columns", columns, "-q"
    )
    assert answer.status == 0, answer


@pytest.mark.parametrize(
    ("content", "words"),
    [
        pytest.param(b"", ["is empty"], id="an empty file"),
        pytest.param(b"t,ax,ay,az,gx,gy,gz\n", ["header but no rows"], id="a header only"),
        pytest.param(b"The unit lay on the table,\nand nobody turned it.\n" * 30, ["text without rows"], id="prose"),
        pytest.param(np.random.default_rng(1).bytes(5000), ["binary"], id="binary"),
        pytest.param(b"t,ax\n" + b"".join(b"%d,1.5\n" % k for k in range(50)), ["no ay and az"], id="two columns"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("command", ["calibrate", "apply", "verify"])
def test_what_is_no_recording_is_refused_by_every_command(
    tumble: Any, calibrated: Path, tmp_path: Path, command: str, content: bytes, words: list[str]
) -> None:
    path = tmp_path / "input.csv"
    path.write_bytes(content)
    output = tmp_path / ("results" if command == "calibrate" else "corrected.csv")
    tumble(*call(command, calibrated, path, output)).is_told(2, "input.csv", *words)
    assert [p.name for p in tmp_path.iterdir()] == ["input.csv"]


def call(command: str, calibrated: Path, path: Path, output: Path) -> list[object]:
    before = [] if command == "calibrate" else [calibrated]
    return [command, *before, path, *([] if command == "verify" else ["-o", output])]


@pytest.mark.parametrize("command", ["calibrate", "apply", "verify"])
def test_a_folder_and_a_missing_file_are_told_apart(
    tumble: Any, calibrated: Path, tmp_path: Path, command: str
) -> None:
    folder = tmp_path / "a-folder"
    folder.mkdir()
    tumble(*call(command, calibrated, folder, tmp_path / "out.csv")).is_told(2, "is a folder")
    tumble(*call(command, calibrated, tmp_path / "absent.csv", tmp_path / "out.csv")).is_told(
        2, "does not exist"
    )
    assert [p.name for p in tmp_path.iterdir()] == ["a-folder"]


def test_what_gravity_and_turns_cannot_show_is_stated_as_unchecked(calibrated: Path) -> None:
    """Both triads right-handed and consistent: all accelerometers reversed together look the same."""
    document = json.loads((calibrated / "calibration.json").read_text())
    assert any("cannot be seen" in remark and "sign of gravity" in remark for remark in document["remarks"])


def test_one_pose_is_refused_with_the_poses_that_are_needed(
    tumble: Any, written: Any, rows: np.ndarray, tmp_path: Path
) -> None:
    still = np.column_stack([np.arange(3000) / 50.0, rows[np.arange(3000) % 100, 1:]])
    answer = tumble("calibrate", written(tmp_path / "still.csv", still), "-o", tmp_path / "results")
    answer.is_told(2, "determine nothing of the accelerometers", "a hold with z up")
    assert not (tmp_path / "results").exists()


def test_six_poses_for_nine_unknowns_are_not_fit_and_serve_with_a_prior(
    tumble: Any, written: Any, sessions: Any, calibrated: Path, tmp_path: Path
) -> None:
    """The verdict names --prior; with the earlier calibration of the same unit the six poses serve."""
    six = written(tmp_path / "six.csv", sessions(5, faces_only=True))
    alone = tumble("calibrate", six, "--gravity", 9.81, "-o", tmp_path / "alone")
    assert alone.status == 1, alone
    said = " ".join(alone.out.split())
    assert "6 different poses were found and 9 are needed" in said
    assert "--prior" in said
    answer = tumble(
        "calibrate", six, "--gravity", 9.81, "-o", tmp_path / "results", "--prior", calibrated, "--json"
    )
    assert answer.status == 0, answer.err
    now = {p["name"]: p for p in json.loads(answer.out)["parameters"]}
    before = json.loads((calibrated / "calibration.json").read_text())
    for parameter in before["parameters"]:
        if parameter["name"].startswith("accelerometer non-orthogonality"):
            again = now[parameter["name"]]
            # Six norms say nothing of the angles, turns between them little: they stay what the prior says.
            sigma = parameter["standard_uncertainty"]
            assert again["value"] == pytest.approx(parameter["value"], abs=0.5 * sigma)
            assert 0.5 * sigma < again["standard_uncertainty"] < 1.001 * sigma
        if parameter["name"].startswith("accelerometer"):
            off = now[parameter["name"]]["value"] - parameter["value"]
            both = np.hypot(parameter["standard_uncertainty"], now[parameter["name"]]["standard_uncertainty"])
            assert abs(off) < 4.0 * both, parameter["name"]


def test_a_prior_that_states_no_uncertainty_is_refused(
    tumble: Any, recording: Path, calibrated: Path, tmp_path: Path
) -> None:
    document = json.loads((calibrated / "calibration.json").read_text())
    document.update(covariance=[], covariance_parameters=[])
    prior = tmp_path / "prior.json"
    prior.write_text(json.dumps(document))
    answer = tumble("calibrate", recording, "-o", tmp_path / "results", "--prior", prior)
    answer.is_told(2, "covariance", "--prior")
    document = json.loads((calibrated / "calibration.json").read_text())
    document["covariance"] = (0.0 * np.array(document["covariance"])).tolist()
    prior.write_text(json.dumps(document))
    tumble("calibrate", recording, "-o", tmp_path / "results", "--prior", prior).is_told(2, "no uncertainty")
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--site", "here"], ["--site here", "48.1,520"]),
        (["--site", "95"], ["beyond the poles"]),
        (["--site", "48,20000"], ["height"]),
        (["--gravity", "1"], ["nowhere on the Earth"]),
        (["--gravity", "nan"], ["Gravity"]),
        (["--gravity", "heavy"], ["--gravity"]),
        (["--site", "0", "--gravity", "9.83"], ["contradicts"]),
        (["--rate", "-1"], ["--rate", "positive"]),
        (["--rate", "nan"], ["--rate", "positive"]),
        (["--units", "furlong"], ["furlong"]),
        (["--columns", "t,ax,ay"], ["--columns"]),
        (["--columns", "t,ax,ay,az,gx,gy,qq"], ["qq"]),
        (["--procedure", "turntable"], ["turntable", "table", "--protocol", "simulate turntable-9 -o"]),
        (["--procedure", "laboratory"], ["laboratory", "table", "--protocol", "simulate laboratory -o"]),
        (["--procedure", "rate-table"], ["rate-table", "table", "--protocol"]),
        (["--procedure", "guess"], ["no procedure", "hand-held"]),
        (["--intervals", "absent.txt"], ["absent.txt", "list of intervals"]),
        (["--prior", "absent.json"], ["no calibration absent.json"]),
        (["--wrong"], ["No such option", "tumble calibrate --help"]),
        (["--gravity"], ["--gravity", "--help"]),
    ],
    ids=" ".join,
)
def test_a_wrong_option_is_one_sentence_and_nothing_is_written(
    tumble: Any, recording: Path, tmp_path: Path, arguments: list[str], words: list[str]
) -> None:
    tumble("calibrate", recording, "-o", tmp_path / "results", *arguments).is_told(2, *words)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "arguments", [["calibrate"], ["wrong"], ["apply", "only-one"], ["verify", "only-one"], ["demo", "extra"]]
)
def test_a_wrong_call_is_one_sentence(tumble: Any, arguments: list[str]) -> None:
    tumble(*arguments).is_told(2, "--help")


@pytest.mark.parametrize("command", ["apply", "verify"])
@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, ["There is no calibration"]),
        (b'{"format": "tumble calibration", "version": 1, "acc', ["cannot be read as a calibration"]),
        (b'{"format": "tumble calibration", "version": 1}', ["is damaged"]),
    ],
)
def test_what_is_no_calibration_is_refused(
    tumble: Any, recording: Path, tmp_path: Path, command: str, content: bytes | None, words: list[str]
) -> None:
    path = tmp_path / "calibration.json"
    if content is not None:
        path.write_bytes(content)
    output = ["-o", tmp_path / "out.csv"] if command == "apply" else []
    tumble(command, path, recording, *output).is_told(2, "calibration.json", *words)
    assert not (tmp_path / "out.csv").exists()


def test_a_text_without_motion_has_no_holds_to_calibrate_from(
    tumble: Any, written: Any, tmp_path: Path
) -> None:
    """Never at rest: 40 s of shaking, as of a unit in a washing machine."""
    rng = np.random.default_rng(1)
    time = np.arange(2000) / 50.0
    force = np.column_stack([9.81 * np.ones(2000), np.zeros((2000, 2))]) + 5.0 * rng.standard_normal(
        (2000, 3)
    )
    shaken = np.column_stack([time, force, 2.0 * rng.standard_normal((2000, 3))])
    tumble("calibrate", written(tmp_path / "shaken.csv", shaken), "-o", tmp_path / "results").is_told(2)
    assert not (tmp_path / "results").exists()


def test_a_wrong_sampling_rate_is_no_calibration_in_counts(
    tumble: Any, recording: Path, tmp_path: Path
) -> None:
    """Half of the true rate makes the gyro's numbers twice as large as rad/s: no unit is so, and it is said."""
    rows = np.loadtxt(recording, delimiter=",", skiprows=1)
    steps = np.diff(rows[:, 0])
    path = tmp_path / "bare.csv"
    np.savetxt(path, rows[:, 1:7], delimiter=",", header="ax,ay,az,gx,gy,gz", comments="")
    half = 0.5 / float(np.median(steps))
    answer = tumble("calibrate", path, "--gravity", 9.81, "--rate", half, "-o", tmp_path / "out")
    assert answer.status == 1
    assert answer.out.startswith("NOT FIT FOR USE")
    assert "the sampling rate is not" in " ".join(answer.out.split())
