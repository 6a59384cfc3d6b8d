"""Results that cannot be written, or whose writing is interrupted: earlier ones stay intact, no part is left."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

EARLIER = {"calibration.json": '{"earlier": "calibration"}\n', "report.html": "<p>earlier report</p>\n"}
# What the installed program runs, with a word on stdout when the first work begins.
# It says that it is ready when a stop is heard: not before.
PROGRAM = (
    "import sys, tumble.cli as c, tumble.cli.main as m; sys.argv[0] = 'tumble'; {before}; begin = m.main; "
    "m.main = lambda: (print('ready', flush=True), begin()); c.program()"
)


def put_earlier(folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    for name, text in EARLIER.items():
        (folder / name).write_text(text)


def contents(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text(errors="replace") for path in folder.iterdir()}


def start(*arguments: object, before: str = "pass") -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM.format(before=before), *map(str, arguments)],
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    return process


def is_told(answer: Any, *words: str) -> None:
    assert answer.status == 3, answer
    assert len(answer.err.splitlines()) == 1, answer.err
    assert "Traceback" not in answer.err
    assert "fault of tumble" not in answer.err
    for word in words:
        assert word in answer.err


# --- places that cannot be written to; the tests may run as root, whom permissions do not stop


@pytest.mark.parametrize("place", ["/proc/tumble", "/sys/tumble"])
def test_a_folder_that_the_system_does_not_allow(tumble: Any, recording: Path, place: str) -> None:
    if not Path(place).parent.is_dir():
        pytest.skip(f"this system has no {Path(place).parent}")
    is_told(tumble("calibrate", recording, "--gravity", 9.81, "-o", place), place)
    is_told(tumble("demo", "-o", place), place)


def test_a_folder_under_a_file(tumble: Any, recording: Path, tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("precious")
    is_told(tumble("calibrate", recording, "--gravity", 9.81, "-o", file / "results"), "file is a file")
    assert contents(tmp_path) == {"file": "precious"}


def test_a_folder_that_is_a_file_is_wrong_usage(tumble: Any, recording: Path, tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("precious")
    answer = tumble("calibrate", recording, "-o", file)
    assert answer.status == 2
    assert "is a file: give a folder" in answer.err
    assert contents(tmp_path) == {"file": "precious"}


@pytest.mark.parametrize("name", ["corrected.csv", "corrected.parquet"])
def test_a_corrected_recording_that_cannot_be_written(
    tumble: Any, recording: Path, calibrated: Path, tmp_path: Path, name: str
) -> None:
    is_told(tumble("apply", calibrated, recording, "-o", tmp_path / "absent" / name), "does not exist")
    file = tmp_path / "file"
    file.write_text("precious")
    is_told(tumble("apply", calibrated, recording, "-o", file / name), "could not be written")
    assert contents(tmp_path) == {"file": "precious"}


def test_a_folder_without_permission(tumble: Any, recording: Path, tmp_path: Path) -> None:
    folder = tmp_path / "results"
    put_earlier(folder)
    folder.chmod(0o555)
    try:
        if os.access(folder, os.W_OK):
            pytest.skip("this user may write anywhere (root): permissions stop nothing")
        is_told(tumble("calibrate", recording, "--gravity", 9.81, "-o", folder), "cannot be written")
    finally:
        folder.chmod(0o755)
    assert contents(folder) == EARLIER


# --- a full disk


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 64 kB, which holds the earlier results and no more than half of the new ones."""
    place = tmp_path / "disk"
    place.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(place)],
        capture_output=True,
        text=True,
        check=False,
    )
    if mounted.returncode:
        pytest.skip(f"a small disk cannot be mounted here: {mounted.stderr.strip()}")
    try:
        yield place
    finally:
        subprocess.run(["umount", str(place)], check=True)


def test_a_full_disk_leaves_the_earlier_results(tumble: Any, recording: Path, small_disk: Path) -> None:
    put_earlier(small_disk)
    is_told(tumble("calibrate", recording, "--gravity", 9.81, "-o", small_disk), "No space left")
    assert contents(small_disk) == EARLIER


@pytest.mark.parametrize("name", ["corrected.csv", "corrected.parquet"])
def test_a_full_disk_leaves_the_earlier_corrected_recording(
    tumble: Any, recording: Path, calibrated: Path, small_disk: Path, name: str
) -> None:
    target = small_disk / name
    target.write_text("earlier")
    is_told(tumble("apply", calibrated, recording, "-o", target), "written")
    assert contents(small_disk) == {name: "earlier"}


# --- Ctrl-C


def stopped(process: subprocess.Popen[str]) -> str:
    """Wait for the end; return what stands on stderr, which is one line."""
    _, err = process.communicate(timeout=60)
    assert "Traceback" not in err, err
    assert len(err.splitlines()) == 1, err
    assert "Stopped" in err
    return err


def test_the_program_that_is_interrupted_below_runs_through_on_its_own(
    recording: Path, tmp_path: Path
) -> None:
    process = start("calibrate", recording, "--gravity", 9.81, "-o", tmp_path / "results")
    process.communicate(timeout=60)
    assert process.returncode == 0
    assert set(contents(tmp_path / "results")) == set(EARLIER)


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


@pytest.mark.parametrize("at", [1, 2], ids=["the document is on the disk", "the report is on the disk"])
def test_ctrl_c_while_writing_leaves_the_earlier_results_and_no_part(
    recording: Path, tmp_path: Path, at: int
) -> None:
    """Both files are written beside their places before either takes its place."""
    folder = tmp_path / "results"
    put_earlier(folder)
    before = f"exec({AT_CALL.format(name='fsync', at=at)!r})"
    process = start("calibrate", recording, "--gravity", 9.81, "-o", folder, before=before)
    stopped(process)
    assert process.returncode == 130
    assert contents(folder) == EARLIER


@pytest.mark.parametrize("name", ["corrected.csv", "corrected.parquet"])
def test_ctrl_c_while_correcting_leaves_the_earlier_file_and_no_part(
    recording: Path, calibrated: Path, tmp_path: Path, name: str
) -> None:
    (tmp_path / name).write_text("earlier")
    before = f"exec({AT_CALL.format(name='fsync', at=1)!r})"
    process = start("apply", calibrated, recording, "-o", tmp_path / name, before=before)
    stopped(process)
    assert process.returncode == 130
    assert contents(tmp_path) == {name: "earlier"}


def test_ctrl_c_after_the_files_are_in_place_says_so(recording: Path, tmp_path: Path) -> None:
    before = f"exec({AFTER_WRITING!r})"
    process = start("calibrate", recording, "--gravity", 9.81, "-o", tmp_path / "made", before=before)
    assert "files that were written until then are complete" in stopped(process)
    assert process.returncode == 130
    assert json.loads((tmp_path / "made" / "calibration.json").read_text())["format"] == "tumble calibration"


@pytest.mark.parametrize("delay", [0.0, 0.15, 0.3, 0.5, 0.7, 0.9])
def test_ctrl_c_at_any_moment_leaves_all_or_nothing(recording: Path, tmp_path: Path, delay: float) -> None:
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


def test_a_reader_that_goes_away_ends_the_program_quietly(recording: Path, tmp_path: Path) -> None:
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
    before = contents(tmp_path)
    for arguments in (
        ("predict", file, "-o", file),
        ("convert", file, "--frame", "accelerometer-z", "-o", file),
        ("apply", file, raw, "-o", raw),
        ("inspect", raw, "--save", raw),
        ("convert", file, "--to", "yaml", "-o", file),
        ("calibrate", raw, "--prior", calibrated, "-o", calibrated),
    ):
        answer = tumble(*arguments)
        assert answer.status == 2, answer
        assert len(answer.err.splitlines()) == 1
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
