"""A production line, simulated: faulty units found, units a second, killed and run again, a cluster whose worker dies.

    python benchmarks/fleet.py faulty [UNITS]     # 200 units, six of them faulty in different ways
    python benchmarks/fleet.py speed [UNITS]      # units a second and memory, twice the units for comparison
    python benchmarks/fleet.py kill [TIMES]       # kill -9 at random moments, resumed, compared
    python benchmarks/fleet.py dask               # a Dask cluster of two workers, one killed in the middle

Without an argument: faulty with 40 units, kill three times, and dask.
"""

from __future__ import annotations

import csv
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from tumble.earth import Site
from tumble.simulation import Motion, find_grade, poses_26, simulate_recording
from tumble.workflows.batch import run_batch
from tumble.workflows.batch_unit import BatchOptions

GRAVITY, RATE, HOLDS = 9.81, 50.0, 20
LIMITS = """name: the line
rule: guarded
limits:
  accelerometer bias: 1 m/s^2
  accelerometer scale factor error: 5 %
  gyro bias: 30 deg/s
  gyro scale factor error: 5 %
"""
RUN = "import sys; from tumble.cli.main import main; sys.argv[0] = 'tumble'; main()"


def rows_of(unit: int, session: int) -> np.ndarray:
    """Time, specific force and angular rate of a consumer unit tumbled by hand."""
    rng = np.random.default_rng([7, session])
    grade = find_grade("consumer-mems")
    model = grade.simulate_model(np.random.default_rng([3, unit]))
    headings = Rotation.from_rotvec(np.outer(rng.uniform(0.0, 6.28, 26), [0.0, 0.0, 1.0]))
    attitudes = (headings * poses_26())[rng.permutation(26)[:HOLDS]]
    motion = Motion.between_poses(attitudes, np.full(HOLDS, 2.6), np.full(HOLDS - 1, 1.5))
    recording, _ = simulate_recording(
        motion, RATE, rng, site=Site.from_gravity(GRAVITY), grade=grade, distort=model.distort
    )
    return np.column_stack([recording.time, recording.specific_force, recording.angular_rate])


def write(path: Path, rows: np.ndarray) -> None:
    np.savetxt(path, rows, fmt="%.7g", delimiter=",", header="t,ax,ay,az,gx,gy,gz", comments="")


def spoil(rows: np.ndarray, how: str) -> np.ndarray:
    """A faulty unit."""
    spoiled, rng = rows.copy(), np.random.default_rng(5)
    if how == "scale 8 % off":
        spoiled[:, 4:] *= 1.08
    elif how == "axis swapped":
        spoiled[:, [1, 2]] = spoiled[:, [2, 1]]
    elif how == "noise tripled":
        noise = np.std(rows[: int(2.0 * RATE), 1:], axis=0)  # the first hold
        spoiled[:, 1:] += np.sqrt(8.0) * noise * rng.normal(size=(len(rows), 6))
    elif how == "dead gyro axis":
        spoiled[:, 5] = 0.0
    elif how == "bias out of limits":
        spoiled[:, 3] += 2.0
    return spoiled


FAULTS = ("scale 8 % off", "axis swapped", "noise tripled", "dead gyro axis", "bias out of limits")


def make(folder: Path, count: int, *, faulty: bool) -> dict[str, str]:
    """Write recordings of units; return which are faulty, and how."""
    folder.mkdir(parents=True)
    wrong: dict[str, str] = {}
    for unit in range(count):
        rows = rows_of(unit, unit)
        if faulty and unit % (count // 6) == 3 and len(wrong) < 5:
            how = FAULTS[len(wrong)]
            rows, wrong[f"u{unit:04d}"] = spoil(rows, how), how
        write(folder / f"u{unit:04d}.csv", rows)
    if faulty:
        write(folder / "twin.csv", rows_of(1, 10_000))
        wrong |= {"twin": "recorded twice", "u0001": "recorded twice"}
    return wrong


def options(folder: Path) -> BatchOptions:
    limits = folder / "limits.yaml"
    limits.write_text(LIMITS, encoding="utf-8")
    return BatchOptions(gravity=GRAVITY, limits=str(limits), reports="none")


def study_faulty(folder: Path, count: int) -> None:
    wrong = make(folder / "units", count, faulty=True)
    batch = run_batch(str(folder / "units"), folder / "out", options(folder))
    named = {unit.unit: unit for unit in batch.units if not unit.accepted or unit.unit in batch.stand_out}
    for name, how in wrong.items():
        said = batch.reasons(named[name])[0][:110] if name in named else "NOT NAMED"
        verdict = f"{named[name].verdict}, {named[name].limits or '–'}" if name in named else ""
        print(f"{how:20} {name:6} {verdict:18} {said}")
    false = sorted(set(named) - set(wrong))
    print(
        f"{len(batch.units)} units: {len(set(wrong) & set(named))} of {len(wrong)} named, {len(false)} others named"
    )
    for name in false:
        print(f"  {name}: {batch.reasons(named[name])[0][:140]}")


def study_speed(folder: Path, count: int) -> None:
    make(folder / "units", 20, faulty=False)
    for number in (count, 2 * count):
        manifest = folder / f"{number}.csv"
        lines = [f"v{k:05d},units/u{k % 20:04d}.csv" for k in range(number)]
        manifest.write_text("unit,files\n" + "\n".join(lines) + "\n", encoding="utf-8")
        begun, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
        run_batch(str(manifest), folder / f"out-{number}", options(folder))
        wall, after = time.perf_counter() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(
            f"{number} units: {number / wall:.2f}/s in {wall:.0f} s, {number / cpu:.2f} a second of a core in the "
            f"workers; {own:.0f} MB at most here, {after.ru_maxrss / 1024:.0f} MB in a worker"
        )


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / "table.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def study_kill(folder: Path, times: int) -> None:
    make(folder / "units", 24, faulty=False)
    call = [
        sys.executable,
        "-c",
        RUN,
        "batch",
        str(folder / "units"),
        "--gravity",
        str(GRAVITY),
        "--reports",
        "none",
    ]
    begun = time.perf_counter()
    subprocess.run([*call, "-o", str(folder / "whole")], stdout=subprocess.DEVNULL, check=False)
    whole, rng = time.perf_counter() - begun, random.Random(3)
    equal = 0
    for number in range(times):
        out, moments = folder / f"killed-{number}", []
        for _ in range(2):
            moments.append(rng.uniform(0.0, whole))
            running = subprocess.Popen([*call, "-o", str(out)], stdout=subprocess.DEVNULL)
            time.sleep(moments[-1])
            running.send_signal(signal.SIGKILL)
            running.wait()
        left = len(list((out / "units").glob("*/unit.json"))) if out.exists() else 0
        subprocess.run([*call, "-o", str(out)], stdout=subprocess.DEVNULL, check=False)
        same = table(out) == table(folder / "whole") and not list(out.rglob("*.part"))
        equal += same
        print(
            f"killed after {', '.join(f'{m:.1f}' for m in moments)} s of {whole:.1f} s, {left} units kept: equal {same}"
        )
    print(f"{equal} of {times} equal to the run that nothing disturbed")


def study_dask(folder: Path) -> None:
    from distributed import LocalCluster

    make(folder / "units", 16, faulty=False)
    expected = run_batch(str(folder / "units"), folder / "here", options(folder), workers=2)
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        killed: list[int] = []

        def kill_once(words: str) -> None:
            if words.startswith("4 of") and not killed:
                killed.append(next(iter(cluster.workers.values())).pid)
                os.kill(killed[0], signal.SIGKILL)

        address = cluster.scheduler_address
        batch = run_batch(
            str(folder / "units"), folder / "there", options(folder), scheduler=address, progress=kill_once
        )
    same = table(folder / "here") == table(folder / "there")
    ended = "one worker was killed" if killed else "no worker was killed"
    print(
        f"Dask: {batch.accepted} of {len(batch.units)} accepted (here {expected.accepted}), {ended}; equal: {same}"
    )


def main() -> None:
    what = sys.argv[1] if len(sys.argv) > 1 else ""
    number = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    with tempfile.TemporaryDirectory(prefix="tumble-fleet-") as name:
        folder = Path(name)
        if what in ("", "faulty"):
            study_faulty(folder / "faulty", number or (200 if what else 40))
        if what == "speed":
            study_speed(folder / "speed", number or 100)
        if what in ("", "kill"):
            study_kill(folder / "kill", number or (20 if what else 3))
        if what in ("", "dask"):
            study_dask(folder / "dask")


if __name__ == "__main__":
    main()
