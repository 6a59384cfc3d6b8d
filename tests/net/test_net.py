"""Every stored run is played again and leaves behind what it left when it was stored."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
NAMES = sorted(path.name.removesuffix(".json.gz") for path in (HERE / "expected").glob("*.json.gz"))


@pytest.fixture(scope="module")
def ask() -> Iterator[Callable[[str], list[str]]]:
    """Ask a process of its own, without the checks of shapes that slow the other tests down."""
    command = [sys.executable, str(HERE / "record.py"), "--serve"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin
        assert process.stdout

        def answer(name: str) -> list[str]:
            print(name, file=process.stdin, flush=True)
            return json.loads(process.stdout.readline())

        yield answer
        process.stdin.close()


@pytest.mark.parametrize("name", NAMES)
def test_nothing_moved(name: str, ask: Callable[[str], list[str]]) -> None:
    told = ask(name)
    assert not told, "\n".join([f"{len(told)} differences", *told[:10]])


def test_every_run_is_stored(ask: Callable[[str], list[str]]) -> None:
    assert ask("names") == NAMES
