"""The example on the page about planning is what the command prints."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from tumble.cli.main import app

PAGE = Path(__file__).resolve().parents[2] / "docs" / "plan.md"


def test_the_example_is_what_the_command_prints() -> None:
    """Of the drawn tests only that they are there: their last digit is chance."""
    from typer.testing import CliRunner

    shown = re.search(r"```console\n\$ tumble (plan .*?)\n(  .*?)```", PAGE.read_text(encoding="utf-8"), re.S)
    assert shown is not None
    command, rest = re.match(r"(.*?\\\n.*?)\n(.*)", shown[1] + "\n" + shown[2], re.S).groups()  # type: ignore[union-attr]
    arguments = shlex.split(command.replace("\\\n", " "))
    printed = CliRunner().invoke(app, arguments, env={"COLUMNS": "100", "NO_COLOR": "1"})
    assert printed.exit_code == 0, printed.output
    lines = {" ".join(line.split()) for line in printed.output.splitlines()}
    wanted = [" ".join(line.split()) for line in rest.splitlines()]
    assert len(wanted) > 15
    assert not [line for line in wanted if line and "tests drawn" not in line and line not in lines]


def test_the_example_of_poses_is_what_the_command_prints() -> None:
    from typer.testing import CliRunner

    page = PAGE.read_text(encoding="utf-8")
    shown = re.search(r"```console\n\$ tumble (plan multi-position [^\n]*--time[^\n]*)\n(.*?)```", page, re.S)
    assert shown is not None
    arguments = shlex.split(shown[1])
    printed = CliRunner().invoke(app, arguments, env={"COLUMNS": "100", "NO_COLOR": "1"})
    assert printed.exit_code == 0, printed.output
    lines = {" ".join(line.split()) for line in printed.output.splitlines()}
    wanted = [" ".join(line.split()) for line in shown[2].splitlines()]
    assert len(wanted) > 25
    assert not [line for line in wanted if line and line not in lines]
