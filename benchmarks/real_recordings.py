"""The real recordings: our calibration beside imu_tk's, on data each has and has not seen.

    python benchmarks/real_recordings.py
    python benchmarks/real_recordings.py --joint    only what the joint estimator adds

The yardstick: at each hold the norm of the mean specific force against gravity; over each turn the
angle between gravity carried along by the corrected gyro and gravity seen at the next hold (windows of
2 s at the holds' edges, every sample turned by the gyro to the window's edge; the calibration's own
constant bias; turns under 5 degrees left out). Held out: five interleaved folds; hold k and the turn
after it belong to fold k mod 5; each fold is scored with a calibration that has not seen its holds, nor the turns to
and from them. Turns alone held out: one that has not seen the fold's turns, but all holds.
"""

from __future__ import annotations

import os
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from dataclasses import replace
from pathlib import Path

import numpy as np

from tumble.calibration import calibrate_hand_held
from tumble.calibration.canonical import named_values
from tumble.calibration.checks.scores import hold_norm_errors, score_turns
from tumble.calibration.closed_forms.start_values import rough_triad
from tumble.calibration.equations.gathering import gather
from tumble.calibration.equations.triad_unknowns import triad_from_unknowns, unknowns_from_triad
from tumble.calibration.joint import calibrate_joint
from tumble.calibration.procedures.multi_position import fit_norms
from tumble.earth import Site
from tumble.export.readers import read_imu_tk
from tumble.recording import read_recording
from tumble.segmentation import find_timeline, observe_holds
from tumble.sensor import ImuModel, Triad, change_frame

HERE = Path(__file__).resolve().parents[1]
REFERENCE = HERE / "tests" / "reference"
FOLDS = 5


def score(model: ImuModel, data, gravity: float):
    return hold_norm_errors(model, data.force_mean, gravity), score_turns(model, data).angle


def line(name: str, norms: np.ndarray, angles: np.ndarray) -> None:
    angles = angles[np.isfinite(angles)]
    print(
        f"  {name:44s}{1e3 * np.sqrt(np.mean(norms**2)):8.2f} mm/s²{np.degrees(np.sqrt(np.mean(angles**2))):9.3f}°"
        f"   ({norms.size} holds, {angles.size} turns)"
    )


def held_out(recording, timeline, site: Site, *, joint: bool = False, turns_alone: bool = False):
    """Return norms and angles of holds and turns that the estimate has not seen."""
    data = gather(recording, timeline, observe_holds(recording, timeline))
    norms, angles = np.full(data.holds, np.nan), np.full(data.holds, np.nan)

    for fold in range(FOLDS):
        mine = [k for k in range(data.holds) if k % FOLDS == fold]
        kept = [k for k in range(data.holds) if turns_alone or k % FOLDS != fold]
        at = {k: number for number, k in enumerate(kept)}
        turns = tuple(
            replace(turn, before=at[turn.before], after=at[turn.after])
            for turn in timeline.turns
            if turn.before in at and turn.after in at and (not turns_alone or turn.before % FOLDS != fold)
        )
        seen = replace(timeline, holds=tuple(timeline.holds[k] for k in kept), turns=turns)
        means = observe_holds(recording, seen)
        estimate = calibrate_hand_held(recording, seen, means, site)
        if joint:
            estimate = calibrate_joint(recording, seen, means, site, estimate)
        scored = score(estimate.model, data, site.gravity)
        norms[mine], angles[mine] = scored[0][mine], scored[1][mine]
    return norms, angles


def compare_held_out(joint: np.ndarray, other: np.ndarray, unit: str, factor: float) -> None:
    """Print by how much the mean squares of both differ, with a 95 % interval of a bootstrap over what is hidden."""
    known = np.isfinite(joint) & np.isfinite(other)
    change = (factor * joint[known]) ** 2 - (factor * other[known]) ** 2
    rng = np.random.default_rng(0)
    drawn = change[rng.integers(0, change.size, (10_000, change.size))].mean(axis=1)
    low, high = np.quantile(drawn, (0.025, 0.975))
    print(f"    mean square, joint less hand-held {change.mean():+10.4g} [{low:+.4g}, {high:+.4g}] ({unit})²")


def held_out_plain_norms(data, gravity: float) -> np.ndarray:
    """Return held-out norms of the plain fit: hold norms alone, all holds weighing alike (imu_tk's way)."""
    norms = np.full(data.holds, np.nan)
    holds = np.arange(data.holds)
    alike = np.broadcast_to(
        np.eye(3) * np.mean(np.diagonal(data.force_covariance, 0, 1, 2)), (data.holds, 3, 3)
    )
    for fold in range(FOLDS):
        mine, rest = holds[holds % FOLDS == fold], holds[holds % FOLDS != fold]
        start = rough_triad(data.force_mean[rest], gravity)
        fit = fit_norms(data.force_mean[rest], alike[rest], gravity, start, np.arange(9), robust=False)
        model = ImuModel(triad_from_unknowns(fit.unknowns), None)
        norms[mine] = hold_norm_errors(model, data.force_mean[mine], gravity)
    return norms


def show_joint(recording, timeline, means, site: Site, start) -> None:
    """Print what the joint estimator makes of a recording: its terms, components and scores."""
    estimate = calibrate_joint(recording, timeline, means, site, start)
    data = gather(recording, timeline, means)
    for term in estimate.terms:
        kept = "kept" if term.kept else "not wanted"
        print(
            f"  joint, {term.name}: {kept}, F({term.degrees}) = {term.statistic:.1f}, p = {term.probability:.2g}"
        )
    told = "; ".join(f"{name}: {sigma:.2g}" for name, sigma in estimate.variance_components.items())
    print(f"  joint, components: {told}")
    for left in estimate.left_out:
        print(f"  joint, {left.kind} {left.index + 1} left out: {left.reason}")
    line("joint, on all of the recording", *score(estimate.model, data, site.gravity))
    seen_by_neither = [held_out(recording, timeline, site, joint=joint) for joint in (True, False)]
    line("joint, held out (5 interleaved folds)", *seen_by_neither[0])
    for at, unit, factor in ((0, "mm/s²", 1e3), (1, "°", 180.0 / np.pi)):
        compare_held_out(seen_by_neither[0][at], seen_by_neither[1][at], unit, factor)
    for name, joint in (("hand-held", False), ("joint", True)):
        scored = held_out(recording, timeline, site, joint=joint, turns_alone=True)
        line(f"{name}, turns alone held out", *scored)


def compare(model: ImuModel, estimate) -> None:
    """Print imu_tk's values beside ours, all in Shin's convention and our frame."""
    turned = change_frame(model, "accelerometer-x")
    x = np.zeros(36)
    x[:12] = unknowns_from_triad(Triad(np.tril(turned.accelerometer.matrix), turned.accelerometer.bias))
    x[12:21], x[21:24] = turned.gyroscope.matrix.ravel(), turned.gyroscope.bias
    theirs, _ = named_values(
        x,
        np.zeros((36, 36)),
        terms=frozenset(),
        gyro="full",
        units=("counts", "counts"),
        factors=(None, None),
    )
    ours = {p.name: p for p in estimate.parameters}
    print(
        f"  {'parameter':42s}{'tumble':>13s}{'± sigma':>10s}{'imu_tk':>13s}{'difference / sigma':>20s}  unit"
    )
    for value in theirs:
        own = ours[value.name]
        difference = (value.value - own.value) / own.standard_uncertainty
        print(
            f"  {value.name:42s}{own.value:13.6g}{own.standard_uncertainty:10.2g}{value.value:13.6g}"
            f"{difference:20.1f}  {own.unit}"
        )


def main() -> None:
    only_joint = "--joint" in sys.argv[1:]
    mpu = {"columns": "ax,ay,az,gx,gy,gz", "units": "m/s^2,rad/s", "rate": 100.0}
    folder = REFERENCE / "xsens_mti_hand"
    cases = (
        ("Xsens MTi", [folder / "xsens_acc.txt.gz", folder / "xsens_gyro.txt.gz"], 9.81744, {}),
        ("MPU-9150 imu0", HERE / "src/tumble/data/mpu9150-imu0.csv.gz", 9.81, mpu),
        ("MPU-9150 imu1", REFERENCE / "mpu9150" / "imu1.log.gz", 9.81, mpu),
    )
    for name, paths, gravity, options in cases:
        recording, site = read_recording(paths, **options), Site.from_gravity(gravity)
        timeline = find_timeline(recording)
        means = observe_holds(recording, timeline)
        estimate = calibrate_hand_held(recording, timeline, means, site)
        data = gather(recording, timeline, means)
        print(
            f"{name}: {len(timeline.holds)} holds, {len(timeline.turns)} turns; sigma0 {estimate.sigma0:.2f}"
        )
        if only_joint:
            show_joint(recording, timeline, means, site, estimate)
            continue
        for term in estimate.terms:
            print(
                f"  {term.name}: {'kept' if term.kept else 'not wanted'}, F({term.degrees}) = {term.statistic:.1f}, "
                f"p = {term.probability:.2g}, largest {term.largest}"
            )
        for left in estimate.left_out:
            print(f"  {left.kind} {left.index + 1} left out: {left.reason}")
        line("tumble, on all of the recording", *score(estimate.model, data, gravity))
        without = calibrate_hand_held(recording, timeline, means, site, optional_terms=False)
        line("tumble, without optional terms", *score(without.model, data, gravity))
        line("tumble, held out (5 interleaved folds)", *held_out(recording, timeline, site))
        show_joint(recording, timeline, means, site, estimate)
        plain = held_out_plain_norms(data, gravity)
        rms = 1e3 * np.sqrt(np.mean(plain**2))
        print(f"  {'norms alone, alike weights, held out':44s}{rms:8.2f} mm/s²")
        if name.startswith("Xsens"):
            theirs = read_imu_tk(REFERENCE / "xsens_mti_hand").model
            line("imu_tk, on all of the recording", *score(theirs, data, gravity))
            print("  With g-sensitivity:")
            compare(theirs, estimate)
            print("  Without g-sensitivity, imu_tk's own model:")
            compare(theirs, without)


if __name__ == "__main__":
    main()
