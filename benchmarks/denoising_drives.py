"""What de-noising does to navigation: free drift and outages of simulated drives, as recorded and de-noised.

    python benchmarks/denoising_drives.py --drives 20

Each drive is 180 s through a town with the noise of a consumer unit, biases left of 1 mg and 20 °/h, positions of
2 cm at 1 Hz. The filter is the same for all: its white noise is that of the recording.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from tumble.earth import curvature_radii
from tumble.errors import TumbleError
from tumble.navigation import (
    Alignment,
    AxisAgreement,
    Drive,
    InertialSamples,
    TimeAlignment,
    Trajectory,
    TriadSpread,
    outages,
    plan_filter,
)
from tumble.navigation.free_drift import free_drift
from tumble.navigation.gnss import make_track
from tumble.noise.denoising.shrinkage import Shrinkage
from tumble.noise.terms import NoiseModel
from tumble.recording import Recording
from tumble.simulation import find_grade, simulate_drive
from tumble.workflows.denoise import denoise_recording

RATE = 100.0
WAYS = {
    "as recorded": None,
    "wavelets, at rest": {},
    "wavelets, motion too": {"filter_motion": True},
    "autoregression, at rest": {"method": "ar"},
    "low-pass, 5 levels, all": {"filter_motion": True, "level": 5, "shrinkage": Shrinkage("remove")},
}
BIAS = 1e-3 * 9.80665, np.radians(20.0 / 3600.0)
FREE = (10.0, 60.0)
OUT = (2.0, 10.0, 30.0)


def one_drive(seed: int, duration: float = 180.0) -> dict[str, list[float]]:
    """Mean squared horizontal errors (m²) by way: free drift, then outages."""
    rng = np.random.default_rng(seed)
    grade = find_grade("consumer-mems")
    white = grade.accelerometer.noise.random_walk, grade.gyroscope.noise.random_walk
    at = np.arange(int(duration * RATE) + 1) / RATE
    states = simulate_drive(rng, duration + 1.0, rest=20.0).states(at)
    truth = Trajectory(
        at, states.latitude, states.longitude, states.height, states.velocity_n, states.quaternion_nb
    )
    force, rate = (
        signal + rng.normal(0.0, bias, 3) + level * np.sqrt(RATE) * rng.standard_normal((len(at), 3))
        for signal, bias, level in zip(
            (states.specific_force_b, states.angular_rate_ib_b), BIAS, white, strict=True
        )
    )
    rows = np.arange(int(RATE), len(at), int(RATE))
    fixes = truth.rows(rows)
    noise = rng.normal(0.0, 0.02, (len(rows), 3))
    meridian, across = curvature_radii(fixes.latitude)
    track = make_track(
        fixes.time,
        (
            fixes.latitude + noise[:, 0] / meridian,
            fixes.longitude + noise[:, 1] / across / np.cos(fixes.latitude),
            fixes.height - noise[:, 2],
        ),
        np.full((len(rows), 3), 0.02),
    )
    setup = plan_filter(
        NoiseModel(random_walk=white[0], rate_random_walk=1e-5),
        NoiseModel(random_walk=white[1], rate_random_walk=1e-6),
        accelerometer=TriadSpread(bias=BIAS[0]),
        gyroscope=TriadSpread(bias=float(BIAS[1])),
    )
    recording = Recording(at, force, rate, "m/s^2", "rad/s", RATE)
    found: dict[str, list[float]] = {}
    for way, options in WAYS.items():
        mine = recording if options is None else denoise_recording(recording, **options).recording
        assert mine.specific_force is not None
        assert mine.angular_rate is not None
        samples = InertialSamples(at, mine.specific_force, mine.angular_rate)
        drift = free_drift(samples, truth.rows(np.arange(0, len(at), 100)), FREE, every=5.0)
        squares = [float(np.nanmean(drift.horizontal_squares(i))) for i in range(len(FREE))]
        start = truth.state(100)
        alignment = Alignment(start.C_nb, np.diag([2e-3, 2e-3, 5e-3]) ** 2, "the truth")
        clock = TimeAlignment(0.0, 0.0, 1.0, 0.0, 0.0)
        drive = Drive(
            samples, track, start, alignment, clock, AxisAgreement(np.zeros(3), 1.0, start.C_nb[2], "")
        )
        cut = outages(drive, setup, OUT, settle=60.0)
        found[way] = squares + [float(np.mean(one.horizontal**2)) for one in cut]
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=20)
    asked = parser.parse_args()
    rows: list[dict[str, list[float]]] = []
    for seed in range(asked.drives):
        try:
            rows.append(one_drive(300 + seed))
        except TumbleError as error:
            print(f"drive {seed}: {error}")
    columns = [f"free, {t:g} s" for t in FREE] + [f"outage, {t:g} s" for t in OUT]
    print(
        f"{len(rows)} drives; horizontal rms, m, and its ratio to that as recorded, ± by a bootstrap over drives"
    )
    rng = np.random.default_rng(1)
    draws = rng.integers(0, len(rows), (1000, len(rows)))
    plain = np.array([row["as recorded"] for row in rows])
    for way in WAYS:
        squares = np.array([row[way] for row in rows])
        ratio = np.sqrt(squares[draws].mean(axis=1) / plain[draws].mean(axis=1))
        rms = np.sqrt(squares.mean(axis=0))
        words = [
            f"{name} {value:.3g} ({np.sqrt(a / b):.2f} ± {spread:.2f})"
            for name, value, a, b, spread in zip(
                columns, rms, squares.mean(axis=0), plain.mean(axis=0), ratio.std(axis=0), strict=True
            )
        ]
        print(f"  {way:<26}" + ", ".join(words))


if __name__ == "__main__":
    main()
