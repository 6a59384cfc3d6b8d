"""What the guide is worth: simulated persons with it, and with a fixed list of 26 poses; and what watching costs.

    python benchmarks/capture.py [RUNS]

For each unit the list of 26 poses is gone through first. The worst uncertainty that it ends with in each group of
parameters is then the target of a person who follows the guide with the same unit.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from tumble.capture.events import Event
from tumble.capture.guide import Guide
from tumble.capture.machine import Capture
from tumble.capture.samples import Channels, Samples
from tumble.capture.simulated_person import Flaws, SimulatedPerson, twenty_six_in_order
from tumble.design.joint_information import GROUPS, NAMES
from tumble.earth import Site
from tumble.simulation.grades import find_grade

SITE = Site.from_gravity(9.80665)


def watched(
    person: SimulatedPerson, grade: str, targets: dict[str, float], longest: float
) -> tuple[Capture, list[Event], float]:
    """Capture until it is enough or the person has done, and return how long that took on the unit's clock."""
    guide = Guide(find_grade(grade), SITE, 3.0, targets, patient=True)
    capture: Capture | None = None
    said: list[Event] = []
    for piece in person:
        if isinstance(piece, Channels):
            capture = Capture(piece, guide, 3.0)
        elif isinstance(piece, Samples) and capture is not None:
            events = capture.feed(piece)
            said += events
            person(events, capture)
            if capture.time > longest or (targets and any(e.kind == "enough" for e in events)):
                break
    assert capture is not None
    said += capture.finish()
    return capture, said, capture.time


def worst(capture: Capture) -> dict[str, float]:
    """The largest sigma of each group."""
    sigmas = capture.progress.sigmas
    found: dict[str, float] = {}
    for group, part in GROUPS.items():
        values = [sigmas.get(name) for name in NAMES[part]]
        told = [value for value in values if value is not None]
        if values and len(told) == len(values):
            found[group] = max(told)
    return found


def compare(grade: str, runs: int) -> None:
    """Print what the guide is worth with units of a grade."""
    shares: list[float] = []
    reached = holds = 0
    for seed in range(runs):
        order = np.random.default_rng([seed, 5]).permutation(26)
        listed = SimulatedPerson(find_grade(grade), seed, poses=twenty_six_in_order()[order])
        fixed, _, fixed_time = watched(listed, grade, {}, 1e9)
        targets = {group: 1.02 * sigma for group, sigma in worst(fixed).items()}
        guided_person = SimulatedPerson(find_grade(grade), seed, flaws=Flaws(too_short=0.05, creeping=0.05))
        guided, said, guided_time = watched(guided_person, grade, targets, 3.0 * fixed_time)
        enough = worst(guided)
        met = all(enough.get(group, np.inf) <= target for group, target in targets.items())
        reached += met
        holds += len(guided.holds)
        shares.append(guided_time / fixed_time)
        refused = sum(event.kind == "hold_refused" for event in said)
        print(
            f"  unit {seed}: list {fixed_time:.0f} s, {len(fixed.holds)} holds; guide {guided_time:.0f} s, "
            f"{len(guided.holds)} holds, {refused} refused, {'reached' if met else 'not reached'}",
            flush=True,
        )
    print(
        f"{grade}: {reached} of {runs} reach the list's uncertainties; median time {100 * np.median(shares):.0f} % "
        f"of the list's (from {100 * min(shares):.0f} to {100 * max(shares):.0f} %), {holds / runs:.0f} holds for 26"
    )


def cost(rate: float, seconds: float = 120.0) -> None:
    """Print the processor time of watching a stream, as a share of a core, without and with the guide."""
    from dataclasses import replace

    grade = replace(find_grade("consumer-mems"), rate=rate)
    person = SimulatedPerson(grade, 1, poses=twenty_six_in_order())
    pieces: list[Samples] = []
    for piece in person:
        if isinstance(piece, Samples):
            pieces.append(piece)
            if piece.time[-1] > seconds:
                break
    for guide in (None, Guide(grade, SITE, 3.0, {}, patient=True)):
        capture = Capture(Channels("m/s^2", "rad/s", rate), guide, 3.0)
        begun = time.process_time()
        for piece in pieces:
            capture.feed(piece)
        share = (time.process_time() - begun) / seconds
        print(
            f"{rate:.0f} Hz, {'with' if guide else 'without'} the guide: {100 * share:.1f} % of a core",
            flush=True,
        )


if __name__ == "__main__":
    for hertz in (200.0, 2000.0):
        cost(hertz)
    compare("consumer-mems", int(sys.argv[1]) if len(sys.argv) > 1 else 10)
