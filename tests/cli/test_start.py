"""The program starts without what only work needs."""

from __future__ import annotations

import subprocess
import sys

import pytest

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
