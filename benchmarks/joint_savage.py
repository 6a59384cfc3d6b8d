"""How much nearer the joint estimate comes than Savage's own inversion of his test, on the same simulated recordings.

    python benchmarks/joint_savage.py --grade nav tactical MEMS --runs 100

The units, fixtures, sites and headings are those of `tumble reproduce savage-accuracy`. The recording has a gap between
one of the seventeen sequences and the next. It is calibrated as a user does, by the joint estimate and by the procedure
strapdown-rotation, and inverted by his (13) with start bias and norm, his best. Printed are the rms of each group of
errors, in ppm, µrad and µg, and the ratios with the 95 % intervals of a bootstrap over runs.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import copy
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
from scipy.spatial.transform import Rotation

import tumble
from tumble.protocol import named_protocol, write_protocol
from tumble.protocol.steps import HoldStep
from tumble.protocol.strapdown_rotation import strapdown_rotation_steps
from tumble.sensor import ImuModel
from tumble.sensor.conventions.savage import GROUPS, SavageErrors, savage_from_model
from tumble.sensor.triad import Triad
from tumble_papers.savage.strapdown_simulation import (
    GRADES,
    LARGEST_LATITUDE,
    START_NORM,
    UNITS_SI,
    Recordings,
    Setting,
    draw_truth,
    run_study,
    simulate_run,
)

WAYS = ("joint", "strapdown-rotation")
GAP = 8.0  # s
# Level, mounting, crossing of the axes and two stops, each off by the setting's 1 mrad.
POSE = 2e-3  # rad


def recording(made: Recordings, rng: np.random.Generator) -> pl.DataFrame:
    """Return the run as a file has it; while it turns, which the paper's simulation leaves out, it shows gravity."""
    truth = made.truth.model()
    force, rate = truth.accelerometer, truth.gyroscope
    step, rest = 1.0 / made.setting.sampling, made.setting.window
    raw, time, now = made.force.copy(), [], 0.0
    turned = (made.rate - rate.bias) @ np.linalg.inv(rate.matrix).T * step
    for start, stop in zip(made.starts[:-1], made.starts[1:], strict=True):
        part = slice(start + rest, stop - rest)
        ahead = np.linalg.solve(force.matrix, raw[start : start + rest].mean(axis=0) - force.bias)
        seen = []
        for C in Rotation.from_rotvec(turned[part]).as_matrix():
            before, ahead = ahead, C.T @ ahead
            seen.append((before + ahead) / 2)
        noise = made.setting.grade.velocity_random_walk / np.sqrt(step) * rng.standard_normal((len(seen), 3))
        raw[part] = np.array(seen) @ force.matrix.T + force.bias + noise
        time.append(now + np.arange(stop - start) * step)
        now = time[-1][-1] + GAP
    columns = {
        f"{kind}{axis}": rows[:, i]
        for kind, rows in (("a", raw), ("g", made.rate))
        for i, axis in enumerate("xyz")
    }
    return pl.DataFrame({"time": np.round(np.concatenate(time), 6), **columns})


def calibrated(
    made: Recordings, latitude: float, azimuth: float, rng: np.random.Generator
) -> list[np.ndarray]:
    """Return the errors (24,) of each way; none where one is refused."""
    site = replace(tumble.Site.from_latitude(latitude), gravity_sigma=0.0)
    steps = [
        replace(s, pose=replace(s.pose, sigma=POSE))
        if isinstance(s, HoldStep)
        else s if s.axis_b is None else replace(s, sigma=POSE)
        for s in strapdown_rotation_steps(azimuth + np.pi / 2)
    ]  # fmt: skip
    frame, found = recording(made, rng), []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "protocol.yaml"
        write_protocol(replace(named_protocol("strapdown-rotation"), steps=tuple(steps), site=site), file)
        for way in WAYS:
            run = tumble.calibrate(
                frame, protocol=file, procedure=way, rate=f"{made.setting.sampling}±0.0001"
            )
            found.append(savage_from_model(model(run.calibration.model_dump()))[0].vector - made.truth.vector)
    return found


def model(document: dict) -> ImuModel:
    """Return the model of a document."""
    triads = []
    for name in ("accelerometer", "gyroscope"):
        terms = [document[name].get(key) for key in ("matrix", "bias", "asymmetry")]
        triads.append(Triad(*[None if term is None else np.array(term, float) for term in terms]))
    return ImuModel(*triads)


def study(grade: str, runs: int, seed: int) -> None:
    """Print one grade's rows."""
    setting = Setting(GRADES[grade])
    # Both draw the same runs.
    first, again = (np.random.Generator(np.random.SFC64([seed, 97])) for _ in range(2))
    own = run_study(setting, [START_NORM], runs, first, iterations=2, threads=1)[0, :, -1]
    errors, failed = [], []
    for k, stream in enumerate(again.spawn(runs)):
        place = copy.deepcopy(stream)
        truth: SavageErrors = draw_truth(setting, place)
        latitude, azimuth = place.uniform(-LARGEST_LATITUDE, LARGEST_LATITUDE), place.uniform(-np.pi, np.pi)
        made = simulate_run(setting, stream)
        assert np.array_equal(made.truth.vector, truth.vector)
        try:
            errors.append(np.stack([own[k], *calibrated(made, latitude, azimuth, stream)]))
        except tumble.TumbleError as error:
            failed.append(f"  run {k}: {error}")
    every, rng = np.array(errors), np.random.default_rng(0)
    print(f"{grade}: {len(every)} of {runs} runs", *failed, sep="\n")
    print(f"  {'':12}{'(13)':>8}{'joint':>8}   joint / (13)        procedure / (13)")
    for name, at in GROUPS.items():

        def rms(which: np.ndarray, at=at) -> np.ndarray:
            return np.sqrt((every[which][..., at] ** 2).mean(axis=(0, 2)))

        size = rms(np.arange(len(every)))
        drawn = np.array([rms(rng.integers(0, len(every), len(every))) for _ in range(400)])
        low, high = np.quantile(drawn[:, 1:] / drawn[:, :1], [0.025, 0.975], axis=0)
        shown = [f"{size[w] / size[0]:.2f} ({low[w - 1]:.2f} to {high[w - 1]:.2f})" for w in (1, 2)]
        unit = UNITS_SI[at][0]
        print(f"  {name:12}{size[0] / unit:8.3g}{size[1] / unit:8.3g}   {'  '.join(shown)}", flush=True)


def main() -> None:
    """Read the command line and run the studies."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--grade", nargs="+", choices=list(GRADES), default=["tactical"])
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    for grade in asked.grade:
        study(grade, asked.runs, asked.seed)


if __name__ == "__main__":
    main()
