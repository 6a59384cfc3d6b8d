"""What starting tumble costs beside `import numpy`, measured in turns within one run.

Every figure is a fresh process of this Python, with bytecode already compiled. The machine's mood
moves all of them alike, so compare within a run: the ratios and the differences count.

    python benchmarks/startup.py [ROUNDS]
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time

HELP = "import sys; sys.argv = ['tumble', '--help']; from tumble.cli.main import main; main()"

# What is measured, and the promise: at most so many milliseconds more than `import numpy`.
CASES: dict[str, tuple[list[str], float | None]] = {
    "python, nothing else": (["-c", "pass"], None),
    "import numpy": (["-c", "import numpy"], None),
    "import tumble": (["-c", "import tumble"], 40.0),
    "every public name": (["-c", "import tumble; [getattr(tumble, name) for name in tumble.__all__]"], None),
    "tumble --help": (["-c", HELP], 80.0),
}


def seconds_of(arguments: list[str]) -> float:
    """Time one fresh process from start to end; a process that fails ends the benchmark."""
    start = time.perf_counter()
    answer = subprocess.run([sys.executable, *arguments], capture_output=True, text=True, check=False)
    elapsed = time.perf_counter() - start
    if answer.returncode:
        sys.exit(f"{arguments[-1]!r} failed:\n{answer.stderr}")
    return elapsed


def main() -> None:
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 15
    times: dict[str, list[float]] = {name: [] for name in CASES}
    for turn in range(rounds + 1):
        for name, (arguments, _) in CASES.items():
            elapsed = seconds_of(arguments)
            if turn:  # the first round warms the disk's cache
                times[name].append(elapsed)
    numpy = statistics.median(times["import numpy"])
    print(f"{'median, taken in turns':24}{'ms':>6}{'of numpy':>10}{'over numpy':>13}{'promise':>13}")
    for name, (_, promise) in CASES.items():
        median = statistics.median(times[name])
        ratio, over = median / numpy, 1e3 * (median - numpy)
        allowed = "" if promise is None else f"<= {promise:+.0f} ms"
        print(f"{name:24}{1e3 * median:6.0f}{ratio:10.2f}{over:+10.0f} ms{allowed:>13}")


if __name__ == "__main__":
    main()
