"""tumble beside others, as whole processes in pairs A B A B: processor time, wall time and peak memory.

    python benchmarks/peers.py [--rounds 5] [--only WORD] [--imu-tk PROGRAM] [--kf-gins COMMAND --drive FOLDER]
    python benchmarks/peers.py --growth [--hundred]
    python benchmarks/peers.py --commands
    python benchmarks/peers.py --tables

Both of a pair run in turns, so that what else the machine does falls on both; the ratio is the median of the pairs'
own ratios of processor time. Bytecode is there from the first round on, which is not counted. Whoever is not there is
left out and said so; none of them is needed by tumble.

- allantools and imucal: `pip install allantools imucal`.
- imu_tk (C++, Ceres): its example `test_imu_calib`, which takes two files of an accelerometer and a gyro. Build it with
  `apt install libceres-dev libeigen3-dev` and `-O3 -DNDEBUG`, its visualisation left out and its setters made `void`
  (they promise a value and return none, which ends the program), and give the program by `--imu-tk`. It took 0.49 s of
  processor time and 76 MB for the Xsens recording where `tumble calibrate` with its report took 0.83 s and 121 MB.
- KF-GINS (C++): give its whole command by `--kf-gins` and the car drive's folder of `drive_program.py` by `--drive`; it
  wants increments in forward, right, down. It took 0.66 s and 20 MB for the drive where tumble took 0.51 s and 106 MB.
- python-ins (`pip install pyins`) has no program: `navigation.py --speed --processor` compares the functions.

`--growth` prints how cost grows with the samples of one recording, with its segments (the Xsens recording end to end,
to 100 times) and with the units, as the slope of the logarithm of the processor time, start-up taken off: 1 is in
proportion. `--hundred` takes samples and units to 100 times, too. `--commands` prints what each command's help costs,
and `--tables` what a whole calibration of a simulated table recording at 50 Hz does, and a plan of one after it.
"""

from __future__ import annotations

import argparse
import gzip
import math
import os
import shlex
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

HERE = Path(__file__).resolve().parent
XSENS = HERE.parent / "tests" / "reference" / "xsens_mti_hand"
PROGRAM = "import sys; from tumble.cli import program; sys.argv[0] = 'tumble'; program()"
EVERY_NAME = "import tumble; [getattr(tumble, name) for name in tumble.__all__]"
TUMBLE = (sys.executable, "-c", PROGRAM)
# Bytecode is kept, as it is wherever a program is installed. One thread of linear algebra, for all that is compared:
# threads that numpy starts turn for a tenth of a second and wait, which is processor time of nobody's work.
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
ENVIRONMENT |= {"OPENBLAS_NUM_THREADS": "1"}
NUMPY = (sys.executable, "-c", "import numpy")
NOISE = """
import sys, time
import numpy as np
signal, at = np.random.default_rng(1).standard_normal(1_000_000), np.unique(np.geomspace(1, 300_000, 94).astype(int))
{prepare}
started = time.process_time()
{work}
print(time.process_time() - started)
"""
OURS = NOISE.format(
    prepare="from tumble.noise import allan_deviation; allan_deviation(signal[:99], 100.0, taus=[0.01])",
    work="allan_deviation(signal, 100.0, taus=at / 100.0)",
)
ALLANTOOLS = NOISE.format(
    prepare="import allantools",
    work="allantools.oadev(signal, rate=100.0, data_type='freq', taus=at / 100.0)",
)


@dataclass(frozen=True)
class Cost:
    """Processor and wall seconds and peak megabytes of a process."""

    processor: float
    wall: float
    memory: float


@dataclass(frozen=True)
class Pair:
    """Two commands, and what their ratio or the milliseconds more may be; `inner` ones print the seconds that count."""

    name: str
    ours: Sequence[str]
    theirs: Sequence[str]
    peer: str
    most: float | None = None
    more_ms: float | None = None
    inner: bool = False


def run(command: Sequence[str], *, inner: bool = False) -> Cost:
    """Run a command to its end; one that fails ends the benchmark, but for a verdict that is not fit."""
    started = time.perf_counter()
    with tempfile.TemporaryFile("w+") as printed:
        process = subprocess.Popen(
            command, stdout=printed, stderr=subprocess.STDOUT, text=True, env=ENVIRONMENT
        )
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - started
        process.returncode = os.waitstatus_to_exitcode(status)
        printed.seek(0)
        said = printed.read()
    if process.returncode not in (0, 1) or "Traceback" in said:
        sys.exit(f"{shlex.join(command)[-200:]} ended with {process.returncode}:\n{said}")
    processor = float(said.split()[-1]) if inner else usage.ru_utime + usage.ru_stime
    return Cost(processor, wall, usage.ru_maxrss / 1024.0)


def compare(pair: Pair, rounds: int) -> None:
    """Print a pair's medians."""
    made = [
        [run(command, inner=pair.inner) for command in (pair.ours, pair.theirs)] for _ in range(rounds + 1)
    ]
    made = made[1:]
    for whose, costs in zip(("tumble", pair.peer), zip(*made, strict=True), strict=True):
        middle = [
            statistics.median(getattr(c, name) for c in costs) for name in ("processor", "wall", "memory")
        ]
        print(f"  {whose:24s}{middle[0]:9.3f} s{middle[1]:9.3f} s wall{middle[2]:7.0f} MB")
    ratio = statistics.median(a.processor / b.processor for a, b in made)
    more = 1e3 * statistics.median(a.processor - b.processor for a, b in made)
    aim = f"; aim {pair.most:g} at most" if pair.most is not None else ""
    aim = f"; aim {pair.more_ms:+.0f} ms at most" if pair.more_ms is not None else aim
    print(f"  ratio {ratio:.3f}, {more:+.0f} ms{aim}")


def xsens(folder: Path, copies: int = 1) -> list[str]:
    """Write the recording so often end to end; return the names of both files."""
    made: list[str] = []
    for triad in ("acc", "gyro"):
        packed = XSENS / f"xsens_{triad}.txt.gz"
        with gzip.open(packed, "rt") as file:
            stamps = [float(line.split(maxsplit=1)[0]) for line in file if line.strip()]
        length = stamps[-1] - stamps[0] + 0.01
        made.append(str(folder / f"{triad}-{copies}.txt"))
        with Path(made[-1]).open("w") as written:
            for copy in range(copies):
                with gzip.open(packed, "rt") as file:
                    rows = (line.split(maxsplit=1) for line in file if line.strip())
                    written.writelines(f"{float(t) + copy * length:.6f} {rest}" for t, rest in rows)
    return made


def calibrated(files: Sequence[str], folder: Path) -> list[str]:
    return [*TUMBLE, "calibrate", *files, "--gravity", "9.81744", "-o", str(folder / "made")]


def pairs(asked: argparse.Namespace, folder: Path) -> list[Pair]:
    """The pairs of which both are there."""
    files = xsens(folder)
    found = [
        Pair("tumble --help", [*TUMBLE, "--help"], NUMPY, "import numpy", more_ms=60.0),
        Pair("every public name", [sys.executable, "-c", EVERY_NAME], NUMPY, "import numpy"),
    ]
    if find_spec("imucal"):
        theirs = [sys.executable, "-c", "import imucal"]
        found.append(Pair("import", [sys.executable, "-c", EVERY_NAME], theirs, "imucal", most=1.0))
    if find_spec("allantools"):
        ours, theirs = ([sys.executable, "-c", code] for code in (OURS, ALLANTOOLS))
        found.append(
            Pair("noise, 10⁶ samples, 85 times", ours, theirs, "allantools", most=1 / 30, inner=True)
        )
    if asked.imu_tk:
        theirs = [*shlex.split(asked.imu_tk), *files]
        found.append(Pair("Xsens with report", calibrated(files, folder), theirs, "imu_tk", most=1.0))
    if asked.kf_gins:
        drive = [
            str(HERE / "drive_program.py"),
            asked.drive,
            str(folder / "drive"),
            "--offset",
            "-1436038199.812",
        ]
        theirs = shlex.split(asked.kf_gins)
        found.append(Pair("drive", [sys.executable, *drive, "--every-sample"], theirs, "KF-GINS", most=1.0))
    here = {pair.peer for pair in found}
    for peer in ("imucal", "allantools", "imu_tk", "KF-GINS"):
        if peer not in here:
            print(
                f"{peer} is not there: see `python benchmarks/peers.py --help` and this file's first lines."
            )
    return found


def print_slope(name: str, costs: dict[int, Cost], start: float) -> None:
    """Print processor times and memory by size, and the slope of the times from each to the next."""
    sizes, times = sorted(costs), {size: cost.processor for size, cost in costs.items()}
    slopes = [math.log((times[b] - start) / (times[a] - start)) / math.log(b / a) for a, b in pairwise(sizes)]
    stated = ", ".join(f"×{size}: {times[size]:.2f} s, {costs[size].memory:.0f} MB" for size in sizes)
    print(f"{name:20s}{stated}; slope {', '.join(f'{slope:.2f}' for slope in slopes)}", flush=True)


def growth(asked: argparse.Namespace, folder: Path) -> None:
    """Print how cost grows: with the rate of one recording, with the holds of its copies, and with units."""
    sizes = [1, 10, 100] if asked.hundred else [1, 10]
    start = min(run([sys.executable, "-c", EVERY_NAME]).processor for _ in range(3))
    print(f"start-up {start:.2f} s of processor time")
    costs = dict[int, Cost]()
    for times in sizes:
        made, rate = folder / f"rate-{times}", str(100 * times)
        run([*TUMBLE, "simulate", "hand-held", "--seed", "1", "--sample-rate", rate, "-o", str(made)])
        costs[times] = run(calibrated([str(made / "recording.csv")], folder))
    print_slope("samples a second", costs, start)
    costs = {copies: run(calibrated(xsens(folder, copies), folder)) for copies in (1, 10, 30, 100)}
    print_slope("segments", costs, start)
    costs = dict[int, Cost]()
    for units in sizes:
        lot = folder / f"lot-{units}"
        for number in range(units):
            (lot / f"unit-{number}").mkdir(parents=True)
            for name, triad in zip(xsens(folder), ("acc", "gyro"), strict=True):
                os.link(name, lot / f"unit-{number}" / f"{triad}.txt")
        manifest = lot / "units.csv"
        rows = [f"unit-{n},unit-{n}/acc.txt;unit-{n}/gyro.txt" for n in range(units)]
        manifest.write_text("\n".join(["unit,files", *rows]) + "\n")
        batch = [*TUMBLE, "batch", str(manifest), "-o", str(folder / f"out-{units}"), "--gravity", "9.81744"]
        costs[units] = run([*batch, "--workers", "1"])
    print_slope("units", costs, start)


def print_commands(rounds: int) -> None:
    """Print what each command's help costs beside `import numpy`."""
    from tumble.cli import COMMANDS

    for name in COMMANDS:
        made = [(run([*TUMBLE, name, "--help"]), run(NUMPY)) for _ in range(rounds + 1)][1:]
        more = statistics.median(ours.processor - theirs.processor for ours, theirs in made)
        print(f"tumble {name + ' --help':24s}{1e3 * more:+6.0f} ms over `import numpy`")


def print_tables(rounds: int, folder: Path) -> None:
    """Print what whole commands on tables cost, from start to report."""
    for name in ("turntable-9", "rate-table", "strapdown-rotation"):
        for grade in ("tactical", "consumer-mems"):
            place, made = folder / f"{name}-{grade}", folder / "made"
            unit = ("--imu", grade, "--seed", "1", "--site", "48.1", "--sample-rate", "50")
            run([*TUMBLE, "simulate", name, *unit, "-o", str(place)])
            command = [*TUMBLE, "calibrate", "--protocol", str(place / "protocol.yaml"), "-o", str(made)]
            spent = statistics.median(run(command).processor for _ in range(rounds + 1))
            print(f"{f'calibrate {name}, {grade}':44s}{spent:6.2f} s of processor time", flush=True)
    plan = [*TUMBLE, "plan", "rate-table", "--given", str(folder / "made")]
    spent = statistics.median(run(plan).processor for _ in range(rounds))
    print(f"{'plan rate-table --given CALIBRATION':44s}{spent:6.2f} s of processor time")


def main() -> None:
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--only", default="", help="pairs whose name has this word")
    parser.add_argument("--imu-tk", help="program that takes the accelerometer's and the gyro's file")
    parser.add_argument("--kf-gins", help="command with its configuration")
    parser.add_argument("--drive", help="folder of the car drive")
    parser.add_argument("--growth", action="store_true")
    parser.add_argument("--hundred", action="store_true", help="grow samples and units to a hundred")
    parser.add_argument("--commands", action="store_true")
    parser.add_argument("--tables", action="store_true")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        if asked.growth:
            growth(asked, Path(name))
        elif asked.commands:
            print_commands(asked.rounds)
        elif asked.tables:
            print_tables(asked.rounds, Path(name))
        else:
            for pair in pairs(asked, Path(name)):
                if asked.only in pair.name:
                    print(pair.name)
                    compare(pair, asked.rounds)


if __name__ == "__main__":
    main()
