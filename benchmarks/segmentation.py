"""How well holds are found: simulated recordings over grades, rates and conditions.

    python benchmarks/segmentation.py --runs 500

Each run draws a condition, a grade and a rate in turn, and everything else from its own seed. A true
hold is *found* if one found hold covers at least half of it and lies at least half inside it; a found
hold that is no true hold's is *false*. Holds that creep by 2.5 degrees or more are no holds: finding
one is false. An edge's error is found minus true, positive into the hold; edges at a recording's ends
are not counted.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
from dataclasses import dataclass, field, replace

import numpy as np

from tumble.earth import Site
from tumble.recording.recording import Recording
from tumble.segmentation import find_timeline
from tumble.simulation import (
    GRADES,
    Disturbance,
    Knock,
    Motion,
    Truth,
    poses_26,
    simulate_hand_poses,
    simulate_recording,
    simulate_tremor,
)

RATES = (25.0, 50.0, 100.0, 200.0, 400.0, 1000.0, 2000.0)
CONDITIONS = (
    "on a table",
    "in the hand",
    "beside a motor",
    "knocked",
    "creeping",
    "short holds",
    "slow turns",
    "fast turns",
    "bias drift",
    "samples missing",
    "raw counts",
    "begins and ends in motion",
    "accelerometer only",
    "all at once",
)
SITE = Site.from_latitude(np.radians(48.0))
CREEP_IS_NO_HOLD = np.radians(2.5)


@dataclass
class Score:
    """What came of some runs."""

    runs: int = 0
    true: int = 0
    found: int = 0
    reported: int = 0
    false: int = 0
    edges: list[float] = field(default_factory=list)

    def add(self, other: Score) -> None:
        self.runs += other.runs
        self.true += other.true
        self.found += other.found
        self.reported += other.reported
        self.false += other.false
        self.edges += other.edges

    def row(self, name: str) -> str:
        edges = np.asarray(self.edges)
        size = np.abs(edges)
        q50, q95, q99 = np.quantile(size, [0.5, 0.95, 0.99])
        return (
            f"| {name} | {self.runs} | {self.true} | {100 * self.found / self.true:.2f} | "
            f"{100 * self.false / max(self.reported, 1):.2f} | {100 * np.mean(size <= 0.2):.1f} | "
            f"{q50:.3f} | {q95:.3f} | {q99:.3f} | {np.median(edges):+.3f} |"
        )


HEADER = (
    "| | runs | holds | found % | false % | edges <= 0.2 s % | median | 95 % | 99 % | signed median, s |\n"
    "|---|---|---|---|---|---|---|---|---|---|"
)


def simulate_case(seed: int) -> tuple[str, str, float, Recording, Truth]:
    """Return condition, grade, rate, recording and truth of one run."""
    rng = np.random.default_rng([20100226, seed])
    condition = CONDITIONS[seed % len(CONDITIONS)]
    grade = list(GRADES.values())[(seed // len(CONDITIONS)) % len(GRADES)]
    rate = RATES[int(rng.integers(len(RATES)))]
    motion = _motion(condition, rate, rng, seen_by_gyro=grade.name in ("tactical", "ring-laser"))
    start, stop = 0.0, motion.duration
    if condition == "begins and ends in motion":
        start = motion.hold_duration[0] + 0.5 * motion.turn_duration[0]
        stop -= motion.hold_duration[-1] + 0.4 * motion.turn_duration[-1]
    missing = _missing(motion, rng) if condition in ("samples missing", "all at once") else ()
    recording, truth = simulate_recording(
        motion, rate, rng, site=SITE, grade=grade, start=start, stop=stop, missing=missing
    )
    if condition in ("bias drift", "all at once"):
        recording = _drifted(recording, grade.gyroscope.bias, rng)
    if condition in ("raw counts", "all at once"):
        recording = _counted(recording, rng)
    if condition == "accelerometer only":
        recording = replace(recording, angular_rate=None)
    return condition, grade.name, rate, recording, truth


def _motion(condition: str, rate: float, rng: np.random.Generator, *, seen_by_gyro: bool) -> Motion:
    holds = int(rng.integers(15, 27))
    poses = (
        poses_26(rng.uniform(0, 2 * np.pi))[rng.permutation(26)[:holds]]
        if rng.random() < 0.4
        else simulate_hand_poses(rng, holds)
    )
    hold = rng.uniform(1.5, 6.0, holds)
    angle = (poses[:-1].inv() * poses[1:]).magnitude()
    turn = np.maximum(rng.uniform(0.7, 3.0, holds - 1), angle / 5.0)
    if condition == "short holds":
        hold = rng.uniform(1.0, 2.0, holds)
    if condition == "slow turns":
        turn = angle / np.radians(rng.uniform(10.0, 20.0, holds - 1))
        turn = np.minimum(turn, 12.0)
    if condition == "all at once":
        hold = rng.uniform(1.2, 4.0, holds)
        turn = angle / np.radians(rng.uniform(15.0, 300.0, holds - 1))
        turn = np.clip(turn, 0.5, 10.0)
    if condition == "fast turns":
        turn = np.maximum(angle / np.radians(300.0), 0.5)
    creep = np.zeros((holds, 3))
    if condition == "creeping":
        direction = rng.standard_normal((holds, 3))
        if not seen_by_gyro:
            # about a horizontal axis: beneath a MEMS gyro's bias only the accelerometer can see it
            up = poses.inv().apply([0.0, 0.0, -1.0])
            direction -= np.sum(direction * up, axis=1, keepdims=True) * up
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        bad = rng.permutation(holds)[: holds // 4]
        creep = direction * np.radians(rng.uniform(0.0, 0.2, (holds, 1)))
        creep[bad] = direction[bad] * np.radians(rng.uniform(2.5, 6.0, (len(bad), 1)))
        hold[bad] = rng.uniform(3.0, 5.0, len(bad))
    motion = Motion.between_poses(
        poses, hold, turn, creep_vector_b=creep, lever_arm_b=rng.uniform(-0.15, 0.15, 3)
    )
    return motion.disturbed(*_disturbances(condition, rate, motion, rng))


def _disturbances(
    condition: str, rate: float, motion: Motion, rng: np.random.Generator
) -> tuple[Disturbance, ...]:
    if condition == "on a table":
        return ()
    if condition == "in the hand":
        return (
            simulate_tremor(rng, rate_rms=rng.uniform(0.02, 0.05), acceleration_rms=rng.uniform(0.05, 0.1)),
            simulate_tremor(rng, rate_rms=0.002, acceleration_rms=0.01, band=(0.5, 2.0)),
        )
    if condition == "beside a motor":
        # a unit's own filter keeps what is above half its rate out of its samples
        band = (20.0, min(150.0, 0.45 * rate)) if rate >= 100.0 else (0.35 * rate, 0.45 * rate)
        return (simulate_tremor(rng, rate_rms=0.05, acceleration_rms=rng.uniform(0.3, 1.0), band=band),)
    if condition == "all at once":
        hand = simulate_tremor(rng, rate_rms=0.05, acceleration_rms=0.1)
        sway = simulate_tremor(rng, rate_rms=0.004, acceleration_rms=0.02, band=(0.5, 2.0))
        return (hand, sway, *_knocks(motion, rng))
    light = simulate_tremor(rng, rate_rms=rng.uniform(0.0, 0.02), acceleration_rms=rng.uniform(0.0, 0.05))
    if condition != "knocked":
        return (light,)
    return (light, *_knocks(motion, rng))


def _knocks(motion: Motion, rng: np.random.Generator) -> list[Knock]:
    edges = motion.hold_edges
    chosen = [k for k in rng.permutation(len(edges))[:6] if edges[k, 1] - edges[k, 0] > 2.5]
    return [
        Knock(
            time=float(rng.uniform(edges[k, 0] + 0.8, edges[k, 1] - 1.1)),
            duration=float(rng.uniform(0.05, 0.3)),
            swing=np.radians(rng.uniform(-2.0, 2.0, 3)),
            blow=rng.uniform(-8.0, 8.0, 3),
        )
        for k in chosen
    ]


def _missing(motion: Motion, rng: np.random.Generator) -> list[tuple[float, float]]:
    times = np.sort(rng.uniform(0.0, motion.duration, 5))
    return [(float(t), float(t + rng.choice([0.02, 0.1, 0.2]))) for t in times]


def _counted(recording: Recording, rng: np.random.Generator) -> Recording:
    """The same samples as a 16-bit converter's counts around the middle of its range."""
    force, rate = recording.specific_force, recording.angular_rate
    assert force is not None
    assert rate is not None
    per_force, per_rate = rng.uniform(200.0, 2000.0), rng.uniform(1000.0, 6000.0)
    middle = 32768.0
    return replace(
        recording,
        specific_force=np.round(force * per_force + middle),
        angular_rate=np.round(rate * per_rate + middle),
        specific_force_unit="counts",
        angular_rate_unit="counts",
    )


def _drifted(recording: Recording, bias: float, rng: np.random.Generator) -> Recording:
    """A gyro bias that warms up: by its own size, 0.01 rad/s at most, exponentially."""
    rate = recording.angular_rate
    assert rate is not None
    size = min(bias, 0.01) * rng.uniform(-1.0, 1.0, 3)
    return replace(recording, angular_rate=rate + np.exp(-recording.time / 40.0)[:, None] * size)


def score_case(recording: Recording, truth: Truth, ends_count: bool = True) -> Score:
    """Judge the timeline of one recording."""
    timeline = find_timeline(recording)
    times = recording.time
    half = 0.5 / recording.rate
    found = [(times[h.start] - half, times[h.stop - 1] + half) for h in timeline.holds]
    first, last = times[0] - half, times[-1] + half
    score = Score(runs=1, reported=len(found))
    taken: set[int] = set()
    for (start, stop), creep in zip(truth.hold_edges, truth.creep_angle, strict=True):
        a, b = max(start, first), min(stop, last)
        if b - a < 0.5 or creep >= CREEP_IS_NO_HOLD:
            continue
        score.true += 1
        for k, (p, q) in enumerate(found):
            common = min(b, q) - max(a, p)
            if k not in taken and common >= 0.5 * (b - a) and common >= 0.5 * (q - p):
                taken.add(k)
                score.found += 1
                if start > first:
                    score.edges.append(p - start)
                if stop < last:
                    score.edges.append(stop - q)
                break
    score.false = len(found) - len(taken)
    return score


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=500)
    parser.add_argument("--first", type=int, default=0, help="number of the first run")
    parser.add_argument("--bad", action="store_true", help="list the runs that are not perfect")
    options = parser.parse_args()
    by: dict[str, dict[str, Score]] = {"condition": {}, "grade": {}, "rate": {}, "all": {}}
    search_seconds, samples = 0.0, 0
    for seed in range(options.first, options.first + options.runs):
        condition, grade, rate, recording, truth = simulate_case(seed)
        began = time.perf_counter()
        score = score_case(recording, truth)
        search_seconds += time.perf_counter() - began
        samples += len(recording)
        if options.bad and (score.found < score.true or score.false or np.max(np.abs(score.edges)) > 0.3):
            worst = np.max(np.abs(score.edges))
            print(
                f"run {seed}: {condition}, {grade}, {rate:g} Hz: {score.found} of {score.true}, "
                f"{score.false} false, worst edge {worst:.2f} s",
                file=sys.stderr,
            )
        names = {"condition": condition, "grade": grade, "rate": f"{rate:g} Hz", "all": "all"}
        for group, name in names.items():
            by[group].setdefault(name, Score()).add(score)
    print(HEADER)
    order = itertools.chain(
        ((c, by["condition"].get(c)) for c in CONDITIONS),
        ((g, by["grade"].get(g)) for g in GRADES),
        ((f"{r:g} Hz", by["rate"].get(f"{r:g} Hz")) for r in RATES),
        by["all"].items(),
    )
    for name, score in order:
        if score is not None:
            print(score.row(name))
    print(f"\n{samples} samples searched in {search_seconds:.2f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
