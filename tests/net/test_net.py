"""The program computes what it did before the house was made smaller."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

PARTS = sorted(path.name for path in (Path(__file__).parent / "baseline").iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("part", PARTS)
def test_the_program_computes_what_it_did(root: Path, part: str) -> None:
    command = [sys.executable, "-m", "tests.net", "check", part, "--processes", "1"]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    assert not done.returncode, done.stdout + done.stderr
