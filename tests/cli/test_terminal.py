"""Where the program runs and when it is stopped: encodings, closed streams, no home, odd names, Ctrl-C."""

import io
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from tests.cli.program import RUN, Bench

from tumble import counting
from tumble.cli.inspect import shares
from tumble.cli.terminal import progress, shortened
from tumble.counting import part

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
CALIBRATE = "calibrate tumbled.csv --gravity 9.81"


def one_line(answer: Any, status: int, *words: str) -> str:
    told = str(answer.stderr.decode())
    assert answer.returncode == status, told
    assert len(told.splitlines()) == 1, told
    assert "Traceback" not in told
    assert "fault of tumble" not in told
    for word in words:
        assert word in told
    return told


# --- what stands on the terminal


@pytest.mark.parametrize("encoding", ["ascii", "cp1252"])
@pytest.mark.parametrize("call", ["plan --help", "inspect √µg².csv", "plan six-position"])
def test_any_encoding_of_the_output_does(bench: Bench, encoding: str, call: str) -> None:
    """Signs that an encoding lacks are written in others."""
    answer = bench.apart(call, PYTHONIOENCODING=encoding, PYTHONUTF8="0")
    assert answer.returncode == (2 if "inspect" in call else 0)
    assert b"Traceback" not in answer.stderr
    assert b"fault of tumble" not in answer.stderr
    (answer.stdout + answer.stderr).decode(encoding)
    if (call, encoding) == ("plan six-position", "ascii"):
        assert b" ug" in answer.stdout
        assert b"\\u" not in answer.stdout


@pytest.mark.parametrize("shell", ['"$@" >&-', '"$@" >&- 2>&- <&-'])
def test_a_closed_output_stops_nothing(bench: Bench, shell: str) -> None:
    answer = bench.apart("simulate six-position --sample-rate 5 -o made", shell=shell)
    assert answer.returncode == 0, answer.stderr
    assert b"fault" not in answer.stderr
    assert bench.contents("made")["recording.csv"].startswith(b"t,")


@pytest.mark.parametrize("call", ["--help", "plan --help", "--version", "mount --help"])
def test_a_full_output_is_not_a_full_disk(bench: Bench, call: str) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("this system has no /dev/full")
    answer = bench.apart(call, shell='"$@" > /dev/full')
    assert "-o" not in one_line(answer, 3, "What tumble prints could not be written")


@pytest.mark.parametrize(
    "call", ["--help", "calibrate --help", "inspect tumbled.csv", f"{CALIBRATE} -o out -v"]
)
def test_one_column_stops_nothing(tumble: Bench, call: str) -> None:
    answer = tumble.apart(call, COLUMNS="1", LINES="5")
    assert answer.returncode in (0, 1), answer.stderr
    assert answer.stderr == b""


def test_names_and_contents_do_nothing_to_the_terminal(tumble: Bench) -> None:
    named = tumble.folder / "a\x1b[31mred\x1b]0;title\x07\u202e.csv"
    (tumble.folder / "tumbled.csv").rename(named)
    for answer in (tumble.run("inspect", named), tumble.run("inspect", Path("no\x1b[2Jwhere.csv"))):
        said = answer.out + answer.err
        assert not {"\x1b", "\x07", "\u202e"} & set(said)
        assert "\\x1b" in said


def test_a_name_that_is_no_utf_8_is_a_name(tumble: Bench) -> None:
    named = Path(os.fsdecode(b"caf\xe9.csv"))
    (tumble.folder / "tumbled.csv").rename(tumble.folder / named)
    for call in ("inspect", "calibrate --gravity 9.81 -o out"):
        answer = tumble.apart(call, named)
        assert answer.returncode in (0, 1), answer.stderr.decode()
        answer.stdout.decode("utf-8")
    assert "caf?.csv" in tumble.text("out/calibration.json")


def test_what_was_typed_is_not_repeated_at_any_length(bench: Bench) -> None:
    answer = bench.run("simulate", "x" * 3000, "-o out")
    assert answer.status == 2
    assert len(answer.err) < 1500
    assert "…" in answer.err
    assert len(shortened("word " * 2000)) < 2000
    assert shortened("a short sentence.") == "a short sentence."


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
def test_shares_are_whole_and_add_up_to_100(resting, moving, shown):
    assert shares(resting, moving) == shown
    assert sum(shown) == 100


# --- where it runs


def test_no_home_and_no_cache_are_needed(tumble: Bench) -> None:
    """Not even root may write to this place."""
    home, before = "/proc/self/fdinfo", set(tumble.contents())
    places = {
        "XDG_CACHE_HOME": f"{home}/cache",
        "XDG_CONFIG_HOME": f"{home}/config",
        "TMPDIR": f"{home}/temporary",
    }
    answer = tumble.apart(CALIBRATE, "-o out", HOME=home, **places)
    assert answer.returncode in (0, 1), answer.stderr
    assert answer.stderr == b""
    assert {name for name in tumble.contents() if not name.startswith("out/")} == before


def test_a_clock_that_stands_stops_nothing(tumble: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("time", "monotonic", "perf_counter", "process_time"):
        monkeypatch.setattr(time, name, lambda: 1.0e9)
    answer = tumble.run(CALIBRATE, "-o out -v")
    assert answer.status in (0, 1), answer.err
    assert tumble.run("simulate six-position --sample-rate 5 -o made").status == 0


# --- a stop at any moment


@pytest.mark.parametrize(
    ("name", "number", "status"),
    [
        ("tumble.cli.application", "SIGINT", 130),
        ("typer", "SIGTERM", 143),
        ("numpy", "SIGINT", 130),
        ("scipy", "SIGTERM", 143),
    ],
)
def test_a_stop_while_python_imports_is_one_line(bench: Bench, name: str, number: str, status: int) -> None:
    answer = bench.apart("demo -o demo", code=SENT.format(name=name, number=number) + RUN)
    one_line(answer, status, "Stopped; no file was changed.")
    assert bench.contents() == {}


def test_a_stop_that_is_to_be_ignored_is_ignored(bench: Bench) -> None:
    code = SENT.format(name="typer", number="SIGINT") + RUN
    answer = bench.apart("--version", code=code, shell="trap '' INT; exec \"$@\"")
    assert answer.returncode == 0, answer.stderr
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


# Sends Ctrl-C from inside, when files are written for the N-th time.
AT_WRITING = """
import os, signal
calls, real = [0], os.fsync
def call(*arguments, **options):
    calls[0] += 1
    if calls[0] == {at}:
        os.kill(os.getpid(), signal.SIGINT)
    return real(*arguments, **options)
os.fsync = call
"""
AFTER_WRITING = """
import os, signal
from importlib import import_module
workflow = import_module("tumble.workflows.calibrate")
real = workflow.write_run
def write_and_stop(*arguments, **options):
    made = real(*arguments, **options)
    os.kill(os.getpid(), signal.SIGINT)
    return made
workflow.write_run = write_and_stop
"""


def stopped(process: subprocess.Popen[str]) -> str:
    """Wait for the end; return what stands on stderr, which is one line."""
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in err, err
    assert len(err.splitlines()) == 1, err
    assert "Stopped" in err
    return err


@pytest.mark.parametrize(
    ("call", "at"),
    [
        (f"{CALIBRATE} -o made", 2),
        ("apply calibrated tumbled.csv -o corrected.csv", 1),
        ("apply calibrated tumbled.csv -o corrected.parquet", 1),
        ("simulate six-position --sample-rate 5 -o made", 3),
        ("reproduce hayal-4.2 -o made", 3),
    ],
)
def test_ctrl_c_while_writing_leaves_the_earlier_results_and_no_part(tumble, call, at):
    """All files are written beside their places before any takes its place; without earlier ones none is left."""
    before = tumble.contents()
    stopped(tumble.start(call, before=AT_WRITING.format(at=at)))
    assert tumble.contents() == before
    tumble(call, "-q")
    for name, content in tumble.contents().items():
        if name not in before:
            (tumble.folder / name).write_bytes(
                content + b"\n"
            )  # what is written anew has one end of a line less
    earlier = tumble.contents()
    stopped(tumble.start(call, before=AT_WRITING.format(at=at)))
    assert tumble.contents() == earlier


def test_ctrl_c_after_the_files_are_in_place_says_so(tumble: Bench) -> None:
    process = tumble.start(CALIBRATE, "-o made", before=AFTER_WRITING)
    assert "files that were written until then are complete" in stopped(process)
    assert tumble.json("made/calibration.json")["format"] == "tumble calibration"


def test_a_reader_that_goes_away_ends_the_program_quietly(tumble: Bench) -> None:
    """`tumble ... | head`: no traceback when nobody reads on."""
    process = tumble.start(CALIBRATE, "-o results --json")
    process.stdout.close()
    err = process.stderr.read()
    process.wait(timeout=60)
    assert "Traceback" not in err
    assert process.returncode == 0
    assert set(tumble.contents("results")) == {"calibration.json", "report.html"}
