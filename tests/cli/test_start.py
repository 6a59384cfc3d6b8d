"""The program starts without what only work needs."""

from __future__ import annotations

import inspect
import subprocess
import sys
from importlib import import_module

import pytest

from tumble.cli.main import COMMANDS

HEAVY = ("numpy", "scipy", "polars", "yaml", "plotly", "jinja2")


@pytest.mark.parametrize("command", ["calibrate", "plan", "simulate", "verify", "predict"])
def test_the_help_imports_nothing_heavy(command: str) -> None:
    code = (
        "import sys\nfrom tumble.cli.main import main\n"
        f"sys.argv = ['tumble', '{command}', '--help']\n"
        "try: main()\nexcept SystemExit: pass\n"
        f"sys.exit(' '.join(name for name in {HEAVY!r} if name in sys.modules))"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False, encoding="utf-8")
    assert not answer.stderr.strip()
    assert "Usage: tumble" in answer.stdout


def test_the_list_of_commands_imports_none_of_them() -> None:
    code = (
        "import sys\nfrom tumble.cli.main import main\nsys.argv = ['tumble', '--help']\n"
        "try: main()\nexcept SystemExit: pass\n"
        f"sys.exit(' '.join(n for n in {(*HEAVY, 'rich.markdown', 'tumble.cli.options')!r} if n in sys.modules))"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False, encoding="utf-8")
    assert not answer.stderr.strip()
    assert all(f"\n  {name} " in answer.stdout for name in COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_the_list_says_what_the_command_says(name: str) -> None:
    module, sentence = COMMANDS[name]
    room = import_module(f"tumble.cli.{module}")
    words = room.app.info.help if hasattr(room, "app") else getattr(room, f"{name}_command").__doc__
    assert " ".join(inspect.cleandoc(words).split("\n\n")[0].split()) == sentence
