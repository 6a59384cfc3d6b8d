"""Every command of the tutorials runs, in their order, and prints what they show; digits may differ by machine."""

from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path

import pytest

from tumble.cli.main import main

TUTORIALS = Path(__file__).resolve().parents[2] / "docs" / "tutorials"
PAGES = sorted(page.name for page in TUTORIALS.glob("*.md") if page.name != "index.md")
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
def test_a_tutorial_s_commands_run_and_print_what_it_shows(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "160")
    commands = commands_of(page)
    assert len(commands) >= 3
    for command, shown in commands:
        monkeypatch.setattr(sys, "argv", shlex.split(command))
        with pytest.raises(SystemExit) as ended:
            main()
        printed = capsys.readouterr()
        assert not ended.value.code, f"{command}: {printed.err}"
        said = words_of(printed.out + printed.err)
        missing = [line for line in shown if words_of(line) not in said]
        assert not missing, f"{command}: {missing}"


def test_every_tutorial_is_in_their_list() -> None:
    listed = (TUTORIALS / "index.md").read_text(encoding="utf-8")
    assert all(f"({page})" in listed for page in PAGES)
