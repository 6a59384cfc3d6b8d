"""`tumble calibrate` as a whole process on the Xsens recording, and on ten of it end to end.

    python benchmarks/calibrate.py [--runs 5]

Warm caches: one run before the counted ones. Prints wall seconds (median, least, largest), peak
memory, what the process itself says of its stages, and ratios in the same run: to starting Python with
the libraries alone, and of the ten-fold recording to the single one. imu_tk (C++, Ceres) takes 0.76 s
and 78 MB for the single one on a machine of this kind, without any report; it cannot be installed by
pip, so that it is no part of this run.
"""

from __future__ import annotations

import argparse
import gzip
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[1] / "tests" / "reference" / "xsens_mti_hand"
LIBRARIES = "import numpy, scipy.special, pydantic, typer, rich.console, rich.table"
TUMBLE = "import sys; from tumble.cli.main import program; sys.argv[0] = 'tumble'; program()"


def ten_fold(lines: list[str], copies: int) -> str:
    """Return the recording repeated, each copy's stamps after the last one's."""
    rows = [line.split() for line in lines if line.strip()]
    length = float(rows[-1][0]) - float(rows[0][0]) + 0.01
    return "".join(
        f"{float(row[0]) + copy * length:.6f} {row[1]} {row[2]} {row[3]}\n"
        for copy in range(copies)
        for row in rows
    )


def run(code: str, *arguments: str) -> tuple[float, float, str]:
    """Run Python once; return wall seconds, peak memory in MB and what it printed."""
    started = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-c", code, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, "COLUMNS": "200"},
    )
    assert process.stdout is not None
    printed = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - started
    if os.waitstatus_to_exitcode(status) != 0:
        raise SystemExit(printed)
    return seconds, usage.ru_maxrss / 1024.0, printed


def measure(name: str, runs: int, code: str, *arguments: str) -> float:
    """Print a row and return the median of the wall seconds."""
    run(code, *arguments)
    results = [run(code, *arguments) for _ in range(runs)]
    seconds = [result[0] for result in results]
    middle = statistics.median(seconds)
    memory = statistics.median(result[1] for result in results)
    print(f"{name:44s}{middle:8.2f} s  [{min(seconds):.2f}, {max(seconds):.2f}]{memory:9.0f} MB")
    stages = re.search(r"^time: (.*)$", results[-1][2], re.M)
    if stages:
        print(f"{'':44s}  {stages[1]}")
    return middle


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for triad in ("acc", "gyro"):
            text = gzip.decompress((FOLDER / f"xsens_{triad}.txt.gz").read_bytes()).decode()
            (folder / f"xsens_{triad}.txt").write_text(text)
            (folder / f"ten_{triad}.txt").write_text(ten_fold(text.splitlines(), 10))
        common = ("--gravity", "9.81744", "-v", "-o", str(folder / "out"))
        libraries = measure("Python with the libraries alone", options.runs, LIBRARIES)
        once = measure(
            "tumble calibrate, Xsens (51,175 samples)",
            options.runs,
            TUMBLE,
            "calibrate",
            str(folder / "xsens_acc.txt"),
            str(folder / "xsens_gyro.txt"),
            *common,
        )
        ten = measure(
            "tumble calibrate, ten times as long",
            options.runs,
            TUMBLE,
            "calibrate",
            str(folder / "ten_acc.txt"),
            str(folder / "ten_gyro.txt"),
            *common,
        )
    print(f"calibrate / libraries alone: {once / libraries:.2f}")
    print(
        f"ten-fold / single: {ten / once:.2f}; without start-up: {(ten - libraries) / (once - libraries):.2f}"
    )


if __name__ == "__main__":
    main()
