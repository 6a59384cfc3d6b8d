"""Commands that are killed, stopped, given no more disk or run twice at once, over results that are there already."""

import json
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

SIGNALS = (signal.SIGKILL, signal.SIGINT, signal.SIGTERM)
STATUS = {signal.SIGINT: 130, signal.SIGTERM: 143}
SAID = "tumble: Stopped; no file was changed.\n"
OLD = "an earlier result, which is somebody's\n"
COMMANDS = {
    "calibrate": ("calibrate tumbled.csv --gravity 9.81 -o out", ("out/calibration.json", "out/report.html")),
    "apply": ("apply calibration.json hand.csv -o out/corrected.csv", ("out/corrected.csv",)),
    "apply to Parquet": (
        "apply calibration.json hand.csv -o out/corrected.parquet",
        ("out/corrected.parquet",),
    ),
    "noise": ("noise still.csv -o out", ("out/noise.json", "out/noise.html")),
    "verify": ("verify calibration.json tumbled.csv", ()),
    "simulate": (
        "simulate six-position -o out --sample-rate 5 --seed 1",
        ("out/recording.csv", "out/protocol.yaml", "out/truth.json"),
    ),
    "convert": ("convert calibration.json --to python -o out/made.py", ("out/made.py",)),
}
"""By name: the call, and the files that it writes."""
# What differs from run to run: when it was, and how long it took.
_MOMENTS = re.compile(rb"\d{4}-\d\d-\d\d[T ][\d:.+]+|\d+\.\d+ m?s\b|\"seconds?\": [\d.]+")


class Place:
    """A folder with sound inputs, whole results to compare with, and a temporary folder that is to stay empty."""

    def __init__(self, folder: Path) -> None:
        from tests.fuzz.seeds import HEADER, rows, seeds, text, tumbled

        self.folder, self.temporary = folder, folder / "temporary"
        self.temporary.mkdir()
        (folder / "hand.csv").write_text(f"{HEADER}\n{text(rows())}")
        (folder / "tumbled.csv").write_bytes(tumbled())
        still = np.random.default_rng(5).normal([0, 0, 9.8, 0, 0, 0], 0.01, (2000, 6))
        still = np.column_stack([np.arange(2000) / 50.0, still])
        (folder / "still.csv").write_text(f"{HEADER}\n{text(still)}")
        (folder / "calibration.json").write_bytes(seeds()["calibration"][0][1])
        self.inputs = {p.name: p.read_bytes() for p in folder.iterdir() if p.is_file()}
        self.whole: dict[str, bytes] = {}
        self.taken: dict[str, float] = {}

    def start(self, name: str, prepare: Callable[[], None] | None = None) -> subprocess.Popen[bytes]:
        """Start a command."""
        return subprocess.Popen(
            [sys.executable, "-c", "from tumble.cli import program; program()", *COMMANDS[name][0].split()],
            cwd=self.folder,
            env={**os.environ, "TMPDIR": str(self.temporary)},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
            preexec_fn=prepare,
        )

    def put_old(self, name: str) -> None:
        """Let only earlier results of a command be there."""
        shutil.rmtree(self.folder / "out", ignore_errors=True)
        (self.folder / "out").mkdir()
        for file in COMMANDS[name][1]:
            (self.folder / file).write_text(_old(file))

    def learn(self, names: list[str]) -> None:
        """Run each command in peace: how long it takes, and what whole results are."""
        for name in names:
            self.put_old(name)
            began = time.perf_counter()
            said = self.start(name).communicate()[1]
            self.taken[name] = time.perf_counter() - began
            for file in COMMANDS[name][1]:
                content = (self.folder / file).read_bytes()
                assert content != _old(file).encode(), f"{name} wrote no {file}: {said!r}"
                self.whole[file] = content

    def state(self, name: str) -> tuple[set[str], list[str]]:
        """Return which states ("old", "new") the results of a command are in, and what is wrong."""
        wrong = [
            f"{n} is not the input it was"
            for n, c in self.inputs.items()
            if (self.folder / n).read_bytes() != c
        ]
        states: set[str] = set()
        for file in COMMANDS[name][1]:
            content = (self.folder / file).read_bytes() if (self.folder / file).exists() else b""
            if content == _old(file).encode():
                states.add("old")
            elif _MOMENTS.sub(b"", content) == _MOMENTS.sub(b"", self.whole[file]):
                states.add("new")
            else:
                wrong.append(f"{file} is neither the old one nor a whole new one ({len(content)} bytes)")
        return states, wrong

    def pieces(self, name: str) -> list[str]:
        """Return what is there and is no result, and remove it."""
        kept = {self.folder / file for file in COMMANDS[name][1]}
        left = [
            p
            for p in (self.folder / "out").rglob("*")
            if p.is_file() and p not in kept and not p.parent.name.startswith("before-")
        ]
        left += [p for p in self.temporary.rglob("*") if p.is_file()]
        shutil.rmtree(self.temporary)
        self.temporary.mkdir()
        return [p.name for p in left]


def _old(file: str) -> str:
    """Return an earlier result; over what was not simulated nothing is simulated."""
    return json.dumps({"format": "tumble truth", "note": OLD}) if file.endswith("truth.json") else OLD


def kills(count: int, seed: int = 1, names: list[str] | None = None) -> tuple[Counter[str], list[str]]:
    """Kill or stop so many runs at random moments; return how many of each ended how, and what was wrong."""
    chance, ended, wrong = random.Random(seed), Counter[str](), list[str]()
    names = list(COMMANDS) if names is None else names
    with tempfile.TemporaryDirectory(prefix="tumble-kills-") as folder:
        place = Place(Path(folder))
        place.learn(names)
        for number in range(count):
            name, how = names[number % len(names)], SIGNALS[(number // len(names)) % len(SIGNALS)]
            place.put_old(name)
            process = place.start(name)
            # A tenth of them within the first hundredth of a second.
            time.sleep(chance.uniform(0.0, 0.01 if number % 10 == 9 else 1.05 * place.taken[name]))
            process.send_signal(how)
            said = process.communicate()[1].decode(errors="replace")
            outcome, found = _outcome(place, name, process.returncode, how, said)
            ended[f"{how.name}: {outcome}"] += 1
            wrong += [f"run {number}, {name}, {how.name}: {what}" for what in found]
    return ended, wrong


def _outcome(place: Place, name: str, status: int, how: signal.Signals, said: str) -> tuple[str, list[str]]:
    """Say in words how a run ended, and what is wrong with that."""
    states, wrong = place.state(name)
    left = place.pieces(name)
    if how == signal.SIGKILL:
        return ("ended by itself" if status != -9 else "killed, a piece left" if left else "killed"), wrong
    wrong += [f"left {', '.join(left)}"] if left else []
    if status == -how or ("KeyboardInterrupt" in said and "/tumble/" not in said):
        return "before Python had begun tumble", wrong
    if status in (0, 1):
        return "ended by itself", [*wrong, *(["old results after the end"] if "old" in states else [])]
    if status != STATUS[how] or said != SAID:
        wrong.append(f"status {status}: {said.strip()[-300:]!r}")
    if "new" in states:
        wrong.append("new results, and the words that no file was changed")
    return f"{status} and one line", wrong


def cut_short(names: list[str] | None = None) -> tuple[int, list[str]]:
    """Let the system write no more than some sizes, libraries in C too; return how many runs, and what is wrong."""
    wrong, runs = list[str](), 0
    names = [name for name in (names or COMMANDS) if COMMANDS[name][1]]
    with tempfile.TemporaryDirectory(prefix="tumble-short-") as folder:
        place = Place(Path(folder))
        place.learn(names)
        for name in names:
            largest = max(len(place.whole[file]) for file in COMMANDS[name][1])
            for size in (100, largest - 1):
                place.put_old(name)
                limit = (size, size)
                process = place.start(name, lambda: resource.setrlimit(resource.RLIMIT_FSIZE, limit))  # noqa: B023
                said = process.communicate()[1].decode(errors="replace")
                runs += 1
                states, found = place.state(name)
                found += [f"left {left}" for left in place.pieces(name)]
                if process.returncode != 3 or said.count("\n") != 1 or "Traceback" in said:
                    found.append(f"status {process.returncode}: {said.strip()[-300:]!r}")
                found += ["a new result"] if "new" in states else []
                wrong += [f"{name}, {size} bytes: {what}" for what in found]
    return runs, wrong


def writers(pairs: int, names: list[str] | None = None) -> tuple[int, list[str]]:
    """Let two programs write the same results at once; return how many pairs, and what is wrong."""
    wrong: list[str] = []
    names = [name for name in (names or COMMANDS) if COMMANDS[name][1]]
    with tempfile.TemporaryDirectory(prefix="tumble-writers-") as folder:
        place = Place(Path(folder))
        place.learn(names)
        for number in range(pairs):
            name = names[number % len(names)]
            place.put_old(name)
            both = [place.start(name) for _ in range(2)]
            said = [process.communicate()[1].decode(errors="replace") for process in both]
            states, found = place.state(name)
            found += [f"left {left}" for left in place.pieces(name)]
            found += ["an old result"] if "old" in states else []
            for process, words in zip(both, said, strict=True):
                if process.returncode not in (0, 1) or words:
                    found.append(f"status {process.returncode}: {words.strip()[-300:]!r}")
            wrong += [f"pair {number}, {name}: {what}" for what in found]
    return pairs, wrong
