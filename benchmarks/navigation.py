"""Navigation: speed beside python-ins in one run, consistency over simulated drives, and a real drive.

    python benchmarks/navigation.py --speed [--processor]
    python benchmarks/navigation.py --drives 200
    python benchmarks/navigation.py --real FOLDER [--peer]

`--speed` and `--peer` compare with python-ins (the module `pyins`, with pandas), where it can be imported; tumble
does not need it. `--processor` counts the processor's time in place of the clock's, for both, where others use the
machine. FOLDER holds the car drive of rtklibexplorer/GNSS_IMU: imu_1934.csv and gnss_1934_sf.pos.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from tumble.earth import curvature_radii
from tumble.navigation import (
    Drive,
    FilterSetup,
    InertialSamples,
    NavigationState,
    Trajectory,
    TriadSpread,
    apply_errors,
    make_track,
    navigate,
    outages,
    plan_filter,
    position_differences,
    prepare_drive,
    read_track,
    rms_of,
    run_filter,
    smooth,
    unpacked,
)
from tumble.noise import NoiseModel
from tumble.simulation import simulate_drive

LEVER = np.array([0.5, -0.3, -1.0])
CAR = plan_filter(
    NoiseModel(random_walk=0.02, rate_random_walk=1e-3),
    (
        NoiseModel(random_walk=0.002, rate_random_walk=1e-5),
        NoiseModel(random_walk=0.005, rate_random_walk=1e-5),
        NoiseModel(random_walk=0.001, rate_random_walk=1e-5),
    ),
    accelerometer=TriadSpread(bias=0.2, scale_factor=0.01, non_orthogonality=0.01),
    gyroscope=TriadSpread(bias=0.01, scale_factor=0.01, misalignment=0.01),
)


clock: Callable[[], float] = time.perf_counter


def best(function: Callable[[], object], repeats: int = 5) -> float:
    """Return the least of several timings, s: what the machine can do when nobody else is on it."""
    seconds = []
    for _ in range(repeats):
        started = clock()
        function()
        seconds.append(clock() - started)
    return min(seconds)


def wobbling_samples(samples: int, rate: float = 100.0) -> tuple[InertialSamples, NavigationState]:
    rng = np.random.default_rng(1)
    start = NavigationState.from_angles(
        0.0, (0.7, 0.1, 100.0), np.array([10.0, 5.0, 0.0]), np.array([0.1, 0.2, 0.3])
    )
    force = 0.5 * rng.standard_normal((samples, 3)) - 9.8 * start.C_nb[2]
    return InertialSamples(np.arange(samples) / rate, force, 0.1 * rng.standard_normal((samples, 3))), start


def frames_of_peer(samples: InertialSamples, start: NavigationState):
    """The same samples and start as python-ins has them."""
    import pandas as pd
    from pyins import strapdown, transform

    columns = ["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    table = np.hstack([samples.angular_rate_ib_b, samples.specific_force_b])
    imu = pd.DataFrame(table, index=pd.Index(samples.time, name="time"), columns=columns)
    increments = strapdown.compute_increments_from_imu(imu, "rate")
    position = [np.degrees(start.latitude), np.degrees(start.longitude), start.height]
    values = [*position, *start.velocity_n, *transform.mat_to_rph(start.C_nb)]
    names = ["lat", "lon", "alt", "VN", "VE", "VD", "roll", "pitch", "heading"]
    return imu, increments, pd.Series(values, index=names, name=start.time)


def speed() -> None:
    samples, start = wobbling_samples(500_000)
    navigate(samples, start)
    rate = len(samples) / best(lambda: navigate(samples, start))
    print(f"mechanisation: {rate / 1e6:.2f} million samples a second, every one kept")
    setup = plan_filter(
        NoiseModel(random_walk=1e-3, rate_random_walk=1e-5),
        NoiseModel(random_walk=1e-4, rate_random_walk=1e-6),
        accelerometer=TriadSpread(0.02, 1e-3, 1e-3),
        gyroscope=TriadSpread(2e-3, 1e-3, 1e-3),
    )
    drive = simulate_drive(np.random.default_rng(2), 301.0)
    at = np.arange(30_001) / 100.0
    states = drive.states(at)
    measured = InertialSamples(at, states.specific_force_b, states.angular_rate_ib_b)
    first = unpacked(
        at[:1],
        np.hstack(
            [
                [states.latitude[0], states.longitude[0], states.height[0]],
                states.velocity_n[0],
                states.quaternion_nb[0],
            ]
        )[None],
    ).state(0)
    rows = np.arange(100, 30_001, 100)
    track = make_track(
        at[rows],
        (states.latitude[rows], states.longitude[rows], states.height[rows]),
        np.full((300, 3), 0.02),
    )
    run_filter(measured, track, first, setup)
    filtered = len(measured) / best(lambda: run_filter(measured, track, first, setup))
    print(f"filter, {9 + len(setup.states)} states, 1 Hz: {filtered / 1e6:.2f} million samples a second")
    try:
        from pyins import filters, inertial_sensor, measurements, strapdown
    except ImportError:
        print("python-ins cannot be imported: no comparison")
        return
    imu, increments, pva = frames_of_peer(samples, start)
    strapdown.Integrator(pva).integrate(increments.iloc[:100])
    peer = len(samples) / best(lambda: strapdown.Integrator(pva).integrate(increments), 3)
    whole = len(samples) / best(
        lambda: strapdown.Integrator(pva).integrate(strapdown.compute_increments_from_imu(imu, "rate")), 3
    )
    print(
        f"python-ins, mechanisation of ready increments: {peer / 1e6:.3f} million; from rates {whole / 1e6:.3f} million"
    )
    print(f"ratio, from rates: {rate / whole:.1f}; to ready increments: {rate / peer:.1f}")
    short = measured.between(0.0, 40.0)
    _, increments, pva = frames_of_peer(short, first)
    import pandas as pd

    fixes = pd.DataFrame(
        np.column_stack([np.degrees(track.latitude), np.degrees(track.longitude), track.height]),
        index=track.time,
        columns=["lat", "lon", "alt"],
    ).iloc[:40]
    spread = np.diag([1e-3] * 3) + 1e-3 * np.tril(np.ones((3, 3)), -1)
    models = [
        inertial_sensor.EstimationModel(bias_sd=b, noise=n, bias_walk=w, scale_misal_sd=spread)
        for b, n, w in ((2e-3, 1e-4, 1e-6), (0.02, 1e-3, 1e-5))
    ]
    seconds = best(
        lambda: filters.run_feedback_filter(
            pva,
            0.02,
            0.01,
            0.2,
            1.0,
            increments,
            *models,
            measurements=[measurements.Position(fixes, 0.02)],
            time_step=0.1,
        ),
        1,
    )
    peer = len(increments) / seconds
    print(f"python-ins, filter of the same states: {peer:.0f} samples a second; ratio {filtered / peer:.0f}")


def moved(state: NavigationState, errors: np.ndarray) -> NavigationState:
    packed = state.packed
    apply_errors(packed, np.zeros(0), -errors)
    return unpacked(np.array([state.time]), packed[None]).state(0)


def one_drive(seed: int, duration: float = 180.0, rate: float = 100.0) -> dict[str, float]:
    """Normalised squared errors of one simulated drive, each over its degrees of freedom."""
    rng = np.random.default_rng(seed)
    drive = simulate_drive(rng, duration + 1.0)
    at = np.arange(int(duration * rate) + 1) / rate
    states = drive.states(at)
    truth = Trajectory(
        at, states.latitude, states.longitude, states.height, states.velocity_n, states.quaternion_nb
    )
    spreads = TriadSpread(0.02, 1e-3, 1e-3), TriadSpread(2e-3, 1e-3, misalignment=1e-3)
    bias = [rng.normal(0.0, spread.bias, 3) for spread in spreads]
    lower = np.diag(rng.normal(0.0, 1e-3, 3)) + np.tril(rng.normal(0.0, 1e-3, (3, 3)), -1)
    full = rng.normal(0.0, 1e-3, (3, 3))
    white = [N * np.sqrt(rate) * rng.standard_normal((len(at), 3)) for N in (1e-3, 1e-4)]
    walk = [np.cumsum(K / np.sqrt(rate) * rng.standard_normal((len(at), 3)), axis=0) for K in (1e-5, 1e-6)]
    force = states.specific_force_b @ (np.eye(3) + lower).T + bias[0] + white[0] + walk[0]
    angular = states.angular_rate_ib_b @ (np.eye(3) + full).T + bias[1] + white[1] + walk[1]
    true = np.concatenate(
        [
            bias[0] + walk[0][-1],
            np.diag(lower),
            lower[[1, 2, 2], [0, 0, 1]],
            bias[1] + walk[1][-1],
            np.diag(full),
            full[~np.eye(3, dtype=bool)],
        ]
    )
    rows = np.arange(int(rate), len(at), int(rate))
    fixes = truth.rows(rows)
    latitude, longitude, height = fixes.points(LEVER)
    noise = rng.normal(0.0, 0.02, (len(rows), 3))
    meridian, across = curvature_radii(latitude)
    track = make_track(
        fixes.time,
        (
            latitude + noise[:, 0] / meridian,
            longitude + noise[:, 1] / (across * np.cos(latitude)),
            height - noise[:, 2],
        ),
        np.full((len(rows), 3), 0.02),
    )
    setup = plan_filter(
        NoiseModel(random_walk=1e-3, rate_random_walk=1e-5),
        NoiseModel(random_walk=1e-4, rate_random_walk=1e-6),
        accelerometer=spreads[0],
        gyroscope=spreads[1],
        lever_arm_b=LEVER,
    ).with_start(0.02, 0.01, np.array([0.003, 0.003, 0.02]))
    start = moved(truth.state(0), np.sqrt(np.diag(setup.navigation_covariance)) * rng.standard_normal(9))
    run = run_filter(InertialSamples(at, force, angular), track, start, setup, keep_covariances=True)
    smoothed = smooth(run)
    found = {"innovations": float(np.mean(run.distances[:, 0])) / 3.0, "refused": float(len(run.refused))}
    middle = len(rows) // 2
    for name, result, row in (
        ("at the end", run, -1),
        ("in the middle", run, middle),
        ("smoothed, in the middle", smoothed, middle),
    ):
        errors = np.hstack(result.trajectory.errors_against(fixes))[row]
        for part, cut in (
            ("position", slice(0, 3)),
            ("velocity", slice(3, 6)),
            ("attitude", slice(6, 9)),
            ("all nine", slice(0, 9)),
        ):
            P = result.covariances[row][cut, cut]
            found[f"{part} {name}"] = float(errors[cut] @ np.linalg.solve(P, errors[cut])) / len(errors[cut])
    left = run.sensors[-1] - true
    found["sensor states at the end"] = float(
        left @ np.linalg.solve(run.covariances[-1][9:, 9:], left)
    ) / len(left)
    return found


def drives(count: int) -> None:
    rows = [one_drive(1000 + seed) for seed in range(count)]
    print(
        f"{count} simulated drives of 180 s, 30 states, 1 Hz positions of 2 cm; squared normalised errors over their"
    )
    print("degrees of freedom, mean ± its standard uncertainty (1 when consistent):")
    for name in rows[0]:
        values = np.array([row[name] for row in rows])
        if name == "refused":
            print(f"  {'fixes refused':<36} {values.sum():.0f} of {count * 180}")
        else:
            print(f"  {name:<36} {values.mean():.3f} ± {values.std(ddof=1) / np.sqrt(count):.3f}")


def read_drive(folder: Path) -> Drive:
    rows = np.genfromtxt(folder / "imu_1934.csv", delimiter=",")
    rows = rows[np.isfinite(rows).all(axis=1)]
    stamps = rows[:, 6] * 1e-3
    rows, stamps = rows[np.diff(stamps, prepend=-1.0) > 0.0], stamps[np.diff(stamps, prepend=-1.0) > 0.0]
    samples = InertialSamples(stamps, rows[:, :3] * 9.80665, np.radians(rows[:, 3:6]))
    return prepare_drive(samples, read_track(folder / "gnss_1934_sf.pos"), setup=CAR)


def errors_of(drive: Drive, trajectory: Trajectory, chosen: np.ndarray) -> np.ndarray:
    """Errors at the fixed solutions among the rows chosen of the track."""
    rows = np.flatnonzero(chosen & (drive.track.quality == 1))
    at = np.searchsorted(trajectory.time, drive.track.time[rows] - 1e-6)
    good = at < len(trajectory)
    track = drive.track.rows(rows[good])
    there = trajectory.rows(at[good])
    return position_differences(there.position, track.position)


def report(name: str, errors: np.ndarray) -> None:
    values = "/".join(f"{value:.3f}" for value in np.sqrt(np.mean(errors**2, axis=0)))
    print(f"  {name:<52} {values} m ({len(errors)} positions)")


def real(folder: Path, peer: bool) -> None:
    drive = read_drive(folder)
    print(drive.clock)
    print(drive.alignment)
    started = time.perf_counter()
    inside = (drive.track.time > drive.start.time) & (drive.track.time < drive.samples.time[-1])
    run = drive.run(CAR, interval=1.0, instants=drive.track.time[inside], keep_covariances=True)
    print(
        f"filter over {len(drive.samples)} samples: {time.perf_counter() - started:.2f} s, "
        f"{len(run.refused)} fixes refused"
    )
    for factor in (1.0, 0.5, 0.25):
        quieter = replace(
            CAR,
            angle_random_walk=factor * CAR.angle_random_walk,
            velocity_random_walk=factor * CAR.velocity_random_walk,
        )
        tried = drive.run(quieter, interval=1.0)
        mean = np.mean(tried.distances[tried.taken[:, 0], 0]) / 3.0
        print(f"innovations over what the filter expects, white noise times {factor:g}: {mean:.2f}")
    held_out = inside & ~np.isin(drive.track.time, drive.track.thinned(1.0)[0].time)
    print("rms north/east/down against the 4 Hz solution (fixed), 1 Hz aiding:")
    report("filter, all", errors_of(drive, run.trajectory, inside))
    report("filter, held out", errors_of(drive, run.trajectory, held_out))
    report("smoothed, held out", errors_of(drive, smooth(run).trajectory, held_out))
    if peer:
        real_peer(drive, inside, held_out)
    show_outages(drive, CAR, "noise and all 21 sensor states")
    bias_only = plan_filter(
        NoiseModel(random_walk=0.02, rate_random_walk=1e-3),
        NoiseModel(random_walk=0.002, rate_random_walk=1e-5),
        accelerometer=TriadSpread(bias=0.2),
        gyroscope=TriadSpread(bias=0.01),
    )
    show_outages(drive, bias_only, "biases only")
    bare = plan_filter(NoiseModel(random_walk=0.2), NoiseModel(random_walk=0.005))
    show_outages(drive, bare, "no sensor states at all")


def show_outages(drive: Drive, setup: FilterSetup, name: str) -> None:
    rng = np.random.default_rng(1)
    for repeated in (False, True):
        words = []
        for found in outages(drive, setup, repeated=repeated):
            block = 1 if repeated else round(2.0 * found.duration)  # sliding outages begin a second apart
            error = rms_of(found.horizontal**2, block, rng)
            words.append(
                f"{found.duration:g} s {error.value:.3g} ± {error.standard_uncertainty:.1g} m ({len(found.starts)})"
            )
        print(f"outages, {'repeated' if repeated else 'sliding'}, {name}: {', '.join(words)}")


def real_peer(drive: Drive, inside: np.ndarray, held_out: np.ndarray) -> None:
    """python-ins with the same start, clock, noise and fixes."""
    import pandas as pd
    from pyins import filters, inertial_sensor, measurements

    part = drive.samples.between(drive.start.time, float(drive.samples.time[-1]))
    _, increments, pva = frames_of_peer(part, drive.start)
    aid = drive.track.thinned(1.0)[0]
    aid = aid.rows(aid.time > drive.start.time)
    fixes = pd.DataFrame(
        np.column_stack([np.degrees(aid.latitude), np.degrees(aid.longitude), aid.height]),
        index=aid.time,
        columns=["lat", "lon", "alt"],
    )
    spread = np.full((3, 3), 0.01)
    gyro = inertial_sensor.EstimationModel(
        bias_sd=0.01, noise=list(CAR.angle_random_walk), bias_walk=1e-5, scale_misal_sd=spread
    )
    accel = inertial_sensor.EstimationModel(
        bias_sd=0.2, noise=0.02, bias_walk=1e-3, scale_misal_sd=np.tril(spread)
    )
    started = time.perf_counter()
    tilt, heading = np.degrees(drive.alignment.sigmas[[0, 2]])
    result = filters.run_feedback_filter(
        pva,
        0.02,
        0.05,
        tilt,
        heading,
        increments,
        gyro,
        accel,
        measurements=[measurements.Position(fixes, 0.01)],
        time_step=0.1,
    )
    seconds = time.perf_counter() - started
    print(f"python-ins: {seconds:.0f} s, {len(part) / seconds:.0f} samples a second")
    found = result.trajectory
    columns = [np.interp(drive.track.time, found.index, found[name]) for name in ("lat", "lon", "alt")]
    seen = Trajectory(
        drive.track.time,
        np.radians(columns[0]),
        np.radians(columns[1]),
        columns[2],
        np.zeros((len(drive.track), 3)),
        np.zeros((len(drive.track), 4)),
    )
    report("python-ins, all", errors_of(drive, seen, inside))
    report("python-ins, held out", errors_of(drive, seen, held_out))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--speed", action="store_true")
    parser.add_argument("--processor", action="store_true")
    parser.add_argument("--drives", type=int, default=0)
    parser.add_argument("--real", type=Path)
    parser.add_argument("--peer", action="store_true")
    chosen = parser.parse_args()
    if chosen.processor:
        global clock
        clock = time.process_time
    if chosen.speed:
        speed()
    if chosen.drives:
        drives(chosen.drives)
    if chosen.real:
        real(chosen.real, chosen.peer)


if __name__ == "__main__":
    main()
