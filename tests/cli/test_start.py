"""The program starts without what only work needs."""

from __future__ import annotations

import inspect
import subprocess
import sys
from importlib import import_module

import pytest

from tumble.cli.main import COMMANDS

HEAVY = ("numpy", "scipy", "polars", "yaml", "plotly", "jinja2")


def test_the_help_of_no_command_imports_anything_heavy() -> None:
    commands = [name for name in COMMANDS if name != "capture"]  # whose guide's events are numpy's
    code = (
        "import sys\nfrom tumble.cli.main import main\n"
        f"for command in {commands!r}:\n"
        "    sys.argv = ['tumble', command, '--help']\n"
        "    try: main()\n    except SystemExit: pass\n"
        f"sys.exit(' '.join(name for name in {HEAVY!r} if name in sys.modules))"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False, encoding="utf-8")
    assert not answer.stderr.strip()
    assert answer.stdout.count("Usage: tumble") == len(commands)


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
