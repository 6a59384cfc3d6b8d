"""The offset between the clocks of IMU and positions: found in simulated drives, beside the uncertainty that is stated.

    python benchmarks/drive_clocks.py --seeds 7

Each drive is made by an uncalibrated unit at 50 Hz, and its antenna is a metre away in a direction of which nothing is
told. Six offsets and two kinds of positions (2 cm, and 1 m) at 1 to 10 Hz of each seed.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from tumble.errors import RecordingError
from tumble.navigation import GnssTrack, InertialSamples, Trajectory, prepare_drive
from tumble.navigation.gnss import make_track
from tumble.simulation import simulate_drive

OFFSETS = (-0.3, 0.0, 0.11, 0.5, 3.0, 18.0)
RATES = (1.0, 2.0, 4.0, 5.0, 10.0)


def drive_of(
    rng: np.random.Generator, spread: float, rate: float, duration: float
) -> tuple[InertialSamples, GnssTrack]:
    """A unit with errors of a consumer grade, and positions with receiver velocities on the same clock."""
    drive = simulate_drive(rng, duration + 1.0)
    time = np.arange(int(duration * 50.0)) / 50.0
    states = drive.states(time)
    matrices = [np.eye(3) + rng.normal(0.0, 0.01, (3, 3)) for _ in range(2)]
    force = (
        states.specific_force_b @ matrices[0].T
        + rng.normal(0.0, 0.1, 3)
        + rng.normal(0.0, 0.02, (len(time), 3))
    )
    turn = (
        states.angular_rate_ib_b @ matrices[1].T
        + rng.normal(0.0, 0.05, 3)
        + rng.normal(0.0, 1e-3, (len(time), 3))
    )
    at = np.arange(0.5, duration - 0.5, 1.0 / rate)
    fixes = drive.states(at)
    arm = rng.standard_normal(3)
    path = Trajectory(
        at, fixes.latitude, fixes.longitude, fixes.height, fixes.velocity_n, fixes.quaternion_nb
    )
    latitude, longitude, height = path.points(arm / np.linalg.norm(arm))
    noise = rng.normal(0.0, spread, (3, len(at)))
    track = make_track(
        at,
        (latitude + noise[0] / 6.4e6, longitude + noise[1] / (6.4e6 * np.cos(latitude)), height - noise[2]),
        np.full((len(at), 3), spread),
        velocity_n=fixes.velocity_n + rng.normal(0.0, 0.03 if spread < 0.1 else 0.1, (len(at), 3)),
        velocity_sigmas=np.full((len(at), 3), 0.03 if spread < 0.1 else 0.1),
        quality=np.ones(len(at), dtype=int),
    )
    return InertialSamples(time, force, turn), track


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=7)
    parser.add_argument("--duration", type=float, default=160.0, help="s")
    asked = parser.parse_args()
    for spread in (0.02, 1.0):
        errors: list[float] = []
        sigmas: list[float] = []
        refused = 0
        for seed in range(asked.seeds):
            for at, offset in enumerate(OFFSETS):
                rng = np.random.default_rng((seed, at))
                rate = RATES[(seed + at) % len(RATES)]
                samples, track = drive_of(rng, spread, rate, asked.duration)
                try:
                    found = prepare_drive(samples, track.shifted(-offset)).clock
                except RecordingError as error:
                    refused += 1
                    print(f"    seed {seed}, {offset:g} s, {rate:g} Hz: {error}")
                    continue
                errors.append(found.offset - offset)
                sigmas.append(found.sigma)
        normal = np.abs(np.array(errors) / np.array(sigmas))
        print(
            f"positions of {spread:g} m: {len(errors)} offsets found, {refused} refused; error {np.std(errors):.3f} s, "
            f"stated {np.median(sigmas):.3f} s (median); over the stated uncertainty {np.sqrt(np.mean(normal**2)):.2f} "
            f"rms, {normal.max():.2f} at most, {np.count_nonzero(normal > 2.0)} above 2"
        )


if __name__ == "__main__":
    main()
