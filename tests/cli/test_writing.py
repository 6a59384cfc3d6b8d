"""Results that cannot be written, or whose writing is interrupted: earlier ones stay intact, no part is left."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Start = Callable[..., subprocess.Popen[str]]
EARLIER = {"calibration.json": '{"earlier": "calibration"}\n', "report.html": "<p>earlier report</p>\n"}


def put_earlier(folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    for name, text in EARLIER.items():
        (folder / name).write_text(text)


def contents(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text(errors="replace") for path in folder.iterdir()}


# --- places that cannot be written to; the tests may run as root, whom permissions do not stop


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="this system has no /proc")
def test_a_folder_that_the_system_does_not_allow(tumble: Any) -> None:
    tumble("demo", "-o", "/proc/tumble").is_told(3, "/proc/tumble cannot be made or written to")


@pytest.mark.parametrize(
    "call",
    ["calibrate {0} --gravity 9.81", "simulate six-position --sample-rate 5", "predict {1}", "apply {1} {0}"],
)
def test_a_folder_that_is_a_file_or_under_one(
    tumble: Any, recording: Path, calibrated: Path, tmp_path: Path, call: str
) -> None:
    file = tmp_path / "file"
    file.write_text("precious")
    arguments = call.format(recording, calibrated).split()
    tumble(*arguments, "-o", file).is_told(2, "is a file: give a folder")
    tumble(*arguments, "-o", file / "results").is_told(
        3, f"{file / 'results'} cannot be made: {file} is no folder"
    )
    assert contents(tmp_path) == {"file": "precious"}


@pytest.mark.parametrize("name", ["corrected.csv", "corrected.parquet"])
def test_a_corrected_recording_that_cannot_be_written(
    tumble: Any, recording: Path, calibrated: Path, tmp_path: Path, name: str
) -> None:
    tumble("apply", calibrated, recording, "-o", tmp_path / "absent" / name).is_told(3, "does not exist")
    file = tmp_path / "file"
    file.write_text("precious")
    tumble("apply", calibrated, recording, "-o", file / name).is_told(3, "could not be written")
    assert contents(tmp_path) == {"file": "precious"}


def test_a_folder_without_permission(tumble: Any, recording: Path, tmp_path: Path) -> None:
    folder = tmp_path / "results"
    put_earlier(folder)
    folder.chmod(0o555)
    try:
        if os.access(folder, os.W_OK):
            pytest.skip("this user may write anywhere (root): permissions stop nothing")
        tumble("calibrate", recording, "--gravity", 9.81, "-o", folder).is_told(
            3, "cannot be made or written to"
        )
    finally:
        folder.chmod(0o755)
    assert contents(folder) == EARLIER


# --- Ctrl-C


def stopped(process: subprocess.Popen[str]) -> str:
    """Wait for the end; return what stands on stderr, which is one line."""
    _, err = process.communicate(timeout=60)
    assert "Traceback" not in err, err
    assert len(err.splitlines()) == 1, err
    assert "Stopped" in err
    return err


# Sends Ctrl-C from inside, at the N-th call of a function of os that writing goes through.
AT_CALL = """
import os, signal
def interrupt(name, at, calls=[0]):
    real = getattr(os, name)
    def call(*arguments, **options):
        calls[0] += 1
        if calls[0] == at:
            os.kill(os.getpid(), signal.SIGINT)
        return real(*arguments, **options)
    setattr(os, name, call)
interrupt({name!r}, {at})
"""


AFTER_WRITING = """
import os, signal
import tumble.workflows.calibrate as workflow
real = workflow.write_run
def write_and_stop(*arguments, **options):
    made = real(*arguments, **options)
    os.kill(os.getpid(), signal.SIGINT)
    return made
workflow.write_run = write_and_stop
"""


@pytest.mark.parametrize(
    ("call", "at"),
    [
        ("calibrate {recording} --gravity 9.81", 2),
        ("apply {calibrated} {recording}", "corrected.csv"),
        ("apply {calibrated} {recording}", "corrected.parquet"),
        ("simulate six-position --sample-rate 5", 3),
        ("reproduce hayal-4.2", 3),
    ],
)
def test_ctrl_c_while_writing_leaves_the_earlier_results_and_no_part(
    tumble: Any, start: Start, recording: Path, calibrated: Path, tmp_path: Path, call: str, at: int | str
) -> None:
    """All files are written beside their places before any takes its place; without earlier ones none is left."""
    output = tmp_path / at if isinstance(at, str) else tmp_path / "results"
    arguments = (*call.format(recording=recording, calibrated=calibrated).split(), "-o", output)
    before = AT_CALL.format(name="fsync", at=1 if isinstance(at, str) else at)

    def stopped_while_writing() -> None:
        process = start(*arguments, before=before)
        stopped(process)
        assert process.returncode == 130

    stopped_while_writing()
    assert not set(tmp_path.rglob("*"))
    assert tumble(*arguments, "-q").status == 0
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    for file in files:
        file.write_bytes(file.read_bytes() + b"\n")  # what is written anew has one end of a line less
    earlier = {file: file.read_bytes() for file in files}
    stopped_while_writing()
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == earlier


def test_ctrl_c_after_the_files_are_in_place_says_so(start: Start, recording: Path, tmp_path: Path) -> None:
    call = ("calibrate", recording, "--gravity", 9.81, "-o", tmp_path / "made")
    process = start(*call, before=AFTER_WRITING)
    assert "files that were written until then are complete" in stopped(process)
    assert process.returncode == 130
    assert json.loads((tmp_path / "made" / "calibration.json").read_text())["format"] == "tumble calibration"


@pytest.mark.parametrize("delay", [0.0, 0.5])
def test_ctrl_c_at_any_moment_leaves_all_or_nothing(
    start: Start, recording: Path, tmp_path: Path, delay: float
) -> None:
    """While importing, reading, solving, reporting: all as before, or all new; the one line says which."""
    folder = tmp_path / "results"
    put_earlier(folder)
    process = start("calibrate", recording, "--gravity", 9.81, "-o", folder)
    time.sleep(delay)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert "Traceback" not in err, err
    now = contents(folder)
    assert set(now) == set(EARLIER)
    assert process.returncode in (0, 130), err
    if process.returncode == 130:
        assert len(err.splitlines()) == 1, err
        assert (now == EARLIER) == ("no file was changed" in err), err
    if now != EARLIER:
        assert json.loads(now["calibration.json"])["format"] == "tumble calibration"
        assert now["report.html"].rstrip().endswith("</html>")
    if delay == 0.0:
        assert process.returncode == 130


def test_a_reader_that_goes_away_ends_the_program_quietly(
    start: Start, recording: Path, tmp_path: Path
) -> None:
    """`tumble ... | head`: no traceback when nobody reads on."""
    process = start("calibrate", recording, "--gravity", 9.81, "-o", tmp_path / "results", "--json")
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    err = process.stderr.read()
    process.wait(timeout=60)
    assert "Traceback" not in err
    assert process.returncode == 0
    assert set(contents(tmp_path / "results")) == set(EARLIER)


# --- an output is an ordinary file, and no input


def test_no_command_writes_over_its_inputs(
    tumble: Any, calibrated: Path, recording: Path, tmp_path: Path
) -> None:
    file = tmp_path / "unit.json"
    file.write_bytes((calibrated / "calibration.json").read_bytes())
    raw = tmp_path / "raw.csv"
    raw.write_bytes(recording.read_bytes())
    mine = tmp_path / "unit.csv"
    mine.write_bytes(file.read_bytes())
    before = contents(tmp_path)
    for arguments in (
        ("apply", mine, raw, "-o", mine),
        ("predict", file, "-o", file),
        ("convert", file, "--frame", "accelerometer-z", "-o", file),
        ("apply", file, raw, "-o", raw),
        ("inspect", raw, "--save", raw),
        ("convert", file, "--to", "yaml", "-o", file),
        ("calibrate", raw, "--prior", calibrated, "-o", calibrated),
    ):
        tumble(*arguments).is_told(2)
    assert contents(tmp_path) == before


@pytest.mark.parametrize("kind", ["device", "pipe"])
def test_no_command_replaces_a_device(
    tumble: Any, calibrated: Path, recording: Path, tmp_path: Path, kind: str
) -> None:
    place = Path("/dev/null") if kind == "device" else tmp_path / "pipe.csv"
    if kind == "pipe":
        os.mkfifo(place)
    before = place.lstat()
    for arguments in (
        ("mount", recording, recording, "-c", calibrated, "-o", place),
        ("convert", calibrated, "--frame", "accelerometer-z", "-o", place),
        ("apply", calibrated, recording, "-o", place),
        ("plan", "strapdown-rotation", "-o", place),
        ("simulate", "six-position", "-o", place),
        ("noise", recording, "-o", place),
    ):
        answer = tumble(*arguments)
        assert answer.status == 2, answer
        assert f"is a {kind}" in answer.err or "is a file" in answer.err
    assert (place.lstat().st_mode, place.lstat().st_ino) == (before.st_mode, before.st_ino)
