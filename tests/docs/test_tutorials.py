"""Every command of the tutorials runs, in their order, and prints what they show; digits may differ by machine."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

TUTORIALS = Path(__file__).resolve().parents[2] / "docs" / "tutorials"
PAGES = sorted(page.name for page in TUTORIALS.glob("*.md") if page.name != "index.md")
RUN = "import sys; from tumble.cli.main import main; sys.argv[0] = 'tumble'; main()"
CONSOLE = re.compile(r"^```console\n(.*?)^```$", re.M | re.S)


def commands_of(page: str) -> list[tuple[str, list[str]]]:
    """Each command with the lines that are shown below it."""
    found: list[tuple[str, list[str]]] = []
    for block in CONSOLE.findall((TUTORIALS / page).read_text(encoding="utf-8")):
        for line in block.splitlines():
            if line.startswith("$ "):
                found.append((line[2:], []))
            else:
                found[-1][1].append(line)
    return found


def words_of(text: str) -> str:
    """Without line breaks, frames and the digits of numbers."""
    return " ".join(re.sub(r"-?\d+(?:\.\d+)?", "#", text).split())


@pytest.mark.parametrize("page", PAGES)
def test_a_tutorial_s_commands_run_and_print_what_it_shows(page: str, tmp_path: Path) -> None:
    # Programs of their own, where shapes are not checked: what a user waits for.
    plain = {"COLUMNS": "160", "NO_COLOR": "1", "TUMBLE_CHECK_SHAPES": ""}
    commands = commands_of(page)
    assert len(commands) >= 3
    for command, shown in commands:
        program, *arguments = shlex.split(command)
        assert program == "tumble"
        answer = subprocess.run(
            [sys.executable, "-c", RUN, *arguments],
            cwd=tmp_path,
            env={**os.environ, **plain},
            capture_output=True,
            encoding="utf-8",
            check=False,
        )
        assert answer.returncode == 0, f"{command}: {answer.stderr}"
        said = words_of(answer.stdout + answer.stderr)
        missing = [line for line in shown if words_of(line) not in said]
        assert not missing, f"{command}: {missing}"


def test_every_tutorial_is_in_their_list() -> None:
    listed = (TUTORIALS / "index.md").read_text(encoding="utf-8")
    assert all(f"({page})" in listed for page in PAGES)
