"""The command line as a user meets it: arguments in, exit status and both streams out."""

from __future__ import annotations

import io
import os
import re
import subprocess
import sys
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.earth import Site
from tumble.simulation import Motion, find_grade, poses_26, simulate_recording

GRAVITY = 9.81
RATE = 50.0
# What the installed program runs: it says that it is ready when a stop is heard, not before.
PROGRAM = (
    "import sys, tumble.cli as c, tumble.cli.main as m; sys.argv[0] = 'tumble'; exec({before!r}); begin = m.main; "
    "m.main = lambda: (print('ready', flush=True), begin()); c.program()"
)
HEADER = "t,ax,ay,az,gx,gy,gz"


@dataclass(frozen=True)
class Answer:
    """What a run of the program left behind."""

    status: int
    out: str
    err: str

    def is_told(self, status: int, *words: str) -> None:
        """It ended with this status and one sentence on stderr alone, no fault of the program, with these words."""
        assert self.status == status, self
        assert self.out == ""
        assert re.fullmatch(r"tumble: .*[.?]\n", self.err), self.err
        assert "fault of tumble" not in self.err
        for word in words:
            assert word in self.err or re.search(word, self.err), (word, self.err)


def run_program(*arguments: object) -> Answer:
    """Run `tumble ARGUMENTS` in this process."""
    from tumble.cli.main import main

    out, err = io.StringIO(), io.StringIO()
    before = sys.argv
    sys.argv = ["tumble", *(str(argument) for argument in arguments)]
    try:
        with redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as ended:
            main()
    finally:
        sys.argv = before
    code = ended.value.code
    return Answer(code if isinstance(code, int) else int(code is not None), out.getvalue(), err.getvalue())


def tumbled_rows(seed: int, *, unit_seed: int = 100, holds: int = 20, faces_only: bool = False) -> np.ndarray:
    """Time, specific force and angular rate of a consumer MEMS unit tumbled through `holds` of 26 poses.

    The same `unit_seed` is the same unit; `seed` is the session: motion and noise.
    """
    rng = np.random.default_rng(seed)
    grade = find_grade("consumer-mems")
    model = grade.simulate_model(np.random.default_rng(unit_seed))
    headings = Rotation.from_rotvec(np.outer(rng.uniform(0.0, 6.28, 26), [0.0, 0.0, 1.0]))
    # The first six of the 26 are the faces.
    chosen = rng.permutation(6) if faces_only else rng.permutation(26)[:holds]
    attitudes = (headings * poses_26())[chosen]
    holds = len(chosen)
    motion = Motion.between_poses(attitudes, np.full(holds, 2.6), np.full(holds - 1, 1.5))
    recording, _ = simulate_recording(
        motion, RATE, rng, site=Site.from_gravity(GRAVITY), grade=grade, distort=model.distort
    )
    return np.column_stack([recording.time, recording.specific_force, recording.angular_rate])


def write_rows(path: Path, rows: np.ndarray, header: str | None = HEADER) -> Path:
    lines = [] if header is None else [header]
    lines += [",".join(f"{value:.7g}" for value in row) for row in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def start_program(*arguments: object, before: str = "") -> subprocess.Popen[str]:
    """Start `tumble ARGUMENTS` in a process of its own, with Python code run before it, and wait until it is ready."""
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


@pytest.fixture(scope="session")
def start() -> Callable[..., subprocess.Popen[str]]:
    return start_program


@pytest.fixture(scope="session")
def tumble() -> Callable[..., Answer]:
    return run_program


@pytest.fixture(params=["whole", "block by block"])
def how(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """How `tumble noise` reads a file, whatever its size."""
    monkeypatch.setattr("tumble.workflows.noise.STREAMED_ABOVE", 2**60 if request.param == "whole" else -1)
    return str(request.param)


@pytest.fixture(scope="session")
def rows() -> np.ndarray:
    """A good recording; tests copy it before they spoil it."""
    return tumbled_rows(3)


@pytest.fixture(scope="session")
def sessions() -> Callable[..., np.ndarray]:
    return tumbled_rows


@pytest.fixture(scope="session")
def written() -> Callable[..., Path]:
    return write_rows


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory, rows: np.ndarray) -> Path:
    return write_rows(tmp_path_factory.mktemp("recording") / "tumbled.csv", rows)


@pytest.fixture(scope="session")
def calibrated(tmp_path_factory: pytest.TempPathFactory, recording: Path) -> Path:
    """The folder of a calibration of the good recording."""
    folder = tmp_path_factory.mktemp("calibrated") / "results"
    answer = run_program("calibrate", recording, "--gravity", GRAVITY, "-o", folder)
    assert answer.status == 0, answer
    return folder
