"""How good the calibration of a magnetometer is: coverage, efficiency, disturbed fields, against the ellipsoid alone.

Recordings are from the second simulator (``tests/second_simulator``), which shares no code with tumble. Run it with
``python benchmarks/magnetometer.py [RUNS] [--disturbed RUNS]`` from the repository's root.

The bound is that of Cramér and Rao with all attitudes known: by hand from the model ``raw = M C' f + h``, white noise
and rounding, over the samples of the holds. No estimator that has to find the attitudes can reach it.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from second_simulator import GRADES, rotations
from second_simulator.magnetometer import Disturbance, Seen, draw_magnetometer, see
from second_simulator.procedures import by_hand
from tumble.calibration.magnetometer.estimate import Magnetometer, magnetometer_alone, magnetometer_from_holds
from tumble.calibration.magnetometer.verdict import UNEVEN, judge_magnetometer
from tumble.calibration.outcome.estimate import JointOutcome
from tumble.calibration.procedures.joint import run_joint
from tumble.calibration.session import Session
from tumble.errors import TumbleError
from tumble.recording import Recording
from tumble.recording.magnetic_field import MagneticField

# rad, of a place where the simulated dip of 66° may be.
LATITUDE = 0.84
KINDS = ("consumer", "industrial")
DIRECTIONS = np.random.default_rng(1).standard_normal((200, 3))
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)


@dataclass
class Run:
    """One simulated recording: the truth, and what was found."""

    seen: Seen
    outcome: JointOutcome
    found: Magnetometer

    @property
    def errors(self) -> np.ndarray:
        """(13,) of matrix, bias and dip; the field's norm is one."""
        triad = self.found.triad
        assert triad is not None
        matrix = triad.matrix - self.seen.norm * self.seen.matrix("accelerometer-x")
        bias = triad.bias - self.seen.magnetometer.hard_iron
        return np.concatenate([matrix.ravel(), bias, [self.found.dip - self.seen.dip]])

    @property
    def sigmas(self) -> np.ndarray:
        """(13,) as stated."""
        return np.append(np.sqrt(np.diag(self.found.covariance)), self.found.dip_sigma)

    def bound(self) -> np.ndarray:
        """(13,) the bound's standard deviations, in the axes of the case that the simulator knows."""
        grid, attitude = self.seen.simulation.path.track()
        base, time = self.outcome.data.base, self.seen.time
        sensor, dip = self.seen.magnetometer, self.seen.dip
        variance = sensor.noise**2 + sensor.step**2 / 12.0
        M = self.seen.norm * sensor.matrix
        # Declination 4° as `see` has it by default; the azimuth is an unknown of the bound, too.
        azimuth = np.radians(4.0)
        f = np.array([np.cos(dip) * np.cos(azimuth), np.cos(dip) * np.sin(azimuth), np.sin(dip)])
        by_dip = np.array([-np.sin(dip) * np.cos(azimuth), -np.sin(dip) * np.sin(azimuth), np.cos(dip)])
        by_azimuth = np.array([-f[1], f[0], 0.0])
        information = np.zeros((14, 14))
        for k in range(base.holds):
            start, stop = base.time[base.head[k, 0]], base.time[base.tail[k, 1] - 1]
            count = int(np.sum((time >= start) & (time <= stop)))
            at = min(int(np.searchsorted(grid, 0.5 * (start + stop) - 12.0)), len(grid) - 1)
            back = rotations.to_matrix(rotations.inverse(attitude[at]))
            J = np.hstack(
                [
                    np.kron(np.eye(3), (back @ f)[None]),
                    np.eye(3),
                    (M @ back @ by_dip)[:, None],
                    (M @ back @ by_azimuth)[:, None],
                ]
            )
            information += count / variance * J.T @ J
        return np.sqrt(np.diag(np.linalg.inv(information)))[:13]


def recorded(seen: Seen) -> Recording:
    """Return the recording of a simulation with its magnetometer."""
    made = seen.simulation
    force, rate = made.units.split(",")
    return Recording(
        time=made.time,
        specific_force=made.force,
        angular_rate=made.rate,
        specific_force_unit=force,
        angular_rate_unit=rate,
        rate=100.0,
        magnetic_field=MagneticField(seen.time, seen.values, "counts"),
    )


def play(seed: int, wrong: str = "") -> Run | None:
    """Simulate and calibrate; None where the recording is refused."""
    rng = np.random.default_rng([seed, 23])
    made = by_hand(GRADES[KINDS[seed % len(KINDS)]], rng)
    seen = see(made, draw_magnetometer(rng), rng, disturbance=disturbance(wrong, made.path.steps, rng))
    recording = recorded(seen)
    session = Session(recording)
    try:
        run_joint(session)
        assert session.joint is not None
        assert recording.magnetic_field is not None
        return Run(seen, session.joint, magnetometer_from_holds(session.joint, recording.magnetic_field))
    except TumbleError as error:
        print(f"  {seed}: {error}")
        return None


def disturbance(wrong: str, steps: list, rng: np.random.Generator) -> Disturbance | None:
    """Return what is wrong with the field, by its name."""
    holds = [step for step in steps if step.kind == "hold"]
    k = int(rng.integers(4, len(holds) - 4))
    direction = rng.standard_normal(3)
    direction /= np.linalg.norm(direction)
    if wrong.startswith("current"):
        return Disturbance(current=float(wrong.split()[1]) * direction, since=holds[k].stop + 0.1)
    if wrong.startswith("iron"):
        return Disturbance(iron={k: float(wrong.split()[1]) * direction})
    if wrong.startswith("gradient"):
        # A magnet's field has no divergence and no curl: symmetric, without trace.
        G = rng.standard_normal((3, 3))
        G = G + G.T - 2.0 * np.trace(G) / 3.0 * np.eye(3)
        return Disturbance(gradient=float(wrong.split()[1]) * G / np.linalg.norm(G))
    return None


def off_sphere(corrected: np.ndarray) -> float:
    """Root mean square by which corrected unit fields are off, after the best rotation, as a share."""
    left, _, right = np.linalg.svd(DIRECTIONS.T @ corrected)
    turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    return float(np.sqrt(np.mean(np.sum((corrected - DIRECTIONS @ turn) ** 2, axis=1))))


def compare(run: Run) -> tuple[float, float]:
    """Errors of the corrected field, shares, of the joint estimate and of the ellipsoid, after the best rotation."""
    true = run.seen.norm * run.seen.matrix("accelerometer-x")
    raw = DIRECTIONS @ true.T + run.seen.magnetometer.hard_iron
    alone = magnetometer_alone(MagneticField(run.seen.time, run.seen.values, "counts"))
    joint = run.found.triad
    assert joint is not None
    if alone.triad is None:
        return off_sphere(joint.correct(raw)), np.nan
    return off_sphere(joint.correct(raw)), off_sphere(alone.triad.correct(raw))


def clean(runs: int) -> None:
    """Coverage, efficiency, false alarms."""
    made = [run for seed in range(runs) if (run := play(seed)) is not None]
    ratios = np.array([run.errors / run.sigmas for run in made])
    inside = np.abs(ratios) < 1.96
    sigmas = np.array([run.sigmas for run in made])
    bounds, errors = np.array([run.bound() for run in made]), np.array([run.errors for run in made])
    print(
        f"{len(made)} of {runs} recordings by hand, 26 poses, magnetometer at 50 Hz with 0.4 µT of noise a sample"
    )
    print(
        f"inside 95 %: matrix {100 * inside[:, :9].mean():.1f} %, bias {100 * inside[:, 9:12].mean():.1f} %, "
        f"dip {100 * inside[:, 12].mean():.1f} %; all {100 * inside.mean():.1f} %"
    )
    print(f"rms error over stated: {np.sqrt(np.mean(ratios**2)):.3f}")
    for name, place in (("matrix", slice(0, 9)), ("bias", slice(9, 12)), ("dip", slice(12, 13))):
        # Each recording's own bound: errors in units of it.
        efficiency = 1.0 / np.sqrt(np.mean((errors[:, place] / bounds[:, place]) ** 2))
        # An rms of n numbers is known to 1 / sqrt(2 n) of itself; the ratio to what is stated has no such chance.
        chance = efficiency / np.sqrt(2.0 * errors[:, place].size)
        stated = 1.0 / np.sqrt(np.mean((sigmas[:, place] / bounds[:, place]) ** 2))
        print(
            f"Cramér-Rao bound (attitudes known), {name}: over rms error {efficiency:.3f} ± {chance:.3f} by chance, "
            f"over the stated uncertainty {stated:.3f}"
        )
    both = np.array([compare(run) for run in made])
    joint, alone = 1e2 * np.sqrt(np.nanmean(both**2, axis=0))
    print(
        f"corrected field off, best rotation taken out: {joint:.3f} % of the norm, "
        f"by the ellipsoid alone {alone:.3f} %"
    )
    rotation = np.degrees(np.sqrt(np.mean([rotation_error(run) ** 2 for run in made])))
    print(
        f"rotation to the other triads off by {rotation:.4f}° rms an axis (the ellipsoid does not determine it)"
    )
    alarms(made, "a field that stays and is uniform")


def rotation_error(run: Run) -> float:
    """Root mean square about one axis, rad, of the rotation between the magnetometer and the other triads."""
    assert run.found.triad is not None
    true = run.seen.norm * run.seen.matrix("accelerometer-x")
    off = np.linalg.solve(true, run.found.triad.matrix) - np.eye(3)
    axial = 0.5 * np.array([off[2, 1] - off[1, 2], off[0, 2] - off[2, 0], off[1, 0] - off[0, 1]])
    return float(np.linalg.norm(axial) / np.sqrt(3.0))


def alarms(made: list[Run], name: str) -> None:
    """Shares of recordings in which something is said of the field."""
    moving = np.mean([run.found.moving is not None for run in made])
    named = np.mean([bool(run.found.left_out) for run in made])
    uneven = np.mean([run.found.scatter > UNEVEN for run in made])
    not_fit = np.mean([judge_magnetometer(run.found, LATITUDE).use != "fit" for run in made])
    inside = np.mean([np.abs(run.errors / run.sigmas) < 1.96 for run in made if run.found.triad is not None])
    print(
        f"{name}: moves {100 * moving:.1f} %, a hold named {100 * named:.1f} %, not uniform {100 * uneven:.1f} %, "
        f"verdict not plainly fit {100 * not_fit:.1f} %, inside 95 % {100 * inside:.1f} %  ({len(made)} recordings)"
    )


def disturbed(runs: int) -> None:
    """Shares of disturbed fields that are found."""
    for wrong in (
        "current 0.3",
        "current 1",
        "iron 0.5",
        "iron 2",
        "gradient 2",
        "gradient 10",
        "gradient 30",
    ):
        made = [run for seed in range(10_000, 10_000 + runs) if (run := play(seed, wrong)) is not None]
        unit = "µT/m, holds 0.1 m apart" if wrong.startswith("gradient") else "µT"
        alarms(made, f"{wrong} {unit}")


def main() -> None:
    """Print all figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("runs", type=int, nargs="?", default=100)
    parser.add_argument("--disturbed", type=int, default=0, metavar="RUNS")
    given = parser.parse_args()
    if given.runs:
        clean(given.runs)
    if given.disturbed:
        disturbed(given.disturbed)


if __name__ == "__main__":
    main()
