"""Two MPU-9150 tumbled together on one rig: does imu1 have something that imu0 has not?

    python benchmarks/two_units.py                # --leave-out: also without each hold and turn in turn

The program of the data set's authors (mikoff/imu-calib, MIT) ends with a cost of 0.28 for imu0 and of
2.07 for imu1. Both units saw the same motion, so that their difference shows what belongs to a unit:
its clock, a slip in its mount, its bias at rest. Their program's parameters are scored beside ours, and
its rule for rest is applied to both recordings.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation
from scipy.stats import f as fisher

from tumble.attitude import integrate_turns
from tumble.calibration import Estimate, calibrate_hand_held
from tumble.calibration.checks.scores import hold_norm_errors, score_turns
from tumble.calibration.equations.gathering import gather
from tumble.calibration.equations.turn import HoldsAndTurns
from tumble.earth import Site
from tumble.recording import Recording, read_recording
from tumble.segmentation import Timeline, find_timeline, observe_holds
from tumble.sensor import ImuModel, Triad

HERE = Path(__file__).resolve().parents[1]
FILES = (
    HERE / "src" / "tumble" / "data" / "mpu9150-imu0.csv.gz",
    HERE / "tests" / "reference" / "mpu9150" / "imu1.log.gz",
)
SITE = Site.from_gravity(9.81)

# What their program prints: scale xyz, non-orthogonality x y z, bias (9), and the gyro's three angles
# between the triads. The third was made with the 16 samples at 16.33 s not taken for rest.
THEIRS = {
    ("imu0", "as it is", 0.280): (
        (0.00359541, 0.00310805, 0.00658048, 0.00206329, 0.00044653, 0.0055443, 0.1028922, 0.09701021, 0.34462946),
        (0.00029091, 0.00450332, 0.00818529, -0.000571, -0.002355, 0.01392432, 0.01956127, -0.00672516, 0.02166985),
        (0.00055201, -0.00630746, -0.00153755),
    ),
    ("imu1", "as it is", 2.066): (
        (0.00466127, 0.00478023, 0.00948553, -0.00488502, -0.00017103, 0.00244708, 0.0902905, 0.06956095, 0.33820589),
        (-0.00016523, 0.00243388, -0.00190256, -0.01132224, 0.00366169, 0.00437447, -0.0105575, 0.01871007, 0.00531974),
        (-0.00993842, 0.00028089, 0.00115881),
    ),
    ("imu1", "false rest removed", 0.182): (
        (0.00466104, 0.00477783, 0.00948677, -0.00488185, -0.00016347, 0.00244297, 0.09028362, 0.06957794, 0.33819456),
        (-0.00110319, 0.00290636, 0.0021052, -0.00569798, 0.0017728, 0.00766443, -0.01024596, 0.01873476, 0.00604122),
        (-0.0054187, -0.00413971, 0.00085995),
    ),
}  # fmt: skip


@dataclass
class Unit:
    name: str
    recording: Recording
    timeline: Timeline
    estimate: Estimate
    data: HoldsAndTurns


def read_unit(name: str, path: Path) -> Unit:
    recording = read_recording(path, columns="ax,ay,az,gx,gy,gz", units="m/s^2,rad/s", rate=100.0)
    timeline = find_timeline(recording)
    means = observe_holds(recording, timeline)
    estimate = calibrate_hand_held(recording, timeline, means, SITE)
    return Unit(name, recording, timeline, estimate, gather(recording, timeline, means))


def their_model(values) -> ImuModel:
    """raw = M f + b for accelerometers; raw = E (M w + b) for gyros, E = 1 + skew(angles)."""

    def triad(numbers) -> tuple[np.ndarray, np.ndarray]:
        kx, ky, kz, nox, noy, noz, *bias = numbers
        return np.array([[1 + kx, noy, noz], [0, 1 + ky, nox], [0, 0, 1 + kz]]), np.array(bias)

    (force, force_bias), (gyro, gyro_bias) = triad(values[0]), triad(values[1])
    x, y, z = values[2]
    E = np.array([[1, -z, y], [z, 1, -x], [-y, x, 1]])
    return ImuModel(Triad(force, force_bias), Triad(E @ gyro, E @ gyro_bias))


def their_rest(recording: Recording) -> np.ndarray:
    """Their rule: 0.6 s of raw rate (bias included) under 0.13 rad/s."""
    still = np.linalg.norm(recording.angular_rate, axis=1) < 0.13
    rest, counter = np.zeros(len(recording), dtype=bool), 60
    for i, quiet in enumerate(still):
        counter = counter + 1 if quiet else 0
        rest[i] = quiet and counter > 60
        if not quiet:
            rest[max(i - 60, 0) : i] = False
    return rest


def rms_angle(model: ImuModel, data: HoldsAndTurns) -> float:
    angle = score_turns(model, data).angle
    return float(np.degrees(np.sqrt(np.nanmean(angle**2))))


def rms_norm(model: ImuModel, data: HoldsAndTurns) -> float:
    return 1e3 * float(np.sqrt(np.mean(hold_norm_errors(model, data.force_mean, SITE.gravity) ** 2)))


def up(unit: Unit) -> np.ndarray:
    """Direction of the specific force in each hold, in the unit's own frame."""
    force = unit.estimate.model.accelerometer.correct(unit.data.force_mean)
    return force / np.linalg.norm(force, axis=1, keepdims=True)


def turn_vectors(unit: Unit) -> np.ndarray:
    """Rotation vectors of the turns in the unit's own frame."""
    data, model = unit.data, unit.estimate.model
    turns = np.flatnonzero(data.turn_start >= 0)
    integrated = integrate_turns(
        data.time,
        data.raw_rate,
        data.raw_force,
        data.turn_start[turns],
        data.turn_stop[turns],
        gyro_inverse=np.linalg.inv(model.gyroscope.matrix),
        gyro_bias=model.gyroscope.bias,
        force_inverse=np.linalg.inv(model.accelerometer.matrix),
        force_bias=model.accelerometer.bias,
        g_sensitivity=np.zeros((3, 3)) if model.g_sensitivity is None else model.g_sensitivity,
    )
    return Rotation.from_matrix(integrated.C_start_end).as_rotvec()


def misfit(first: np.ndarray, second: np.ndarray) -> tuple[Rotation, float]:
    rotation, root = Rotation.align_vectors(second, first)
    return rotation, root**2


def slip_test(first: np.ndarray, second: np.ndarray, equations: int) -> str:
    """Two rotations between the units, before and after a split, against one: F of the best split."""
    count = first.shape[0]
    _, total = misfit(first, second)
    best = (0.0, 0, 0.0)
    for k in range(4, count - 3):
        (before, s1), (after, s2) = misfit(first[:k], second[:k]), misfit(first[k:], second[k:])
        statistic = ((total - s1 - s2) / 3) / ((s1 + s2) / (equations * count - 6))
        best = max(best, (statistic, k, float(np.degrees((after * before.inv()).magnitude()))))
    statistic, k, angle = best
    p = min(1.0, (count - 7) * fisher.sf(statistic, 3, equations * count - 6))
    return f"largest {angle:.3f}° after number {k}, F = {statistic:.1f}, p = {p:.2g} for {count - 7} splits"


def clock(units: tuple[Unit, Unit], rates: tuple[np.ndarray, np.ndarray]) -> tuple[float, float]:
    """Return (ratio, offset): imu1's stamp = ratio * imu0's stamp + offset."""
    t0, t1 = units[0].recording.time, units[1].recording.time

    def cost(x: np.ndarray) -> float:
        t = (0.9975 + 1e-4 * x[0]) * t0 + 1e-2 * x[1]
        there = t < t1[-1]
        resampled = np.column_stack([np.interp(t[there], t1, rates[1][:, i]) for i in range(3)])
        return 1e3 * float(np.mean((resampled - rates[0][there]) ** 2))

    found = minimize(cost, [0.0, 0.0], method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-8}).x
    return 0.9975 + 1e-4 * float(found[0]), 1e-2 * float(found[1])


def rest_differences(units, rates, ratio: float, offset: float) -> tuple[np.ndarray, np.ndarray]:
    """Mean of imu1's minus imu0's corrected rate over what both hold, rad/s, and its white sigma."""
    t0, t1 = units[0].recording.time, units[1].recording.time
    resampled = np.column_stack([np.interp(ratio * t0 + offset, t1, rates[1][:, i]) for i in range(3)])
    difference = resampled - rates[0]
    rows, sigmas = [], []
    for a, b in zip(units[0].timeline.holds, units[1].timeline.holds, strict=True):
        start = max(t0[a.start], (t1[b.start] - offset) / ratio) + 0.1
        stop = min(t0[a.stop - 1], (t1[b.stop - 1] - offset) / ratio) - 0.1
        chosen = difference[(t0 > start) & (t0 < stop)]
        rows.append(chosen.mean(axis=0))
        sigmas.append(chosen.std(axis=0) / np.sqrt(len(chosen)))
    return np.array(rows), np.array(sigmas)


def report_rest(units, difference: np.ndarray, sigma: np.ndarray) -> None:
    """Constant, g-sensitivity, one step in time: what the rates at rest of the two units differ by."""
    holds = difference.shape[0]
    force = units[1].estimate.model.accelerometer.correct(units[1].data.force_mean)
    for axis, name in enumerate("xyz"):
        weight = 1.0 / sigma[:, axis]

        def chi(columns: list[np.ndarray], axis=axis, weight=weight) -> tuple[float, np.ndarray]:
            design = np.column_stack([np.ones(holds), *columns])
            x = np.linalg.lstsq(design * weight[:, None], difference[:, axis] * weight, rcond=None)[0]
            return float(np.sum(((difference[:, axis] - design @ x) * weight) ** 2)), x

        constant, _ = chi([])
        sensitive, slope = chi([*force.T])
        steps = []
        for k in range(4, holds - 3):
            stepped, x = chi([*force.T, (np.arange(holds) >= k).astype(float)])
            steps.append(((sensitive - stepped) / (stepped / (holds - 5)), k, x[-1]))
        statistic, k, size = max(steps)
        p = min(1.0, 3 * len(steps) * fisher.sf(statistic, 1, holds - 5))
        p_force = fisher.sf((constant - sensitive) / 3 / (sensitive / (holds - 4)), 3, holds - 4)
        print(
            f"  gyro {name} of imu1: rms {1e3 * difference[:, axis].std():.2f} mrad/s "
            f"(white noise {1e3 * sigma[:, axis].mean():.2f}); g-sensitivity of the difference "
            f"{1e3 * np.linalg.norm(slope[1:]):.3f} (mrad/s)/(m/s²), p = {p_force:.2g}; best step "
            f"{1e3 * size:+.2f} mrad/s after hold {k}, p = {p:.2g}"
        )


def leave_out(unit: Unit) -> None:
    """Calibrate without each turn, and without each hold and its turns; say what moves most."""
    before = {p.name: p for p in unit.estimate.parameters if p.unit != "s"}
    means = observe_holds(unit.recording, unit.timeline)
    moved, angles = [], []
    holds = len(unit.timeline.holds)
    for kind, k in [("turn", k) for k in range(holds - 1)] + [("hold", k) for k in range(holds)]:
        gone = [k] if kind == "turn" else [k - 1, k]
        turns = tuple(replace(t, usable=t.usable and t.before not in gone) for t in unit.timeline.turns)
        timeline = replace(unit.timeline, turns=turns)
        unused = [k] if kind == "hold" else []
        estimate = calibrate_hand_held(unit.recording, timeline, means, SITE, unused_holds=unused)
        for p in estimate.parameters:
            if p.name in before and not p.name.startswith("g-sensitivity"):
                was = before[p.name]
                size = abs(p.value - was.value) / was.standard_uncertainty
                moved.append((size, f"{kind} {k + 1} moves {p.name} by {size:.1f} sigma"))
        angles.append((float(np.degrees(np.sqrt(np.nanmean(estimate.turns.angles**2)))), f"{kind} {k + 1}"))
    print(
        f"  {unit.name}: {max(moved)[1]}; the turns are least without {min(angles)[1]}: {min(angles)[0]:.3f}°"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--leave-out", action="store_true")
    options = parser.parse_args()
    units = tuple(read_unit(f"imu{i}", path) for i, path in enumerate(FILES))
    print("Turns left by each set of parameters, on our holds:")
    for unit in units:
        model = unit.estimate.model
        print(
            f"  {unit.name} tumble: {rms_norm(model, unit.data):.2f} mm/s², {rms_angle(model, unit.data):.3f}°"
        )
        for (name, how, cost), values in THEIRS.items():
            if name == unit.name:
                model = their_model(values)
                print(
                    f"  {name} theirs, {how}: {rms_norm(model, unit.data):.2f} mm/s², "
                    f"{rms_angle(model, unit.data):.3f}° (their cost {cost:.3f})"
                )
    print("Their rule for rest between 14.5 and 18.9 s:")
    for unit in units:
        rest = np.flatnonzero(their_rest(unit.recording)[1450:1890]) + 1450
        where = f", {rest[0] / 100:.2f} to {rest[-1] / 100:.2f} s" if rest.size else ""
        print(f"  {unit.name}: {rest.size} samples{where}")

    first, second = up(units[0]), up(units[1])
    rotation, total = misfit(first, second)
    angles = np.degrees(np.linalg.norm(np.cross(rotation.apply(first), second), axis=1))
    print(
        f"Gravity's direction, imu1 against imu0 turned: rms {np.sqrt(np.mean(angles**2)):.3f}° of {len(angles)} holds"
    )
    print("  by hold: " + " ".join(f"{angle:.2f}" for angle in angles))
    print(f"  slip: {slip_test(first, second, 2)}")
    v0, v1 = turn_vectors(units[0]), turn_vectors(units[1])
    turned, total = misfit(v0, v1)
    between = np.degrees((turned * rotation.inv()).magnitude())
    print(f"Turns, the same: rms {np.degrees(np.sqrt(total / len(v0))):.3f}° of {len(v0)} turns")
    print(f"  slip: {slip_test(v0, v1, 3)}; rotation differs from that of the holds by {between:.3f}°")

    rates = tuple(
        u.estimate.model.correct(u.recording.specific_force, u.recording.angular_rate)[1] for u in units
    )
    rates = rotation.apply(rates[0]), rates[1]
    ratio, offset = clock(units, rates)
    print(f"Clock: imu1's stamp = {ratio:.5f} * imu0's {1e3 * offset:+.1f} ms")
    print("Rates at rest, imu1 minus imu0 turned (the hand's motion cancels):")
    report_rest(units, *rest_differences(units, rates, ratio, offset))
    if options.leave_out:
        print("Without each hold and turn in turn:")
        for unit in units:
            leave_out(unit)


if __name__ == "__main__":
    main()
