"""Many short recordings in one process by the Python API: calls a second of a core, and that nothing stays behind.

    python benchmarks/python_loop.py [--recordings 200] [--different 10]

Recordings by hand of some 150 s at 100 Hz with 26 holds each are simulated and read once; then each call calibrates
one that is read already, and the first pass its file, too. Printed are processor seconds a call after the first, how
much the peak of the memory grows from the tenth call to the last, and whether two threads give the numbers that one
after another gave. Processor time grows beside other work on the machine: run it alone.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import resource
import statistics
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

import tumble

SITE = tumble.Site.from_gravity(9.81)


def values(paths: Path | tumble.Recording) -> np.ndarray:
    """The parameters of a calibration."""
    run = tumble.calibrate(paths, site=SITE)
    return np.array([parameter.value for parameter in run.estimate.parameters])


def peak() -> float:
    """Largest memory up to now, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def timed(work: Callable[[], object]) -> float:
    started = time.process_time()
    work()
    return time.process_time() - started


def main() -> None:
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--recordings", type=int, default=200)
    parser.add_argument("--different", type=int, default=10)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / str(seed) / "recording.csv" for seed in range(asked.different)]
        for seed, file in enumerate(files):
            tumble.simulate("hand-held", output=file.parent, seed=seed)
        read = [tumble.read_recording(file) for file in files]
        print(f"{len(read)} recordings of {read[0].time[-1] - read[0].time[0]:.0f} s, {len(read[0])} samples")
        alone = [values(file) for file in files]
        before, spent = 0.0, list[float]()
        for number in range(asked.recordings):
            before = peak() if number == 10 else before
            spent.append(timed(lambda at=number: values(files[at % len(files)])))
        again = statistics.median(timed(lambda one=one: values(one)) for one in read)
    middle = statistics.median(spent)
    print(f"from files: {middle:.3f} s of processor time a call, {1.0 / middle:.1f} a second of a core")
    print(f"from recordings that are read: {again:.3f} s")
    print(f"memory grew by {peak() - before:.1f} MB from the tenth call to the last")
    with ThreadPoolExecutor(2) as pool:
        threaded = list(pool.map(values, read))
    same = all(np.array_equal(one, other) for one, other in zip(alone, threaded, strict=True))
    print(f"two threads: {'the same numbers' if same else 'OTHER NUMBERS'}")


if __name__ == "__main__":
    main()
