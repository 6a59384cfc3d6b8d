"""`tumble inspect` as a user meets it: what it prints, saves and returns."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from tumble.errors import UsageError
from tumble.recording import read_recording
from tumble.workflows.inspect import inspect


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    """Run the program in this process; returns exit status, standard output and standard error."""
    from tumble.cli.main import main

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["tumble", "inspect", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        printed = capsys.readouterr()
        return int(ended.value.code or 0), printed.out, printed.err

    return call


def test_it_says_what_it_found_and_assumed(run, tumbled, csv) -> None:
    status, out, err = run(
        csv(tumbled.rows() / np.array([0.001, 1, 1, 1, np.pi / 180, np.pi / 180, np.pi / 180]))
    )
    assert (status, err) == (0, "")
    for part in (
        "4050 samples in 40.49 s, 100 Hz",
        "m/s^2",
        "deg/s",
        "assumed",
        "unchecked",
        "Good for\n  • Calibration of the accelerometers and gyros. Procedure hand-held: 12 holds and 11 turns",
        "Missing",
    ):
        assert part in out


def test_json_is_one_object_with_everything(run, tumbled, csv) -> None:
    path = csv(tumbled.rows())
    status, out, _ = run(path, "--json")
    said = json.loads(out)
    assert status == 0
    assert (said["format"], said["version"]) == ("tumble inspection", 1)
    assert said["recordings"][0]["name"] == path.name
    assert said["streams"]["angular_rate"] == {"unit": "rad/s"}
    assert {r["kind"] for r in said["remarks"]} <= {"found", "assumed", "mended", "unchecked"}
    assert (said["samples"], said["quiet_stretches"], said["gaps"]) == (4050, 12, [])


def test_quiet_prints_warnings_only(run, tumbled, csv) -> None:
    rows = tumbled.rows().copy()
    assert run(csv(rows), "-q")[1] == ""
    rows[:, [4, 5]] = rows[:, [5, 4]]
    assert "the rate about x seems to stand in gy" in run(csv(rows), "-q")[1]
    assert "For a calibration without a protocol: both triads, nine or more poses" in run(csv(rows))[1]


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_save_converts(run, tumbled, csv, tmp_path, ending) -> None:
    rows = tumbled.rows() / np.array([0.001, 9.80665, 9.80665, 9.80665, 1, 1, 1])
    target = tmp_path / f"saved{ending}"
    status, out, _ = run(csv(rows, decimals=9), "--save", target)
    assert status == 0
    assert f"Saved as {target}" in out
    back = read_recording(target)
    assert (back.specific_force_unit, back.angular_rate_unit) == ("g", "rad/s")
    assert np.abs(back.specific_force - rows[:, 1:4]).max() < 1e-9  # nine decimals were written


def test_a_saved_csv_keeps_units_that_would_be_judged_otherwise(run, tumbled, csv, tmp_path) -> None:
    """A gyro in rad/s that turns faster than 40 rad/s would be taken as deg/s without its unit."""
    rows = tumbled.rows()
    rows[:, 4:] *= 50.0 / np.abs(rows[:, 4:]).max()
    rows[:, 1:4] = [0.1, -0.2, 9.8] + 0.01 * np.random.default_rng(1).normal(size=(len(rows), 3))
    header = "t,ax,ay,az,gx [rad/s],gy [rad/s],gz [rad/s]"
    run(csv(rows, header=header), "--save", tmp_path / "saved.csv")
    assert (
        (tmp_path / "saved.csv").read_text().startswith("t [s],ax [m/s^2],ay [m/s^2],az [m/s^2],gx [rad/s],")
    )
    back = read_recording(tmp_path / "saved.csv")
    assert back.angular_rate_unit == "rad/s"
    assert not any("taken as" in r.text for r in back.remarks)


@pytest.mark.parametrize(
    ("content", "match"),
    [(b"", "is empty"), (b"Dear all,\nnothing here.\n", "text without rows"), (b"t,ax,ay,az\n", "no rows")],
)
def test_a_bad_file_ends_with_one_sentence_and_status_2(run, tmp_path, content, match) -> None:
    path = tmp_path / "bad.csv"
    path.write_bytes(content)
    status, out, err = run(path, "--save", tmp_path / "saved.csv")
    assert (status, out) == (2, "")
    assert match in err
    assert "Traceback" not in err
    assert list(tmp_path.iterdir()) == [path]


def test_a_saving_that_fails_ends_with_status_3(run, tumbled, csv, tmp_path) -> None:
    status, _, err = run(csv(tumbled.rows()), "--save", tmp_path / "nowhere" / "saved.csv")
    assert status == 3
    assert "does not exist" in err


def test_the_recording_itself_is_never_overwritten(tumbled, csv) -> None:
    path = csv(tumbled.rows())
    before = path.read_bytes()
    with pytest.raises(UsageError, match="is the recording itself"):
        inspect(path, save=Path(path.parent / "." / path.name))
    assert path.read_bytes() == before
