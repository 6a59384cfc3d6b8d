"""The real recordings: our calibration beside imu_tk's, on data each has and has not seen.

    python benchmarks/real_recordings.py

The yardstick: at each hold the norm of the mean specific force against gravity; over each turn the
angle between gravity carried along by the corrected gyro and gravity seen at the next hold (windows of
2 s at the holds' edges, every sample turned by the gyro to the window's edge; the calibration's own
constant bias; turns under 5 degrees left out). Held out: five interleaved folds; hold k and the turn
after it belong to fold k mod 5; each fold is scored with a calibration that has not seen its holds, nor the turns to
and from them. Turns alone held out: one that has not seen the fold's turns, but all holds.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from dataclasses import replace
from pathlib import Path

import numpy as np

from tumble.calibration import (
    LAYOUT,
    Estimate,
    Options,
    Session,
    calibrate,
    find_procedure,
    gather,
    hold_norm_errors,
    named_function,
    rough_triad,
    score_turns,
    triad_from_unknowns,
    unknowns_from_triad,
)
from tumble.earth import Site
from tumble.export import read_imu_tk
from tumble.recording import read_recording
from tumble.segmentation import find_timeline, observe_holds
from tumble.sensor import ImuModel, Triad, change_frame
from tumble_papers.hayal import adjust_norm

HERE = Path(__file__).resolve().parents[1]
REFERENCE = HERE / "tests" / "reference"
FOLDS = 5


def score(model: ImuModel, data, gravity: float):
    return hold_norm_errors(model, data.force_mean, gravity), score_turns(model, data).angle


def calibrated(recording, timeline, site: Site, *, optional_terms: bool = True) -> Estimate:
    session = Session(recording, given_site=site, options=Options(optional_terms=optional_terms))
    session.timeline = timeline
    return calibrate(session, find_procedure("joint"))


def line(name: str, norms: np.ndarray, angles: np.ndarray) -> None:
    angles = angles[np.isfinite(angles)]
    print(
        f"  {name:44s}{1e3 * np.sqrt(np.mean(norms**2)):8.2f} mm/s²{np.degrees(np.sqrt(np.mean(angles**2))):9.3f}°"
        f"   ({norms.size} holds, {angles.size} turns)"
    )


def held_out(recording, timeline, site: Site, *, turns_alone: bool = False):
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
        estimate = calibrated(recording, seen, site)
        scored = score(estimate.model, data, site.gravity)
        norms[mine], angles[mine] = scored[0][mine], scored[1][mine]
    return norms, angles


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
        unknowns, _ = adjust_norm(data.force_mean[rest], alike[rest], gravity, start, 9)
        model = ImuModel(triad_from_unknowns(unknowns), None)
        norms[mine] = hold_norm_errors(model, data.force_mean[mine], gravity)
    return norms


def compare(model: ImuModel, estimate) -> None:
    """Print imu_tk's values beside ours, all in Shin's convention and our frame."""
    turned = change_frame(model, "accelerometer-x")
    x = np.zeros(LAYOUT.size)
    x[:12] = unknowns_from_triad(Triad(np.tril(turned.accelerometer.matrix), turned.accelerometer.bias))
    x[12:21], x[21:24] = turned.gyroscope.matrix.ravel(), turned.gyroscope.bias
    labels, values = named_function(frozenset(), "full", "accelerometer-x", ("counts", "counts"))
    theirs = {name: float(value) for (name, _), value in zip(labels, values(x), strict=True)}
    ours = {p.name: p for p in estimate.parameters}
    print(
        f"  {'parameter':42s}{'tumble':>13s}{'± sigma':>10s}{'imu_tk':>13s}{'difference / sigma':>20s}  unit"
    )
    for name, value in theirs.items():
        own = ours[name]
        difference = (value - own.value) / own.standard_uncertainty
        print(
            f"  {name:42s}{own.value:13.6g}{own.standard_uncertainty:10.2g}{value:13.6g}"
            f"{difference:20.1f}  {own.unit}"
        )


def main() -> None:
    mpu = {"columns": "ax,ay,az,gx,gy,gz", "units": "m/s^2,rad/s", "rate": 100.0}
    folder = REFERENCE / "xsens_mti_hand"
    cases = (
        (
            "Xsens MTi",
            [folder / "xsens_acc.txt.gz", folder / "xsens_gyro.txt.gz"],
            9.81744,
            {"rate": "crystal"},
        ),
        ("MPU-9150 imu0", HERE / "src/tumble/data/mpu9150-imu0.csv.gz", 9.81, mpu),
        ("MPU-9150 imu1", REFERENCE / "mpu9150" / "imu1.log.gz", 9.81, mpu),
    )
    for name, paths, gravity, options in cases:
        recording, site = read_recording(paths, **options), Site.from_gravity(gravity)
        timeline = find_timeline(recording)
        estimate = calibrated(recording, timeline, site)
        data = gather(recording, timeline, observe_holds(recording, timeline))
        print(
            f"{name}: {len(timeline.holds)} holds, {len(timeline.turns)} turns; sigma0 {estimate.sigma0:.2f}"
        )
        for term in estimate.terms:
            print(
                f"  {term.name}: {'kept' if term.kept else 'not wanted'}, F({term.degrees}) = {term.statistic:.1f}, "
                f"p = {term.probability:.2g}, largest {term.largest}"
            )
        for left in estimate.left_out:
            print(f"  {left.kind} {left.index + 1} left out: {left.reason}")
        line("tumble, on all of the recording", *score(estimate.model, data, gravity))
        told = "; ".join(f"{name}: {sigma:.2g}" for name, sigma in estimate.variance_components.items())
        print(f"  components: {told}")
        without = calibrated(recording, timeline, site, optional_terms=False)
        line("tumble, without optional terms", *score(without.model, data, gravity))
        line("tumble, held out (5 interleaved folds)", *held_out(recording, timeline, site))
        line("tumble, turns alone held out", *held_out(recording, timeline, site, turns_alone=True))
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
