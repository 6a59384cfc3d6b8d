"""Commands that are killed or stopped at a random moment over an existing result."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

SIGNALS = (signal.SIGKILL, signal.SIGINT, signal.SIGTERM)
STATUS = {signal.SIGKILL: {-9}, signal.SIGINT: {130}, signal.SIGTERM: {143, -15}}


def run(arguments: list[str], folder: Path) -> subprocess.Popen[bytes]:
    """Start the program in a folder."""
    return subprocess.Popen(
        [sys.executable, "-c", "from tumble.cli import program; program()", *arguments],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )


def commands(folder: Path) -> dict[str, list[str]]:
    """Write small inputs; return commands by the result that they write over."""
    from tests.fuzz.seeds import HEADER, rows, seeds, text

    (folder / "hand.csv").write_text(f"{HEADER}\n{text(rows())}")
    (folder / "calibration.json").write_bytes(seeds()["calibration"][0][1])
    return {
        "corrected.csv": ["apply", "calibration.json", "hand.csv", "-o", "corrected.csv"],
        "saved.parquet": ["inspect", "hand.csv", "--save", "saved.parquet"],
        "tumble_calibration.py": [
            "convert",
            "calibration.json",
            "--to",
            "python",
            "-o",
            "tumble_calibration.py",
        ],
        "truth.json": ["simulate", "six-position", "-o", ".", "--seed", "1"],
    }


def findings(kills: int, seed: int = 1) -> tuple[Counter[str], list[str]]:
    """Kill so many runs; return how many of each ended how, and what was wrong."""
    chance, ended, wrong = random.Random(seed), Counter[str](), list[str]()
    with tempfile.TemporaryDirectory(prefix="tumble-kills-") as name:
        folder = Path(name)
        made = commands(folder)
        taken: dict[str, float] = {}
        for result, arguments in made.items():
            began = time.perf_counter()
            run(arguments, folder).communicate()
            taken[result] = time.perf_counter() - began
            if not (folder / result).exists():
                wrong.append(f"{arguments[0]} wrote no {result}")
        whole = {result: (folder / result).read_bytes() for result in made if (folder / result).exists()}
        for number in range(kills):
            result = chance.choice(sorted(whole))
            how = chance.choice(SIGNALS)
            process = run(made[result], folder)
            time.sleep(chance.uniform(0.0, 1.1 * taken[result]))
            process.send_signal(how)
            said = process.communicate()[1].decode(errors="replace")
            ended[f"{how.name} {process.returncode}"] += 1
            wrong += _wrong(folder / result, whole[result], process.returncode, how, said, number)
        left = [p.name for p in folder.iterdir() if p.name.startswith(".")]
        # A process that is killed cannot tidy up; the next one that writes there is another process.
        ended["pieces left by kills"] = len(left)
    return ended, wrong


def _wrong(file: Path, before: bytes, status: int, how: signal.Signals, said: str, number: int) -> list[str]:
    found: list[str] = []
    same = file.exists() and len(file.read_bytes()) == len(before)
    if not same and not (file.suffix == ".json" and file.exists() and _is_json(file)):
        found.append(f"run {number}: {file.name} is not whole after {how.name}")
    if "Traceback" in said and "tumble" not in said:
        return found  # Python had not yet begun the program: the words are its own
    if status not in STATUS[how] and status not in (0, 1):
        found.append(f"run {number}: {how.name} ended with {status}: {said.strip()[-200:]}")
    if "Traceback" in said:
        found.append(f"run {number}: {how.name} left a traceback: {said.strip()[-200:]}")
    return found


def _is_json(file: Path) -> bool:
    try:
        json.loads(file.read_text())
    except ValueError:
        return False
    return True
