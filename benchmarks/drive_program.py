"""A whole program over a real drive, from the interpreter's start to files written: read, align, filter, write.

    python benchmarks/drive_program.py FOLDER OUT --offset -1436038199.812
    python benchmarks/drive_program.py FOLDER OUT --offset -1436038199.812 --repeats 10

FOLDER holds the car drive of rtklibexplorer/GNSS_IMU: imu_1934.csv and gnss_1934_sf.pos. `--repeats` runs the program
so often in processes of its own and prints the least time and processor time. `--every-sample` keeps and writes the
state and its standard deviations at every sample of the IMU, as KF-GINS does, and not at the fixes alone; without
`--offset` the offset between the clocks is found first. Bytecode is there from the second run on.
"""

from __future__ import annotations

import argparse
import gc
import os
import sys
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def run(asked: argparse.Namespace) -> None:
    # a program that ends after one drive has nothing to collect
    gc.disable()
    import numpy as np

    from tumble.navigation import InertialSamples, TriadSpread, plan_filter, prepare_drive, read_track
    from tumble.noise.terms import NoiseModel
    from tumble.recording import read_recordings

    setup = plan_filter(
        NoiseModel(random_walk=0.02, rate_random_walk=1e-3),
        NoiseModel(random_walk=0.003, rate_random_walk=1e-5),
        accelerometer=TriadSpread(bias=0.2, scale_factor=0.01, non_orthogonality=0.01),
        gyroscope=TriadSpread(bias=0.01, scale_factor=0.01, misalignment=0.01),
    )
    recording = read_recordings(asked.folder / "imu_1934.csv", units="g,deg/s,ms")[0]
    samples = InertialSamples.from_recording(recording)
    drive = prepare_drive(
        samples, read_track(asked.folder / "gnss_1934_sf.pos"), setup=setup, offset=asked.offset
    )
    instants = samples.time[samples.time > drive.start.time] if asked.every_sample else None
    found = drive.run(setup, interval=1.0, instants=instants)
    path = found.trajectory
    table = np.column_stack(
        [
            path.time,
            np.degrees(path.latitude),
            np.degrees(path.longitude),
            path.height,
            path.velocity_n,
            np.degrees(path.roll_pitch_yaw),
            found.sigmas[:, :9],
        ]
    )
    line = "%.6f %.10f %.10f %.4f" + " %.5f" * 15 + "\n"
    asked.out.mkdir(parents=True, exist_ok=True)
    with (asked.out / "drive.txt").open("w") as file:
        for first in range(0, len(table), 1000):
            rows = table[first : first + 1000]
            file.write(line * len(rows) % tuple(rows.ravel().tolist()))
    print(f"{len(samples)} samples, {len(found.fixes)} fixes, {len(table)} states written")


def repeated(asked: argparse.Namespace) -> None:
    import resource
    import subprocess

    command = [
        argument for argument in sys.argv if argument != "--repeats" and argument != str(asked.repeats)
    ]
    wall: list[float] = []
    spent: list[float] = []
    for _ in range(asked.repeats):
        before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run([sys.executable, *command], check=True, stdout=subprocess.DEVNULL)
        wall.append(time.perf_counter() - started)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    print(
        f"{asked.repeats} runs, least and median: {min(wall):.2f} and {sorted(wall)[len(wall) // 2]:.2f} s, of the "
        f"processor {min(spent):.2f} and {sorted(spent)[len(spent) // 2]:.2f} s; load {os.getloadavg()[0]:.1f} on "
        f"{os.cpu_count()} cores"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--offset", type=float)
    parser.add_argument("--every-sample", action="store_true")
    parser.add_argument("--repeats", type=int, default=0)
    asked = parser.parse_args()
    if asked.repeats:
        repeated(asked)
    else:
        run(asked)


if __name__ == "__main__":
    main()
