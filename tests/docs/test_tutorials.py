"""Every command of tutorials and first pages runs, in order, and prints what they show; digits may differ."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from contract.test_formats import write_ardupilot, write_rosbag1
from tumble.workflows import simulate

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES = sorted(
    f"{folder}/{page.name}"
    for folder in ("tutorials", "start")
    for page in (DOCS / folder).glob("*.md")
    if page.name != "index.md"
)
# A page's commands, one after the other: status, and what is printed.
RUN = """
import io, json, sys
from contextlib import redirect_stderr, redirect_stdout
from tumble.cli import main
answers = []
for arguments in json.load(sys.stdin):
    said, status, sys.argv = io.StringIO(), 0, ["tumble", *arguments]
    with redirect_stdout(said), redirect_stderr(said):
        try:
            main()
        except SystemExit as end:
            status = end.code
    answers.append((status, said.getvalue()))
json.dump(answers, sys.stdout)
"""
CONSOLE = re.compile(r"^```console\n(.*?)^```$", re.M | re.S)


def commands_of(page: str) -> list[tuple[str, list[str]]]:
    """Each command with the lines that are shown below it."""
    found: list[tuple[str, list[str]]] = []
    for block in CONSOLE.findall((DOCS / page).read_text(encoding="utf-8")):
        for line in block.splitlines():
            if line.startswith("$ "):
                found.append((line[2:], []))
            else:
                found[-1][1].append(line)
    return found


def words_of(text: str) -> str:
    """Without line breaks, frames and the digits of numbers."""
    return " ".join(re.sub(r"-?\d+(?:\.\d+)?", "#", text).split())


def write_recordings(folder: Path, commands: str) -> None:
    """Write what a page takes for granted: a simulated session by hand, as a bag or as an autopilot's log."""
    for name, write in (("robot.bag", write_rosbag1), ("flight.bin", write_ardupilot)):
        if name in commands:
            write(folder / name, session_by_hand(folder / "session"))


def session_by_hand(folder: Path) -> np.ndarray:
    """(samples, 7) time, specific force and angular rate of a simulated session."""
    simulate("hand-held", output=folder, seed=1)
    return np.loadtxt(folder / "recording.csv", delimiter=",", skiprows=1)


# An hour of a turntable is simulated and calibrated twice.
LONG = ("tutorials/turntable.md",)


@pytest.mark.parametrize(
    "page", [pytest.param(page, marks=[pytest.mark.slow] if page in LONG else []) for page in PAGES]
)
def test_a_tutorial_s_commands_run_and_print_what_it_shows(page: str, tmp_path: Path) -> None:
    run_page(page, tmp_path)


def run_page(page: str, folder: Path) -> None:
    """Run a page's commands in a folder, and compare what they print with what the page shows."""
    # A program of its own, where shapes are not checked: what a user waits for.
    plain = {"COLUMNS": "160", "NO_COLOR": "1", "TUMBLE_CHECK_SHAPES": ""}
    commands = commands_of(page)
    assert len(commands) >= 3
    write_recordings(folder, " ".join(command for command, _ in commands))
    for name, text in re.findall(
        r"`(\S+\.yaml)`:\n\n```yaml\n(.*?)```", (DOCS / page).read_text("utf-8"), re.S
    ):
        (folder / name).write_text(text, encoding="utf-8")
    words = [shlex.split(command) for command, _ in commands]
    assert {program for program, *_ in words} == {"tumble"}
    made = subprocess.run(
        [sys.executable, "-c", RUN],
        input=json.dumps([arguments for _, *arguments in words]),
        cwd=folder,
        env={**os.environ, **plain},
        capture_output=True,
        encoding="utf-8",
        check=True,
    )
    for (command, shown), (status, printed) in zip(commands, json.loads(made.stdout), strict=True):
        assert status == 0, f"{command}: {printed}"
        said = words_of(printed)
        missing = [line for line in shown if line != "..." and words_of(line) not in said]
        assert not missing, f"{command}: {missing}"


def test_every_tutorial_is_in_their_list() -> None:
    listed = (DOCS / "tutorials" / "index.md").read_text(encoding="utf-8")
    front = (DOCS / "index.md").read_text(encoding="utf-8")
    for page in PAGES:
        assert f"({page})" in front or f"({page.removeprefix('tutorials/')})" in listed
