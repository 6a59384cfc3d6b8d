"""What `tumble verify --gnss` says of drives too short to tell much: parts of a real drive, and simulated ones.

    python benchmarks/drive_calibration.py FOLDER OUT
    python benchmarks/short_drives.py FOLDER OUT/calibration.json
    python benchmarks/short_drives.py --simulated 20 OUT/calibration.json

FOLDER holds the car drive of rtklibexplorer/GNSS_IMU: imu_1934.csv and gnss_1934_sf.pos. Nothing is wrong with any
part: what is said of units, axes, signs or files is a false alarm. `--offset` gives the clocks' offset.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tumble.document.result import read_calibration
from tumble.errors import TumbleError
from tumble.simulation import simulate_drive
from tumble.workflows.verification.drive import verify_drive

DIAGNOSES = (
    "swapped",
    "reversed",
    "mirror image",
    "is another",
    "against the course",
    "belong together",
    "motion",
)
HONEST = (
    "too short",
    "no rest",
    "too little",
    "does not move after",
    "a course takes speed",
    "changes by less than",
)


def real_parts(folder: Path, length: float, every: float, out: Path) -> Iterator[tuple[str, Path, Path]]:
    """Cut the drive into parts, each with both files on their own clocks."""
    lines = [line.split(",") for line in (folder / "imu_1934.csv").read_text().splitlines()]
    lines = [row for row in lines if len(row) == 7 and row[6]]
    stamps = np.array([float(row[6]) for row in lines]) * 1e-3
    text = (folder / "gnss_1934_sf.pos").read_text().splitlines()
    header = [line for line in text if line.startswith("%")]
    fixes = [" ".join(line.split()) for line in text if line and not line.startswith("%")]
    # 4 Hz without a gap, beginning with the samples
    times = stamps[0] + 0.25 * np.arange(len(fixes))
    for begin in np.arange(stamps[0], stamps[-1] - length, every):
        imu, track = out / "imu.csv", out / "track.pos"
        chosen = [",".join(lines[i]) for i in np.flatnonzero((stamps >= begin) & (stamps <= begin + length))]
        imu.write_text("ax,ay,az,gx,gy,gz,t\n" + "\n".join(chosen) + "\n")
        kept = [fixes[i] for i in np.flatnonzero((times >= begin) & (times <= begin + length))]
        track.write_text("\n".join([*header, *kept]) + "\n")
        yield f"from {begin - stamps[0]:.0f} s", imu, track


def simulated(count: int, length: float, calibration: Path, out: Path) -> Iterator[tuple[str, Path, Path]]:
    """Simulate drives through a town with that unit; they begin with a rest, and clocks are apart by 0.2 s."""
    model = read_calibration(calibration).model
    for seed in range(count):
        rng = np.random.default_rng(7000 + seed)
        drive = simulate_drive(rng, length + 1.0)
        at = np.arange(int(length * 100.0)) / 100.0
        states = drive.states(at)
        raw = model.distort(states.specific_force_b, states.angular_rate_ib_b)
        noise = rng.standard_normal((2, len(at), 3)) * np.array([0.003, 0.05])[:, None, None]
        rows = np.column_stack([raw[0] + noise[0], raw[1] + noise[1], 1e3 * at])
        imu, track = out / "imu.csv", out / "track.csv"
        np.savetxt(imu, rows, delimiter=",", header="ax,ay,az,gx,gy,gz,t", comments="", fmt="%.5f")
        seen = np.arange(0.25, length - 0.25, 0.25)
        fixes = drive.states(seen)
        place = rng.normal(0.0, 0.01, (3, len(seen)))
        columns = [
            seen + 0.2,
            np.degrees(fixes.latitude + place[0] / 6.4e6),
            np.degrees(fixes.longitude + place[1] / (6.4e6 * np.cos(fixes.latitude))),
            fixes.height + place[2],
        ]
        names = "time_s,latitude_deg,longitude_deg,height_m"
        np.savetxt(track, np.column_stack(columns), delimiter=",", header=names, comments="", fmt="%.10f")
        yield f"seed {7000 + seed}", imu, track


def spoil(imu: Path, fault: str) -> None:
    """Swap or reverse gyros in a file of columns ax,ay,az,gx,gy,gz,t."""
    header, *lines = imu.read_text().splitlines()
    rows = [line.split(",") for line in lines]
    for row in rows:
        row[3:6] = (
            [row[5], row[4], row[3]] if fault == "swap" else [f"{-float(value):.5f}" for value in row[3:6]]
        )
    imu.write_text("\n".join([header, *(",".join(row) for row in rows)]) + "\n")


def said(calibration: Path, imu: Path, track: Path, offset: float | None) -> tuple[str, str]:
    """Return what kind of an answer the command gave, and its words."""
    try:
        found = verify_drive(
            calibration, imu, track, units="g,deg/s,ms", offset=offset, lever_arm_b=(0.0, -0.05, 0.0)
        )
    except TumbleError as error:
        words = " ".join(str(error).split())
        if any(word in words for word in HONEST):
            return "too little to tell", words
        return ("FALSE ALARM" if any(word in words for word in DIAGNOSES) else "other refusal"), words
    words = " ".join([*found.reasons, *found.remarks])
    return ("FALSE ALARM" if found.no_proof else "serves" if found.fit else "does not serve"), words


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("calibration", type=Path)
    parser.add_argument("--simulated", type=int, default=0, metavar="N")
    parser.add_argument("--lengths", default="30,45,60,90,120")
    parser.add_argument("--every", type=float, default=20.0)
    parser.add_argument("--offset", type=float)
    parser.add_argument("--fault", choices=["swap", "reverse"], help="gyros x and z swapped, or all reversed")
    parser.add_argument("--verbose", action="store_true")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        for length in (float(text) for text in asked.lengths.split(",")):
            counted: Counter[str] = Counter()
            if asked.simulated:
                parts = simulated(asked.simulated, length, asked.calibration, Path(name))
            else:
                parts = real_parts(asked.folder, length, asked.every, Path(name))
            for part, imu, track in parts:
                if asked.fault:
                    spoil(imu, asked.fault)
                kind, words = said(asked.calibration, imu, track, asked.offset)
                if asked.fault and kind == "FALSE ALARM":
                    word = {"swap": "are swapped", "reverse": "turn against the course"}[asked.fault]
                    kind = "named" if word in words else "refused for another reason"
                counted[kind] += 1
                if asked.verbose or kind in ("FALSE ALARM", "other refusal", "does not serve"):
                    print(f"    {part}: {kind}: {words[:400]}")
            total = sum(counted.values())
            print(
                f"{length:g} s, {total} parts: {', '.join(f'{n} {kind}' for kind, n in counted.most_common())}"
            )


if __name__ == "__main__":
    main()
