"""A production line, simulated: faulty units found, units a second, killed and run again, a cluster whose worker dies.

    python benchmarks/fleet.py faulty [UNITS]     # 200 units, six of them faulty in different ways
    python benchmarks/fleet.py speed [UNITS ...]  # units a second of a core, and memory: by default 100, 300 and 1000
    python benchmarks/fleet.py registry [COUNT]   # what each question costs among 100,000 calibrations
    python benchmarks/fleet.py prior              # what a fleet's prior saves: poses, and standard uncertainties
    python benchmarks/fleet.py kill [TIMES]       # kill -9 at random moments, resumed, compared
    python benchmarks/fleet.py dask               # a Dask cluster of two workers, one killed in the middle

Without an argument: faulty with 40 units, kill three times, and dask.
"""

from __future__ import annotations

import csv
import json
import os
import random
import resource
import shutil
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
from tumble.workflows.batches.batch import run_batch
from tumble.workflows.batches.unit import BatchOptions

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


def study_speed(folder: Path, counts: list[int]) -> None:
    """Units a second from processor time, which other work on the machine hardly changes; wall clock for comparison.

    Each unit has a recording of its own, of 0.3 MB.
    """
    make(folder / "units", max(counts), faulty=False)
    rates: list[float] = []
    for number in counts:
        manifest = folder / f"{number}.csv"
        lines = [f"v{k:05d},units/u{k:04d}.csv" for k in range(number)]
        manifest.write_text("unit,files\n" + "\n".join(lines) + "\n", encoding="utf-8")
        begun, before = time.perf_counter(), cpu()
        # In a process of its own: what the largest batch takes is not hidden by what came before.
        made = subprocess.run(
            [sys.executable, __file__, "batch", str(manifest), str(folder / f"out-{number}")],
            capture_output=True,
            text=True,
            check=True,
        )
        seconds, wall = cpu() - before, time.perf_counter() - begun
        rates.append(number / seconds)
        print(
            f"{number} units: {number / seconds:.2f} a second of a core, {number / wall:.2f}/s; {made.stdout.strip()}",
            flush=True,
        )
        shutil.rmtree(folder / f"out-{number}")
    spread = max(rates) / min(rates) - 1.0
    print(f"units a second of a core over sizes of {counts[0]} to {counts[-1]}: within {100 * spread:.0f} %")


def cpu() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def one_batch(manifest: str, out: str) -> None:
    """A batch, and the memory of the process that collects it and of the largest worker."""
    batch = run_batch(manifest, out, options(Path(out).parent))
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    worker = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    print(
        f"{own:.0f} MB at most here, {worker:.0f} MB in a worker; {batch.accepted} accepted, "
        f"{len(batch.stand_out)} stand out"
    )


def study_registry(folder: Path, count: int) -> None:
    """Ten calibrations a unit over four years, in SQLite; every question as a call of its own."""
    from tumble.document.result import Calibration
    from tumble.registry import open_registry, schema
    from tumble.registry.store import document_hash

    make(folder / "units", 1, faulty=False)
    run_batch(str(folder / "units"), folder / "out", options(folder), workers=1)
    text = (folder / "out/units/u0000/calibration.json").read_text(encoding="utf-8")
    document = Calibration.model_validate_json(text)
    told = json.loads(text)
    for triad in ("accelerometer", "gyroscope"):
        told[triad] |= {"bias": "@bias", "matrix": f"@{triad}"}
    told = json.dumps(told)
    values = np.array([[p.value, p.standard_uncertainty] for p in document.parameters]).T
    name, rng = str(folder / "units.sqlite"), np.random.default_rng(1)
    registry = open_registry(name, make=True)
    names = json.dumps([[p.name, p.unit] for p in document.parameters])
    with registry.writing() as connection:
        connection.execute(schema.layouts.insert().values(id=1, sha256=document_hash(names), names=names))
        units = max(count // 10, 1)
        connection.execute(
            schema.units.insert(), [{"id": k + 1, "name": f"U{k:05d}", "model": None} for k in range(units)]
        )
        for first in range(0, count, 5000):
            rows: list[dict[str, object]] = []
            documents: list[dict[str, object]] = []
            for k in range(first, min(first + 5000, count)):
                own = values.copy()
                own[0] += own[1] * rng.normal(size=own.shape[1]) * (1.0 + k % 7)
                moment = 1.6e9 + 1.2e7 * (k // units) + 1e4 * rng.uniform()
                made, off = told, 0.01 * rng.normal(size=(2, 3, 3))
                for word, drawn in (
                    ("bias", 0.1 * rng.normal(size=3)),
                    ("accelerometer", np.eye(3) + np.tril(off[0])),
                    ("gyroscope", np.eye(3) + off[1]),
                ):
                    made = made.replace(f'"@{word}"', json.dumps(drawn.tolist()))
                documents.append({"calibration_id": k + 1, "document": made})
                rows.append(
                    {
                        "unit_id": k % units + 1, "layout_id": 1, "sha256": document_hash(f"{k}"),
                        "identity": f"{k:012x}", "created": moment, "added": moment, "added_by": "", "operator": "",
                        "remark": "", "procedure": "hand-held", "fit": True, "limits": "", "temperature": None,
                        "numbers": own.astype("<f8").tobytes(), "id": k + 1,
                    }
                )  # fmt: skip
            connection.execute(schema.calibrations.insert(), rows)
            connection.execute(schema.documents.insert(), documents)
    registry.close()
    (folder / "tolerances.yaml").write_text("limits: {gyro bias: 1 deg/s, accelerometer bias: 30 mg}\n")
    size = Path(name).stat().st_size / 1e6
    print(f"{count} calibrations of {units} units, {size:.0f} MB; processor time of a call, start-up and all")
    tolerances, unit = str(folder / "tolerances.yaml"), "U00007"
    for call in (
        ["list"], ["show", unit], ["history", unit], ["due", tolerances, "--json"], ["chart", unit], ["fleet"],
        ["add", str(folder / "out/units/u0000/calibration.json")],
    ):  # fmt: skip
        before = cpu()
        subprocess.run(
            [sys.executable, "-c", RUN, "registry", *call, "--registry", name],
            stdout=subprocess.DEVNULL,
            check=False,
        )
        print(f"  {call[0]:8} {cpu() - before:.2f} s")


def study_prior(folder: Path) -> None:
    """Six, nine and twelve poses of new units, with nothing known, with the sheet's spreads, and with the fleet's."""
    from tumble.calibration import calibrate_multi_position
    from tumble.errors import ObservabilityError
    from tumble.recording import read_recordings
    from tumble.registry import open_registry
    from tumble.segmentation import find_timeline, observe_holds
    from tumble.sensor import change_frame
    from tumble.workflows.given.data_sheet import find_sheet
    from tumble.workflows.registry import fleet

    make(folder / "units", 40, faulty=False)
    name = str(folder / "units.sqlite")
    open_registry(name, make=True).close()
    run_batch(str(folder / "units"), folder / "out", options(folder), registry=name)
    fleet(name, folder / "fleet.json")
    sheets = {
        "nothing": None,
        "data sheet": find_sheet("consumer-mems"),
        "fleet of 40": find_sheet(folder / "fleet.json"),
    }
    site, runs = Site.from_gravity(GRAVITY), 25
    for poses in (6, 9, 12):
        recordings = [(unit, few_poses(folder, unit, poses)) for unit in range(1000, 1000 + runs)]
        for known, sheet in sheets.items():
            sigmas, squares = [], []
            for unit, path in recordings:
                (recording,) = read_recordings([path])
                try:
                    estimate = calibrate_multi_position(
                        recording, observe_holds(recording, find_timeline(recording)), site, data_sheet=sheet
                    )
                except ObservabilityError:
                    continue
                drawn = find_grade("consumer-mems").simulate_model(np.random.default_rng([3, unit]))
                true = change_frame(drawn, "accelerometer-x")
                assert estimate.model.accelerometer is not None
                assert true.accelerometer is not None
                rows, columns = np.tril_indices(3)
                off = np.concatenate(
                    [
                        (estimate.model.accelerometer.matrix - true.accelerometer.matrix)[rows, columns],
                        estimate.model.accelerometer.bias - true.accelerometer.bias,
                    ]
                )
                at = [*(3 * rows + columns), 9, 10, 11]
                covariance = estimate.covariance[np.ix_(at, at)]
                sigmas.append(np.sqrt(np.diag(covariance)))
                squares.append(off @ np.linalg.solve(covariance, off) / 9.0)
            if not sigmas:
                print(f"{poses:3} poses, {known:12}: refused, too few")
                continue
            middle = np.median(sigmas, axis=0)
            print(
                f"{poses:3} poses, {known:12}: scale {1e2 * middle[[0, 2, 5]].mean():.3f} %, angle "
                f"{1e3 * middle[[1, 3, 4]].mean():.2f} mrad, bias {1e3 * middle[6:].mean():.1f} mm/s²; mean squared "
                f"error over its variance {np.mean(squares):.2f}"
            )


def few_poses(folder: Path, unit: int, poses: int) -> Path:
    """A recording of a unit in its first so many poses of the 26, at rest in each."""
    rng, grade = np.random.default_rng([9, unit]), find_grade("consumer-mems")
    model = grade.simulate_model(np.random.default_rng([3, unit]))
    motion = Motion.between_poses(poses_26()[:poses], np.full(poses, 4.0), np.full(poses - 1, 1.5))
    recording, _ = simulate_recording(
        motion, RATE, rng, site=Site.from_gravity(GRAVITY), grade=grade, distort=model.distort
    )
    path = folder / f"{unit}-{poses}.csv"
    write(path, np.column_stack([recording.time, recording.specific_force, recording.angular_rate]))
    return path


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
    if what == "batch":
        one_batch(*sys.argv[2:])
        return
    number = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    with tempfile.TemporaryDirectory(prefix="tumble-fleet-") as name:
        folder = Path(name)
        if what in ("", "faulty"):
            study_faulty(folder / "faulty", number or (200 if what else 40))
        if what == "speed":
            study_speed(folder / "speed", [int(one) for one in sys.argv[2:]] or [100, 300, 1000])
        if what == "registry":
            study_registry(folder / "registry", number or 100_000)
        if what == "prior":
            study_prior(folder / "prior")
        if what in ("", "kill"):
            study_kill(folder / "kill", number or (20 if what else 3))
        if what in ("", "dask"):
            study_dask(folder / "dask")


if __name__ == "__main__":
    main()
