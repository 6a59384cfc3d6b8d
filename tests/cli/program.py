"""The command line as a user meets it: a folder, a line that is typed, exit status and both streams."""

from __future__ import annotations

import io
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.earth import Site
from tumble.simulation import Motion, find_grade, poses_26, simulate_recording

GRAVITY, RATE = 9.81, 50.0
HEADER = "t,ax,ay,az,gx,gy,gz"
RUN = "import sys; sys.argv[0] = 'tumble'; from tumble.cli import program; program()"
PROGRAM = (  # it says that it is ready to hear stops then, not before
    "import sys, tumble.cli as c, tumble.cli.application as m; sys.argv[0] = 'tumble'; exec({before!r}); "
    "begin = m.main; m.main = lambda: (print('ready', flush=True), begin()); c.program()"
)


@dataclass(frozen=True)
class Answer:
    """What a run of the program left behind."""

    status: int
    out: str
    err: str

    @property
    def said(self) -> str:
        """What was printed, without breaks of lines."""
        return " ".join(self.out.split())

    @property
    def json(self) -> Any:
        return json.loads(self.out)

    def is_told(self, status: int, *words: str) -> None:
        """It ended with this status and one sentence on stderr alone, no fault of the program, with these words."""
        assert self.status == status, self
        assert self.out == ""
        assert re.fullmatch(r"tumble: .*[.?]\n", self.err), self.err
        assert "fault of tumble" not in self.err
        assert "secret" not in self.err  # the password of the tests
        for word in words:
            assert word in self.err or re.search(word, self.err), (word, self.err)


class Bench:
    """A user's folder, and what is typed there: `tumble("calibrate a.csv -o made")`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def run(self, *call: object) -> Answer:
        """Run `tumble CALL` in this process, whatever comes of it."""
        from tumble.cli import main

        out, err, before = io.StringIO(), io.StringIO(), sys.argv
        sys.argv = ["tumble", *words_of(call)]
        try:
            with (
                chdir(self.folder),
                redirect_stdout(out),
                redirect_stderr(err),
                pytest.raises(SystemExit) as ended,
            ):
                main()
        finally:
            sys.argv = before
        code = ended.value.code
        return Answer(
            code if isinstance(code, int) else int(code is not None), out.getvalue(), err.getvalue()
        )

    def __call__(self, *call: object, status: int = 0) -> Answer:
        """Run a call that ends with this status and says nothing on stderr."""
        answer = self.run(*call)
        assert (answer.status, answer.err) == (status, ""), answer
        return answer

    def refuses(self, call: str, *words: str, status: int = 2) -> None:
        """The call is refused in one sentence with these words, and touches no file."""
        before = self.contents()
        self.run(call).is_told(status, *words)
        assert self.contents() == before

    def contents(self, folder: str = ".") -> dict[str, bytes]:
        """Every file below a folder, and every folder that is empty."""
        top = self.folder / folder
        return {
            str(path.relative_to(top)): path.read_bytes() if path.is_file() else b""
            for path in top.rglob("*")
            if not path.is_dir() or not any(path.iterdir())
        }

    def json(self, name: str) -> Any:
        return json.loads(self.text(name))

    def text(self, name: str) -> str:
        return (self.folder / name).read_text(encoding="utf-8")

    def put(self, name: str, text: str) -> Path:
        (self.folder / name).write_text(text, encoding="utf-8")
        return self.folder / name

    def write(self, name: str, rows: np.ndarray, header: str = HEADER) -> Path:
        """Write rows of numbers as a recording."""
        lines = [header, *(",".join(f"{value:.7g}" for value in row) for row in rows)]
        return self.put(name, "\n".join(lines) + "\n")

    def start(self, *call: object, before: str = "") -> subprocess.Popen[str]:
        """Start a call in a process of its own, with Python code run before it, and wait until it is ready."""
        process = subprocess.Popen(
            [sys.executable, "-c", PROGRAM.format(before=before), *words_of(call)],
            cwd=self.folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert process.stdout.readline() == "ready\n"
        return process

    def apart(self, *call: object, code: str = RUN, shell: str = '"$@"', **environment: str) -> Any:
        """Run a call to its end in a process of its own, through a shell that may connect its streams."""
        return subprocess.run(
            ["sh", "-c", shell, "sh", sys.executable, "-c", code, *words_of(call)],
            cwd=self.folder,
            env={**os.environ, **environment},
            capture_output=True,
            check=False,
        )


def words_of(call: tuple[object, ...]) -> list[str]:
    """The arguments of a call: texts are split at their spaces, a path or a text in a tuple is one argument."""
    words: list[str] = []
    for part in call:
        if isinstance(part, str):
            words += part.split()
        else:
            words += [str(one) for one in (part if isinstance(part, tuple) else (part,))]  # pyright: ignore[reportUnknownArgumentType, reportUnknownVariableType]
    return words


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


Change = Callable[[np.ndarray], None]


def spoiled(rows: np.ndarray, change: Change) -> np.ndarray:
    """A copy of a recording's rows with a change."""
    rows = rows.copy()
    change(rows)
    return rows
