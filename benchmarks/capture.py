"""What the guide is worth: simulated persons with it, with a fixed list of 26 poses, and the best plan; what it costs.

    python benchmarks/capture.py cost
    python benchmarks/capture.py plans [GRADE]
    python benchmarks/capture.py persons [RUNS] [GRADE] [CALIBRATED]

``persons``: the list of 26 poses is gone through first. The worst uncertainties that it ends with in some groups of
parameters are the targets of a person who follows the guide with the same unit. Both keep each pose 3 s and 0.2 to
0.5 s more, until they have heard it; of both one pose in ten fails. Of the first CALIBRATED runs the recording is
calibrated, and its errors against the truth are held against what the guide predicted.
``plans``: the shortest sequence of poses that a search finds for the same uncertainties, knowing everything before it
begins, and a time below which no plan whatever can be.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from uncertainty import true_values

from tumble.attitude.directions import twenty_six_directions
from tumble.capture.events import Event
from tumble.capture.guide import SESSION, TURN, Guide
from tumble.capture.machine import Capture
from tumble.capture.samples import Channels
from tumble.capture.simulated_person import QUARTER_TURN, Flaws, SimulatedPerson, twenty_six_in_order
from tumble.design.joint_information import GROUPS, NAMES
from tumble.design.joint_plan import PlanTask
from tumble.design.next_step import led_holds
from tumble.earth import Site
from tumble.protocol.steps import HoldStep, Protocol, TurnStep
from tumble.recording.clock import Clock
from tumble.recording.recording import Recording
from tumble.recording.samples import Samples, joined
from tumble.sample_rates import sample_rate
from tumble.simulation.grades import Grade, find_grade
from tumble.workflows.calibrate import calibrate

SITE = Site.from_gravity(9.80665)
FLAWS = Flaws(too_short=0.05, creeping=0.05)
HOLD = 3.0
CASES: dict[str, tuple[str, ...]] = {
    "all parameters": tuple(GROUPS),
    "the accelerometer": ("accelerometer bias", "accelerometer scale", "accelerometer misalignment"),
    "gyro scale and axes": ("gyro scale", "gyro misalignment", "rotation between the triads"),
}
# The list's uncertainties are reached where they are reached within this.
SAME = 1.02


@dataclass
class Session:
    """What a person recorded, and what was known in the end."""

    person: SimulatedPerson
    capture: Capture
    events: list[Event]
    samples: list[Samples]

    def worst(self, group: str) -> float:
        """The largest sigma of a group; infinite where one is not determined."""
        values = [self.capture.progress.sigmas.get(name) for name in NAMES[GROUPS[group]]]
        return max(np.inf if value is None else value for value in values)


def guide_of(grade: Grade, targets: dict[str, float], candidates: dict[int, object]) -> Guide:
    """A guide that shares what may come next with the others of its grade: half of the time is spent on that."""
    # The clock is known, so that the gyro scale factors are poses' work.
    guide = Guide(grade, SITE, HOLD, targets, rate=sample_rate(f"{grade.rate:.0f}±0.0001"), patient=True)
    guide._candidates = candidates  # type: ignore[assignment]  # the futures of all guides
    return guide


def guided(person: SimulatedPerson, guide: Guide, longest: float) -> Session:
    """Follow the guide until it is enough."""
    capture: Capture | None = None
    said: list[Event] = []
    samples: list[Samples] = []
    for piece in person:
        if isinstance(piece, Channels):
            capture = Capture(piece, guide, HOLD)
        elif isinstance(piece, Samples) and capture is not None:
            samples.append(piece)
            events = capture.feed(piece)
            said += events
            person(events, capture)
            if capture.time > longest or any(e.kind == "enough" for e in events):
                break
    assert capture is not None
    return Session(person, capture, said, samples)


def listed(person: SimulatedPerson, guide: Guide) -> Session:
    """Go through the list, and ask at the end what is known."""
    pieces = list(person)
    samples = [piece for piece in pieces if isinstance(piece, Samples)]
    channels = next(piece for piece in pieces if isinstance(piece, Channels))
    capture = Capture(channels, None, HOLD)
    for part in joined(samples).parts(2.0):
        guide.look_at_clock(part.time)
        capture.feed(part)
    capture.guide = guide
    return Session(person, capture, capture.finish(), samples)


def errors_of(session: Session, grade: Grade) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(21,) predicted and stated sigmas, and errors against the truth, of the recording's calibration."""
    whole = joined(session.samples)
    assert whole.specific_force is not None
    assert whole.angular_rate is not None
    stamps, clock = whole.time, Clock("stated", grade.rate, 1e-6)
    recording = Recording(
        stamps,
        whole.specific_force,
        whole.angular_rate,
        "m/s^2",
        "rad/s",
        grade.rate,
        said_clock=clock,
    )
    run = calibrate(recording, site=SITE)
    model, count = session.person.model, len(whole)
    wander = [one[:count].mean(axis=0) for one in session.person._wander]
    meant = replace(
        model,
        accelerometer=replace(model.accelerometer, bias=model.accelerometer.bias + wander[0]),
        gyroscope=replace(model.gyroscope, bias=model.gyroscope.bias + wander[1]),
    )
    truth = true_values(meant, run.estimate)
    told = {
        p.name: (p.standard_uncertainty, p.value - truth[p.name])
        for p in run.estimate.parameters
        if p.name in truth
    }
    predicted = [session.capture.progress.sigmas[name] for name in NAMES[:21]]
    stated, error = np.array([told[name] for name in NAMES[:21]]).T
    return np.array(predicted, dtype=float), stated, error


def persons(runs: int, name: str, calibrated: int) -> None:
    """Print what the guide is worth with units of a grade."""
    grade = find_grade(name)
    candidates: dict[int, object] = {}
    shares: dict[str, list[float]] = {case: [] for case in CASES}
    reached = dict.fromkeys(CASES, 0)
    holds: dict[str, list[int]] = {case: [] for case in CASES}
    told: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for seed in range(runs):
        order = np.random.default_rng([seed, 5]).permutation(26)
        fixed = listed(
            SimulatedPerson(grade, seed, poses=twenty_six_in_order()[order], flaws=FLAWS),
            guide_of(grade, {}, candidates),
        )
        for case, groups in CASES.items():
            targets = {g: SAME * fixed.worst(g) for g in groups if np.isfinite(fixed.worst(g))}
            person = SimulatedPerson(grade, seed, flaws=FLAWS)
            found = guided(person, guide_of(grade, targets, candidates), 3.0 * fixed.capture.time)
            reached[case] += all(found.worst(group) <= target for group, target in targets.items())
            shares[case].append(found.capture.time / fixed.capture.time)
            holds[case].append(len(found.capture.holds))
            if case == "all parameters" and seed < calibrated:
                told.append(errors_of(found, grade))
        shown = ", ".join(f"{100 * share[-1]:.0f} %" for share in shares.values())
        print(f"  unit {seed}: list {fixed.capture.time:.0f} s; guide {shown}", flush=True)
    for case in CASES:
        low, middle, high = np.percentile(shares[case], (10, 50, 90))
        print(
            f"{name}, {case}: {reached[case]} of {runs} reach the list's uncertainties; {100 * middle:.0f} % of its "
            f"time (median; {100 * low:.0f} to {100 * high:.0f} % of eight in ten), {np.mean(holds[case]):.0f} holds"
        )
    if told:
        predicted, stated, error = (np.array(one) for one in zip(*told, strict=True))
        for group, part in list(GROUPS.items())[:7]:
            ratio = np.exp(np.mean(np.log(predicted[:, part] / stated[:, part])))
            rms = np.sqrt(np.mean((error[:, part] / predicted[:, part]) ** 2))
            print(f"{name}, {group}: predicted over stated {ratio:.2f}, rms error over predicted {rms:.2f}")


class Moves:
    """Each turn from one of the 26 directions to another, with the hold there: what it determines and what it takes."""

    def __init__(self, grade: Grade) -> None:
        directions = twenty_six_directions()
        task = PlanTask.of_grade(Protocol("moves", "joint", (HoldStep(HOLD), TurnStep(TURN))), grade, SITE)
        self.parameters = len(task.parameters())
        at = slice(0, self.parameters)
        sizes = np.outer(task.sizes, task.sizes)[at, at]
        self.seconds, self.matrices = (
            np.full((26, 26), np.inf),
            np.zeros((26, 26, self.parameters, self.parameters)),
        )
        for start in range(26):
            for one in led_holds(task, SESSION, directions[start]):
                to = int(np.argmax(directions @ one.steps[0].pose.up_b))  # type: ignore[union-attr]  # a hold with its pose
                angle = np.arccos(np.clip(directions[start] @ directions[to], -1.0, 1.0))
                self.seconds[start, to] = max(0.6, QUARTER_TURN * angle / (0.5 * np.pi)) + HOLD
                self.matrices[start, to] = (
                    0.5 * (one.information.matrix + one.information.matrix.T)[at, at] * sizes
                )

    def sigmas(self, order: list[int]) -> tuple[np.ndarray, float]:
        """What a sequence determines, in spreads, and the seconds that it takes."""
        a, b = np.array(order[:-1]), np.array(order[1:])
        whole = self.matrices[a, b].sum(axis=0) + 1e-4 * np.eye(self.parameters)
        return np.sqrt(np.diag(np.linalg.inv(whole))), 3.0 + float(self.seconds[a, b].sum())

    def shortest(self, limits: np.ndarray, at: np.ndarray, rng: np.random.Generator) -> float:
        """Seconds of the shortest sequence that is found by changing one at random (annealing)."""
        order = rng.permutation(26).tolist()

        def cost(tried: list[int]) -> float:
            if any(a == b for a, b in pairwise(tried)):
                return np.inf
            sigmas, seconds = self.sigmas(tried)
            return float(np.log(seconds) + 40.0 * max(0.0, np.log(np.max(sigmas[at] / limits[at]))))

        present, best, steps = cost(order), np.inf, 12_000
        for step in range(steps):
            tried, place, kind = list(order), int(rng.integers(1, len(order))), rng.random()
            if kind < 0.5:
                tried[place] = int(rng.integers(26))
            elif kind < 0.65 and len(tried) > 6:
                del tried[place]
            elif kind < 0.8:
                tried.insert(place, int(rng.integers(26)))
            else:
                low, high = sorted(rng.integers(1, len(tried) + 1, 2))
                tried[low:high] = tried[low:high][::-1]
            now = cost(tried)
            if now < present or rng.random() < np.exp((present - now) / (0.01 * (1.0 - step / steps) + 1e-5)):
                order, present = tried, now
                best = min(best, present) if np.max(self.sigmas(order)[0][at] / limits[at]) <= 1.0 else best
        return float(np.exp(best))

    def bound(self, limits: np.ndarray, at: np.ndarray) -> float:
        """Seconds below which no mixture of moves, in any shares and any order, reaches the limits.

        Of shares of a time T the variances are C/T. For any weights the weighted sum of C is least where the
        equivalence theorem holds, and what is found bounds it from below: phi²/max d (Kiefer).
        """
        known = np.isfinite(self.seconds)
        rates = (self.matrices[known] / self.seconds[known][:, None, None]).reshape(int(known.sum()), -1)
        shares, best = np.full(len(rates), 1.0 / len(rates)), 0.0
        for step in range(1200):
            inverse = np.linalg.inv(
                (shares @ rates).reshape(self.parameters, -1) + 1e-9 * np.eye(self.parameters)
            )
            ratios = np.diag(inverse)[at] / limits[at] ** 2
            weights = np.zeros(self.parameters)
            weights[at] = (ratios / ratios.max()) ** min(1.0 + 0.05 * step, 39.0)
            weights[at] /= weights[at].sum() * limits[at] ** 2
            gains = rates @ (inverse @ (weights[:, None] * inverse)).ravel()
            value = float(weights @ np.diag(inverse))
            best = max(best, value**2 / float(gains.max()))
            shares = shares * np.sqrt(gains / value)
            shares /= shares.sum()
        return 3.0 + best


def plans(name: str) -> None:
    """Print how long the best plan is for what the list of 26 poses determines, and how short any can be."""
    moves = Moves(find_grade(name))
    for case, groups in CASES.items():
        at = np.concatenate([np.arange(30)[GROUPS[g]] for g in groups])
        at = at[at < moves.parameters]
        found: list[tuple[float, float]] = []
        for seed in range(3):
            sigmas, seconds = moves.sigmas(np.random.default_rng([seed, 5]).permutation(26).tolist())
            limits = np.array(sigmas)
            for part in GROUPS.values():
                limits[part] = limits[part].max() if limits[part].size else 0.0
            best = moves.shortest(limits, at, np.random.default_rng(seed))
            found.append((best / seconds, moves.bound(limits, at) / seconds))
        best, least = np.median(found, axis=0)
        print(
            f"{name}, {case}: the best plan takes {100 * best:.0f} % of the list's time, and none takes less than "
            f"{100 * least:.0f} %",
            flush=True,
        )


def pieces_of(person: SimulatedPerson, seconds: float) -> Iterator[Samples]:
    """The samples of some seconds."""
    for piece in person:
        if isinstance(piece, Samples):
            yield piece
            if piece.time[-1] > seconds:
                return


def cost(rate: float, seconds: float = 120.0) -> None:
    """Print the processor time of watching a stream, as a share of a core, without and with the guide."""
    grade = replace(find_grade("consumer-mems"), rate=rate)
    pieces = list(pieces_of(SimulatedPerson(grade, 1, poses=twenty_six_in_order()), seconds))
    for guide in (None, Guide(grade, SITE, HOLD, {"accelerometer bias": 1e-3}, patient=True)):
        capture = Capture(Channels("m/s^2", "rad/s", rate), guide, HOLD)
        begun = time.process_time()
        for piece in pieces:
            capture.feed(piece)
        share = (time.process_time() - begun) / seconds
        which = "with" if guide else "without"
        print(f"{rate:.0f} Hz, {which} the guide: {100 * share:.1f} % of a core", flush=True)


if __name__ == "__main__":
    what, *words = sys.argv[1:] or ["cost"]
    numbers = [int(word) for word in words if word.isdigit()]
    chosen = next((word for word in words if not word.isdigit()), "consumer-mems")
    if what == "persons":
        persons(numbers[0] if numbers else 100, chosen, numbers[1] if len(numbers) > 1 else 20)
    elif what == "plans":
        plans(chosen)
    else:
        for hertz in (200.0, 2000.0):
            cost(hertz)
