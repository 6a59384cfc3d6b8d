"""How fast recordings are read, beside polars and numpy alone, in one run.

    python benchmarks/reading.py --megabytes 660 --folder FOLDER

Writes a CSV and a file with runs of spaces, reads each with `read_recording`, block by block, and with
polars and numpy alone, and prints seconds of the processor, MB/s and the ratio to polars alone. Small files
of 3 MB show the cost of a start. Timings move with the machine: compare ratios.
"""

from __future__ import annotations

import os

# As the commands do: threads that wait for one another cost as much again.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl

from tumble.recording import read_blocks, read_recording

NAMES = ("t", "ax", "ay", "az", "gx", "gy", "gz")
BYTES_PER_ROW = 66
UNITS = "m/s^2,counts"


def rows_of(count: int, seed: int = 1) -> pl.DataFrame:
    """Rest in one pose with noise, rounded as a logger rounds."""
    rng = np.random.default_rng(seed)
    columns = {"t": np.arange(count) / 100.0}
    for name, level in zip(NAMES[1:], (0.5, -0.7, 9.8, 0.0, 0.0, 0.0), strict=True):
        columns[name] = np.round(level + 0.05 * rng.normal(size=count), 6)
    return pl.DataFrame(columns)


def best(work: Callable[[], object], repeats: int) -> float:
    times: list[float] = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def written(folder: Path, megabytes: float) -> tuple[Path, Path]:
    """A comma-separated file and one with runs of spaces, of the same rows."""
    comma, spaces = folder / f"{megabytes:g}.csv", folder / f"{megabytes:g}.txt"
    if not comma.exists():
        rows_of(round(megabytes * 1e6 / BYTES_PER_ROW)).write_csv(comma)
    if not spaces.exists():
        with comma.open("rb") as source, spaces.open("wb") as target:
            source.readline()
            while piece := source.read(1 << 24):
                target.write(piece.replace(b",", b"   ").replace(b"\n", b"\n   "))
    return comma, spaces


def show(title: str, seconds: float, size: int, reference: float | None = None) -> None:
    ratio = "" if reference is None else f"  {seconds / reference:5.2f} x polars alone"
    print(f"  {title:34s} {seconds:8.3f} s {size / 1e6 / seconds:8.0f} MB/s{ratio}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--megabytes", type=float, default=660.0)
    parser.add_argument("--folder", type=Path, default=None)
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        for megabytes in (3.0, options.megabytes):
            compare(*written(folder, megabytes), options.repeats, megabytes < 50)


def compare(comma: Path, spaces: Path, repeats: int, small: bool) -> None:
    """Print the table of one size."""
    schema = dict.fromkeys(NAMES, pl.Float64)
    size, size_of_spaces = comma.stat().st_size, spaces.stat().st_size
    print(f"{comma.name}, {size / 1e6:.0f} MB")
    alone = best(lambda: pl.read_csv(comma, schema=schema), repeats)
    show("polars alone", alone, size)
    if small:
        show("numpy.loadtxt alone", best(lambda: np.loadtxt(comma, delimiter=",", skiprows=1), repeats), size)
    show("read_recording, commas", best(lambda: read_recording(comma, units=UNITS), repeats), size, alone)
    seconds = best(lambda: read_recording(spaces, units=UNITS), repeats)
    show("read_recording, runs of spaces", seconds, size_of_spaces, alone)
    blocks = best(lambda: sum(len(b) for b in read_blocks(comma, units=UNITS)), repeats)
    show("read_blocks, commas", blocks, size, alone)


if __name__ == "__main__":
    main()
