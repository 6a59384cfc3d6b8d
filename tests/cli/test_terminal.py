"""What stands on the terminal: in any encoding, on any output, of any name; and a stop at any moment."""

from __future__ import annotations

import io
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tumble import counting
from tumble.cli.inspect import shares
from tumble.cli.terminal import progress, shortened
from tumble.counting import part

RUN = "import sys; sys.argv[0] = 'tumble'; from tumble.cli import program; program()"
# Sends a signal to itself when a module of that name is first looked for.
SENT = """
import os, signal, sys
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == {name!r} and not hasattr(sys, 'sent'):
            sys.sent = True
            os.kill(os.getpid(), signal.{number})
sys.meta_path.insert(0, Finder())
"""


def run(*arguments: object, code: str = RUN, shell: str = '"$@"', **environment: str) -> Any:
    """Run the program in a process of its own, through a shell that may close or connect its streams."""
    return subprocess.run(
        ["sh", "-c", shell, "sh", sys.executable, "-c", code, *map(str, arguments)],
        env={**os.environ, **environment},
        capture_output=True,
        check=False,
    )


def one_line(answer: Any, status: int, *words: str) -> str:
    told = answer.stderr.decode()
    assert answer.returncode == status, told
    assert len(told.splitlines()) == 1, told
    assert "Traceback" not in told
    assert "fault of tumble" not in told
    for word in words:
        assert word in told
    return told


@pytest.mark.parametrize("encoding", ["ascii", "cp1252"])
@pytest.mark.parametrize("arguments", [("plan", "--help"), ("inspect", "√µg².csv")])
def test_any_encoding_of_the_output_does(encoding: str, arguments: tuple[str, ...]) -> None:
    answer = run(*arguments, PYTHONIOENCODING=encoding, PYTHONUTF8="0")
    assert answer.returncode in (0, 2)
    assert b"Traceback" not in answer.stderr
    assert b"fault of tumble" not in answer.stderr
    (answer.stdout + answer.stderr).decode(encoding)


def test_signs_that_an_encoding_lacks_are_written_in_others() -> None:
    answer = run("plan", "six-position", PYTHONIOENCODING="ascii")
    assert answer.returncode == 0
    assert b" ug" in answer.stdout
    assert b"\\u" not in answer.stdout


@pytest.mark.parametrize("shell", ['"$@" >&-', '"$@" >&- 2>&- <&-'])
def test_a_closed_output_stops_nothing(shell: str, tmp_path: Path) -> None:
    answer = run("simulate", "six-position", "--sample-rate", 5, "-o", tmp_path / "made", shell=shell)
    assert answer.returncode == 0, answer.stderr
    assert b"fault" not in answer.stderr
    assert (tmp_path / "made" / "recording.csv").read_bytes().startswith(b"t,")


@pytest.mark.parametrize("arguments", [("--help",), ("plan", "--help"), ("--version",), ("mount", "--help")])
def test_a_full_output_is_not_a_full_disk(arguments: tuple[str, ...]) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("this system has no /dev/full")
    told = one_line(run(*arguments, shell='"$@" > /dev/full'), 3, "What tumble prints could not be written")
    assert "-o" not in told


def test_names_and_contents_do_nothing_to_the_terminal(tumble: Any, recording: Path, tmp_path: Path) -> None:
    named = tmp_path / "a\x1b[31mred\x1b]0;title\x07\u202e.csv"
    named.write_bytes(recording.read_bytes())
    for answer in (tumble("inspect", named), tumble("inspect", tmp_path / "no\x1b[2Jwhere.csv")):
        assert "\x1b" not in answer.out + answer.err
        assert "\x07" not in answer.out + answer.err
        assert "\u202e" not in answer.out + answer.err
        assert "\\x1b" in answer.out + answer.err


def test_a_name_that_is_no_utf_8_is_a_name(recording: Path, tmp_path: Path) -> None:
    named = os.fsencode(tmp_path) + b"/caf\xe9.csv"
    with open(named, "wb") as file:
        file.write(recording.read_bytes())
    for arguments in (["inspect"], ["calibrate", "--gravity", "9.81", "-o", str(tmp_path / "out")]):
        answer = subprocess.run(
            [sys.executable, "-c", RUN, *arguments, named], capture_output=True, check=False, cwd=tmp_path
        )
        assert answer.returncode in (0, 1), answer.stderr.decode()
        answer.stdout.decode("utf-8")
    assert "caf?.csv" in (tmp_path / "out" / "calibration.json").read_text(encoding="utf-8")


def test_what_was_typed_is_not_repeated_at_any_length(tumble: Any, tmp_path: Path) -> None:
    answer = tumble("simulate", "x" * 3000, "-o", tmp_path / "out")
    assert answer.status == 2
    assert len(answer.err) < 1500
    assert "…" in answer.err
    assert len(shortened("word " * 2000)) < 2000
    assert shortened("a short sentence.") == "a short sentence."


@pytest.mark.parametrize(
    ("name", "number", "status"),
    [
        ("tumble.cli.main", "SIGINT", 130),
        ("typer", "SIGTERM", 143),
        ("numpy", "SIGINT", 130),
        ("scipy", "SIGTERM", 143),
    ],
)
def test_a_stop_while_python_imports_is_one_line(name: str, number: str, status: int, tmp_path: Path) -> None:
    code = SENT.format(name=name, number=number) + RUN
    one_line(run("demo", "-o", tmp_path / "demo", code=code), status, "Stopped; no file was changed.")
    assert not (tmp_path / "demo").exists()


def test_a_stop_that_is_to_be_ignored_is_ignored(tmp_path: Path) -> None:
    code = SENT.format(name="typer", number="SIGINT") + RUN
    answer = run("--version", code=code, shell="trap '' INT; exec \"$@\"")
    assert answer.returncode == 0, answer.stderr
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_the_time_left_stands_on_one_line_of_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    class Screen(io.StringIO):
        def isatty(self) -> bool:
            return True

    def watched(name: str) -> str:
        screen = Screen()
        monkeypatch.setattr(sys, "stderr", screen)
        with progress(False) as tell:
            tell(name)
            with part(0.4, 0.5):
                pass
        return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", screen.getvalue())

    monkeypatch.setattr(counting, "_TOO_EARLY", -1.0)
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("TERM", "xterm")
    bar = "━━━━━━━━╌╌╌╌╌╌╌╌╌╌╌╌ 40 %, 0 s left"
    assert f" reading [bold] \\x1b {bar}" in watched("reading [bold] \x1b")
    lines = watched("an item with " + 9 * "a very long name, ").splitlines()
    assert [line for line in lines if bar in line]
    assert all(len(line) <= 80 for line in lines)


@pytest.mark.parametrize(
    ("resting", "moving", "shown"),
    [
        (0.46, 0.47, (46, 47, 7)),
        (0.505, 0.495, (50, 50, 0)),
        (0.005, 0.995, (0, 100, 0)),
        (0.0, 0.0, (0, 0, 100)),
        (0.995, 0.005, (100, 0, 0)),
    ],
)
def test_shares_are_whole_and_add_up_to_100(
    resting: float, moving: float, shown: tuple[int, int, int]
) -> None:
    assert shares(resting, moving) == shown
    assert sum(shown) == 100
