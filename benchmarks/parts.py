"""Do parts of one real recording, or recordings of one unit, agree within what is stated?

    python benchmarks/parts.py imu0.log imu1.log --columns ax,ay,az,gx,gy,gz --units "m/s^2,rad/s" --rate 100±0.01
    python benchmarks/parts.py xsens_acc.txt.gz+xsens_gyro.txt.gz
    python benchmarks/parts.py good1.txt good2.txt --whole --columns t,ax,ay,az,gx,gy,gz

The halves of each file (`--share 0.55` overlaps, where half of the poses are not enough: √(1 − 0.1/0.55) = 0.90 is then
right), or with `--whole` all files as of one unit, are calibrated as a user does. Files joined by + are one recording.
Printed are, for each pair, the root mean square and the largest of the parameters' differences over their standard
uncertainties, by group and in all; 1 is right. Optional terms that one alone keeps do not count.
"""

from __future__ import annotations

import argparse
import itertools
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import tumble

GROUPS = ("accelerometer bias", "accelerometer scale", "accelerometer non-orth", "gyro bias", "gyro scale",
          "gyro non-orth", "rotation between", "g-sensitivity")  # fmt: skip


def compared(name: str, one: tumble.Calibration, other: tumble.Calibration) -> list[float]:
    """Print how two calibrations differ, and return the differences over their standard uncertainties."""
    theirs = {p.name: p for p in other.parameters}
    z: dict[str, float] = {}
    for p in one.parameters:
        q = theirs.get(p.name)
        if q is not None and p.standard_uncertainty > 0:
            z[p.name] = (p.value - q.value) / float(np.hypot(p.standard_uncertainty, q.standard_uncertainty))
    shown = []
    for group in GROUPS:
        own = [v for n, v in z.items() if n.startswith(group)]
        if own:
            shown.append(f"{group} {np.sqrt(np.mean(np.square(own))):.2f}")
    every = np.array(list(z.values()))
    fit = ", ".join("fit" if made.verdict.fit else "not fit" for made in (one, other))
    print(
        f"{name} ({one.procedure}, {other.procedure}; {fit}): rms {np.sqrt(np.mean(every**2)):.2f}, ", end=""
    )
    print(f"largest {np.abs(every).max():.1f}, {len(every)} numbers; {'; '.join(shown)}", flush=True)
    return list(every)


def main() -> None:
    """Print the comparisons."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("files", nargs="+")
    parser.add_argument(
        "--whole", action="store_true", help="the files with one another, instead of parts of each"
    )
    parser.add_argument("--share", type=float, default=0.5)
    parser.add_argument("--columns")
    parser.add_argument("--units")
    parser.add_argument("--rate")
    parser.add_argument("--gravity", type=float)
    parser.add_argument("--procedure")
    parser.add_argument("--unknowns", type=int)
    asked = parser.parse_args()
    site = None if asked.gravity is None else tumble.Site.from_gravity(asked.gravity)
    every: list[float] = []

    def made(recording: tumble.Recording) -> tumble.Calibration:
        options = {"site": site, "procedure": asked.procedure, "unknowns": asked.unknowns}
        return tumble.calibrate(recording, **options).calibration

    given = {"columns": asked.columns, "units": asked.units, "rate": asked.rate}
    read = {files: tumble.read_recording(files.split("+"), **given) for files in asked.files}
    if asked.whole:
        whole = {file: made(recording) for file, recording in read.items()}
        for one, other in itertools.combinations(whole, 2):
            every += compared(f"{one} and {other}", whole[one], whole[other])
    else:
        for file, recording in read.items():
            size = round(asked.share * len(recording))
            ends = recording.between(0, size), recording.between(len(recording) - size, len(recording))
            try:
                every += compared(file, *(made(end) for end in ends))
            except tumble.TumbleError as error:
                print(f"{file}: {error}")
    if every:
        print(f"all: rms {np.sqrt(np.mean(np.square(every))):.2f} of {len(every)} numbers")


if __name__ == "__main__":
    main()
