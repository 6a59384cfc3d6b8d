"""Where the program runs: no home, no cache, no temporary folder, a clock that stands, twenty columns."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import pytest

RUN = "import sys; sys.argv[0] = 'tumble'; from tumble.cli import program; program()"


def run(*arguments: object, cwd: Path, code: str = RUN, **environment: str) -> Any:
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        env={**os.environ, **environment},
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
    )


def test_no_home_and_no_cache_are_needed(recording: Path, tmp_path: Path) -> None:
    """Not even root may write to this place."""
    home = "/proc/self/fdinfo"
    answer = run(
        "calibrate", recording, "--gravity", 9.81, "-o", "out",
        cwd=tmp_path, HOME=home, XDG_CACHE_HOME=f"{home}/cache", XDG_CONFIG_HOME=f"{home}/config",
        TMPDIR=f"{home}/temporary",
    )  # fmt: skip
    assert answer.returncode in (0, 1), answer.stderr
    assert answer.stderr == ""
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out"]


@pytest.mark.parametrize("name", ["packed.npy.gz", "plain.csv"])
def test_without_a_temporary_folder_only_what_has_to_be_unpacked_is_refused(
    name: str, tumble: Any, recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import gzip
    import io

    import numpy as np

    made = io.BytesIO()
    np.save(made, np.loadtxt(recording, delimiter=",", skiprows=1))
    file = tmp_path / name
    file.write_bytes(gzip.compress(made.getvalue()) if name.endswith("gz") else recording.read_bytes())
    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.setattr(tempfile, "_candidate_tempdir_list", lambda: [str(tmp_path / "absent")])
    answer = tumble("inspect", file)
    if name == "plain.csv":
        assert answer.status == 0
    else:
        answer.is_told(3, "temporary folder")


def test_a_clock_that_stands_stops_nothing(
    tumble: Any, recording: Path, tmp_path: Path, monkeypatch: Any
) -> None:
    for name in ("time", "monotonic", "perf_counter", "process_time"):
        monkeypatch.setattr(time, name, lambda: 1.0e9)
    answer = tumble("calibrate", recording, "--gravity", 9.81, "-o", tmp_path / "out", "-v")
    assert answer.status in (0, 1), answer.err
    assert tumble("simulate", "six-position", "--sample-rate", 5, "-o", tmp_path / "made").status == 0


@pytest.mark.parametrize(
    "arguments",
    [("--help",), ("calibrate", "--help"), ("inspect", "{}"), ("calibrate", "{}", "-o", "out", "-v")],
)
def test_one_column_stops_nothing(arguments: tuple[str, ...], recording: Path, tmp_path: Path) -> None:
    answer = run(*(a.format(recording) for a in arguments), cwd=tmp_path, COLUMNS="1", LINES="5")
    assert answer.returncode in (0, 1), answer.stderr
    assert answer.stderr == ""
