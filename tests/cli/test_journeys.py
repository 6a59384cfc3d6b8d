"""From a recording to a calibration, to a corrected recording, to a judgement on another session."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from tumble.document import read_calibration

GRAVITY = 9.81
COLUMNS = ["t", "ax", "ay", "az", "gx", "gy", "gz"]


def document_of(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "calibration.json").read_text(encoding="utf-8"))


def by_hand(document: dict[str, Any], rows: np.ndarray) -> np.ndarray:
    """Corrected rows by the formula that stands in the file, without tumble."""
    a, g = document["accelerometer"], document["gyroscope"]
    assert a["quadratic"] is None
    force = np.linalg.solve(np.array(a["matrix"]), (rows[:, 1:4] - a["bias"]).T).T
    rate = rows[:, 4:] - g["bias"]
    if g["g_sensitivity"] is not None:
        rate = rate - force @ np.array(g["g_sensitivity"]).T
    return np.column_stack([rows[:, 0], force, np.linalg.solve(np.array(g["matrix"]), rate.T).T])


# --- calibrate


def test_calibrate_prints_the_parameters_the_verdict_and_where_the_files_are(
    tumble: Any, recording: Path, tmp_path: Path
) -> None:
    answer = tumble("calibrate", recording, "--gravity", GRAVITY, "-o", tmp_path / "results")
    assert answer.status == 0
    assert answer.err == ""
    for word in ("hand-held", "bias", "FIT FOR USE", "calibration.json", "report.html"):
        assert word in answer.out
    assert sorted(p.name for p in (tmp_path / "results").iterdir()) == ["calibration.json", "report.html"]
    page = (tmp_path / "results" / "report.html").read_text(encoding="utf-8")
    assert page.lstrip().lower().startswith("<!doctype html>")
    assert 'src="http' not in page  # one file that works offline


def test_calibrate_json_is_the_document_that_is_written_and_the_same_each_time_but_for_the_date(
    tumble: Any, recording: Path, calibrated: Path, tmp_path: Path
) -> None:
    answer = tumble("calibrate", recording, "--gravity", GRAVITY, "-o", tmp_path / "results", "--json")
    assert answer.status == 0
    first, second = document_of(calibrated), document_of(tmp_path / "results")
    assert json.loads(answer.out) == second
    first.pop("created")
    second.pop("created")
    assert first == second


def test_quiet_prints_the_verdict_only_and_the_folder_is_named_after_the_recording(
    tumble: Any, recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    answer = tumble("calibrate", recording, "--gravity", GRAVITY, "-q")
    assert answer.status == 0
    assert answer.out.startswith("FIT FOR USE")
    assert "bias x" not in answer.out
    assert len(answer.out.splitlines()) <= 4
    assert [p.name for p in tmp_path.iterdir()] == ["tumbled-calibration"]


@pytest.mark.parametrize(
    ("columns", "factor", "options", "fit", "word"),
    [
        (slice(3, 4), 1.0 / 9.80665, ("--units", "counts"), False, "g beside m/s²"),
        (slice(1, 4), 1.13, ("--units", "m/s^2,rad/s"), False, "beyond belief"),
        (slice(1, 4), 1.13, ("--units", "m/s^2,rad/s", "--confirm-scale"), True, "confirmed"),
        (slice(1, 4), 1.08, ("--units", "m/s^2,rad/s"), True, "unusual"),
    ],
)
def test_scale_factors_that_few_or_no_units_have_are_in_the_verdict(
    tumble: Any,
    written: Any,
    rows: np.ndarray,
    tmp_path: Path,
    columns: slice,
    factor: float,
    options: tuple[str, ...],
    fit: bool,
    word: str,
) -> None:
    """A wrong scale fits gravity as well as the right one: residuals cannot show it."""
    other = rows.copy()
    other[:, columns] *= factor
    path = written(tmp_path / "other.csv", other)
    answer = tumble("calibrate", path, "--gravity", GRAVITY, "-o", tmp_path / "results", *options)
    assert answer.status == (0 if fit else 1), answer
    assert ("NOT FIT" in answer.out) == (not fit)
    verdict = document_of(tmp_path / "results")["verdict"]
    assert verdict["fit"] is fit
    assert word in " ".join(verdict["reasons"])


def test_without_a_site_gravity_is_assumed_and_its_uncertainty_is_in_the_scale_factors(
    tumble: Any, recording: Path, tmp_path: Path
) -> None:
    """0.015 m/s² of 9.80665 m/s² is 0.15 % for all three alike; -v prints it, and what each stage took."""
    unit = ("--imu-model", "MPU-9150", "--imu-serial", "no. 7")
    answer = tumble("calibrate", recording, "-o", tmp_path / "r", "-v", *unit)
    for word in ("assumed: ", "reading", "solving", "reporting"):
        assert word in answer.out
    document = document_of(tmp_path / "r")
    assert (document["imu"]["model"], document["imu"]["serial_number"]) == ("MPU-9150", "no. 7")
    assert "assumed" in document["site"]["gravity_source"]
    scale = {
        p["name"]: p["standard_uncertainty"]
        for p in document["parameters"]
        if "accelerometer scale" in p["name"]
    }
    assert len(scale) == 3
    for sigma in scale.values():
        assert 0.0015 < sigma < 0.0017


def test_several_recordings_of_one_unit_are_taken_together(
    tumble: Any, written: Any, sessions: Any, recording: Path, calibrated: Path, tmp_path: Path
) -> None:
    """Two sessions know more than one: every accelerometer parameter's uncertainty falls; in one kind of unit only."""
    rows = sessions(11)
    in_g = written(tmp_path / "in-g.csv", rows / [1.0, *[9.80665] * 3, 1.0, 1.0, 1.0])
    tumble("calibrate", recording, in_g, "-o", tmp_path / "r").is_told(2, "in-g.csv has other units")
    other = written(tmp_path / "other.csv", rows)
    assert tumble("calibrate", recording, other, "--gravity", GRAVITY, "-o", tmp_path / "r", "-q").status == 0
    document = document_of(tmp_path / "r")
    assert [r["name"] for r in document["recordings"]] == ["tumbled.csv", "other.csv"]
    assert document["quality"]["holds"] == 40
    assert document["quality"]["turns"] == 38  # none goes from one recording to the next
    alone = {p["name"]: p["standard_uncertainty"] for p in document_of(calibrated)["parameters"]}
    both = {p["name"]: p["standard_uncertainty"] for p in document["parameters"]}
    assert np.median([both[name] / alone[name] for name in alone if name in both]) < 0.9


@pytest.mark.parametrize(
    ("columns", "step", "word"),
    [(slice(4, 7), 0.02, "at rest gyro"), (slice(1, 4), 0.1, "by themselves they have accelerometer")],
)
def test_files_of_different_units_are_refused(
    tumble: Any,
    written: Any,
    sessions: Any,
    recording: Path,
    tmp_path: Path,
    columns: slice,
    step: float,
    word: str,
) -> None:
    """Other biases in one file: calibrated as one unit, both would be wrong by half of the difference."""
    rows = sessions(11)
    rows[:, columns] += step * np.array([1.0, -0.5, 0.2])
    other = written(tmp_path / "other.csv", rows)
    answer = tumble("calibrate", recording, other, "--gravity", GRAVITY, "-o", tmp_path / "r")
    answer.is_told(2, word, "--turn-ons")


def test_a_file_without_a_hold_is_said_and_not_fit(
    tumble: Any, written: Any, sessions: Any, recording: Path, tmp_path: Path
) -> None:
    """A gyro bias of 0.1 rad/s looks like motion beside a unit that has none."""
    rows = sessions(11)
    rows[:, 4:7] += [0.1, -0.05, 0.02]
    other = written(tmp_path / recording.name, rows)
    answer = tumble("calibrate", recording, other, "--gravity", GRAVITY, "-o", tmp_path / "r")
    assert answer.status == 1, answer
    assert "tumbled.csv (2) gives no hold" in " ".join(document_of(tmp_path / "r")["verdict"]["reasons"])


def test_given_intervals_are_used_instead_of_a_search(tumble: Any, recording: Path, tmp_path: Path) -> None:
    intervals = tmp_path / "holds.txt"
    intervals.write_text("".join(f"{4.1 * k + 0.3} {4.1 * k + 2.3}\n" for k in range(20)))
    answer = tumble(
        "calibrate", recording, "--gravity", GRAVITY, "-o", tmp_path / "r", "--intervals", intervals, "--json"
    )
    assert answer.status == 0
    assert json.loads(answer.out)["quality"]["holds"] == 20


# --- demo


def test_demo_calibrates_the_recording_that_ships_with_the_package(tumble: Any, tmp_path: Path) -> None:
    answer = tumble("demo", "-o", tmp_path / "demo")
    assert answer.status == 0
    assert "FIT FOR USE" in answer.out
    assert "[bold]" not in answer.out
    assert "\\[" not in answer.out
    document = document_of(tmp_path / "demo")
    assert document["imu"]["model"] == "MPU-9150"
    assert (tmp_path / "demo" / "report.html").is_file()


# --- apply


@pytest.mark.parametrize("name", ["corrected.csv", "corrected.parquet"])
def test_apply_corrects_as_the_formula_in_the_file_says(
    tumble: Any, calibrated: Path, recording: Path, tmp_path: Path, name: str
) -> None:
    """Arithmetic: the recording has 7 digits, and both solve the same equations in double precision."""
    answer = tumble("apply", calibrated, recording, "-o", tmp_path / name)
    assert answer.status == 0
    assert answer.err == ""
    read = pl.read_csv if name.endswith("csv") else pl.read_parquet
    corrected = read(tmp_path / name)
    assert corrected.columns[:-1] == COLUMNS  # plain names: m/s² and rad/s
    assert corrected.columns[-1] == f"corrected_by_{read_calibration(calibrated).identity}"
    assert corrected[:, -1].unique().to_list() == [1]
    raw = np.loadtxt(recording, delimiter=",", skiprows=1)
    assert f"{len(raw)} samples corrected" in answer.out
    np.testing.assert_allclose(
        corrected[:, :-1].to_numpy(), by_hand(document_of(calibrated), raw), rtol=1e-10, atol=1e-12
    )


def test_apply_scales_another_unit_of_the_same_kind(
    tumble: Any, written: Any, calibrated: Path, rows: np.ndarray, recording: Path, tmp_path: Path
) -> None:
    """g and deg/s are brought to the calibration's m/s² and rad/s first, and said in the columns' names."""
    other = rows.copy()
    other[:, 1:4] /= 9.80665
    other[:, 4:] = np.degrees(other[:, 4:])
    path = written(
        tmp_path / "other.csv", other, header="t,ax [g],ay [g],az [g],gx [deg/s],gy [deg/s],gz [deg/s]"
    )
    tumble("apply", calibrated, recording, "-o", tmp_path / "si.csv", "-q")
    answer = tumble("apply", calibrated, path, "-o", tmp_path / "other-out.csv", "-q")
    assert answer.status == 0, answer.err
    # The file has seven digits.
    np.testing.assert_allclose(
        pl.read_csv(tmp_path / "other-out.csv").to_numpy(),
        pl.read_csv(tmp_path / "si.csv").to_numpy(),
        atol=2e-5,
    )


def test_apply_refuses_counts_for_a_calibration_in_si(
    tumble: Any, calibrated: Path, written: Any, rows: np.ndarray, tmp_path: Path
) -> None:
    path = written(tmp_path / "counts.csv", np.round(rows * [1, *[1000] * 6], 2))
    answer = tumble("apply", calibrated, path, "--units", "counts", "-o", tmp_path / "out.csv")
    answer.is_told(2, "in counts", r"made for m/s\^2")
    assert not (tmp_path / "out.csv").exists()


def test_apply_writes_csv_or_parquet_only(
    tumble: Any, calibrated: Path, recording: Path, tmp_path: Path
) -> None:
    tumble("apply", calibrated, recording, "-o", tmp_path / "out.xlsx").is_told(2, ".csv or .parquet")


def test_apply_without_an_output_names_the_file_after_the_recording_and_json_tells_it(
    tumble: Any, calibrated: Path, recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    told = json.loads(tumble("apply", calibrated, recording, "--json").out)
    (made,) = tmp_path.iterdir()
    assert made.name == "tumbled-corrected.csv"
    assert Path(told["file"]) == made.resolve()
    assert told["samples"] == len(np.loadtxt(recording, delimiter=",", skiprows=1))


# --- verify


def test_verify_a_good_calibration_on_another_session_serves(
    tumble: Any, written: Any, sessions: Any, calibrated: Path, tmp_path: Path
) -> None:
    other = written(tmp_path / "other.csv", sessions(12))
    answer = tumble("verify", calibrated, other)
    assert answer.status == 0, answer
    assert "SERVES" in answer.out
    assert "DOES NOT" not in answer.out


def test_verify_another_unit_s_calibration_does_not_serve(
    tumble: Any, written: Any, sessions: Any, calibrated: Path, tmp_path: Path
) -> None:
    other = written(tmp_path / "other.csv", sessions(12, unit_seed=101))
    answer = tumble("verify", calibrated, other)
    assert answer.status == 1, answer
    assert "DOES NOT SERVE" in answer.out
    assert "this is another unit" in " ".join(answer.out.split())


def test_verify_finds_a_changed_gyro_though_gravity_is_right(
    tumble: Any, written: Any, sessions: Any, calibrated: Path, tmp_path: Path
) -> None:
    rows = sessions(12)
    rows[:, 4:] *= 1.05
    answer = tumble("verify", calibrated, written(tmp_path / "other.csv", rows))
    assert answer.status == 1, answer
    assert "Over turns the gyro is off" in " ".join(answer.out.split())


def test_verify_json_has_one_result_a_recording_with_the_numbers(
    tumble: Any, written: Any, sessions: Any, calibrated: Path, recording: Path, tmp_path: Path
) -> None:
    other = written(tmp_path / "other.csv", sessions(12, unit_seed=101))
    answer = tumble("verify", calibrated, recording, other, "--json")
    assert answer.status == 1
    first, second = json.loads(answer.out)
    assert (first["recording"], first["fit"]) == ("tumbled.csv", True)
    assert (second["recording"], second["fit"]) == ("other.csv", False)
    norms = np.array(first["hold_norm_error"])
    assert len(norms) == 20
    # 1.7 mm/s² of noise a hold, at five sigma.
    assert np.max(np.abs(norms)) < 9e-3
    angles = [angle for angle in first["turn_angle"] if angle is not None]
    assert 15 <= len(angles) <= 19
    assert np.degrees(np.sqrt(np.mean(np.square(angles)))) < 0.2


def test_verify_at_another_gravity_sees_it(tumble: Any, recording: Path, calibrated: Path) -> None:
    """The sentence names the place as a possible reason: 0.03 m/s² are too much for the noise."""
    answer = tumble("verify", calibrated, recording, "--gravity", 9.77)
    assert answer.status == 1
    answer = tumble("verify", calibrated, recording, "--gravity", GRAVITY)
    assert answer.status == 0


def test_verify_quiet_prints_no_table(tumble: Any, recording: Path, calibrated: Path) -> None:
    answer = tumble("verify", calibrated, recording, "-q")
    assert answer.status == 0
    assert answer.out.startswith("SERVES")
    assert "expected" not in answer.out


def test_verify_of_a_recording_without_holds_to_judge_by_is_refused(
    tumble: Any, written: Any, calibrated: Path, rows: np.ndarray, tmp_path: Path
) -> None:
    """The gyro alone says nothing of gravity."""
    path = written(tmp_path / "gyro.csv", rows[:, [0, 4, 5, 6]], header="t,gx,gy,gz")
    tumble("verify", calibrated, path).is_told(2, "accelerometer")


def test_an_earlier_calibration_is_kept_that_is_of_another_recording_a_papers_or_unreadable(
    tumble: Any, recording: Path, rows: np.ndarray, written: Any, tmp_path: Path
) -> None:
    made = tmp_path / "made"
    made.mkdir()
    joint, paper = made / "calibration.json", made / "calibration-multi-position-9.json"
    (made / "calibration-mine.json").write_text("{}")
    unreadable = b'{"format": "tumble calibration", "version": 99}\r\n\xff'
    joint.write_bytes(unreadable)
    call = ("--gravity", GRAVITY, "-o", made)
    assert tumble("calibrate", recording, *call, "--estimator", "multi-position-9").status == 0
    assert tumble("calibrate", recording, *call).status == 0
    (kept,) = made.glob("calibration-before-*.json")
    assert kept.read_bytes() == unreadable
    before = {unreadable, joint.read_bytes(), paper.read_bytes()}
    answer = tumble("calibrate", written(tmp_path / "other.csv", rows[:-1]), *call)
    assert answer.status == 0
    found = [*made.glob("calibration-before-*.json")]
    assert {one.read_bytes() for one in found} == before
    assert all(one.name in answer.out for one in found if one != kept)
    names = {"calibration.json", "calibration-mine.json", "report.html"}
    assert {path.name for path in made.iterdir()} == names | {one.name for one in found}
