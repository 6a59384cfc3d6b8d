"""The example on the page about planning is what the command prints."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from tumble.cli.main import app

PAGE = Path(__file__).resolve().parents[2] / "docs" / "plan.md"


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
