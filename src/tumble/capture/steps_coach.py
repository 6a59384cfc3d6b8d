"""Goes through the steps of a protocol with a person: a plate, a table, a chamber, or poses by hand.

A step of rest is done when a hold in its pose was as long as it asks. What stands before a rest, such as a turn of a
table, is said with it. Whether a turn was the one that was asked for, the calibration finds out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tumble.arrays import Series, Vector
from tumble.attitude import angle_between
from tumble.calibration import describe_direction
from tumble.capture.coach import Advice, Progress
from tumble.capture.live_holds import MOST_BLOCKS, LiveBlocks, LiveHold, in_si
from tumble.counting import time_words
from tumble.protocol import HoldStep, Protocol, RampStep, SoakStep, SpinStep, Step, TurnStep
from tumble.segmentation import Activity

# rad between a step's pose and a hold that is taken for it, and the share of its time that is enough.
NEAR, LONG_ENOUGH = np.radians(25.0), 0.9
_Rest = HoldStep | SoakStep | RampStep


class StepsCoach:
    """A protocol and how far it is done.

    Parameters
    ----------
    protocol : its steps in order.
    """

    def __init__(self, protocol: Protocol) -> None:
        self.blocks = MOST_BLOCKS
        self._groups: list[tuple[Step, ...]] = []
        waiting: list[Step] = []
        for step in protocol.steps:
            waiting.append(step)
            if isinstance(step, _Rest):
                self._groups.append(tuple(waiting))
                waiting = []
        self._after = tuple(waiting)
        self._done = 0
        self._said = False
        self._up_b: dict[int, Vector | None] = {}

    @property
    def hold(self) -> float:
        """How long the present step rests, s."""
        return self._groups[self._done][-1].duration if self._done < len(self._groups) else 1.0

    def look_at_clock(self, time: Series) -> None:
        """Take the next stamps; a protocol does not need them."""

    def due(self, time: float) -> bool:
        """Say whether the first step is still to be said."""
        return not self._said

    def judge(self, live: LiveBlocks, holds: Sequence[LiveHold], activity: Activity) -> Progress:
        """Return which step is next.

        Parameters
        ----------
        live : the blocks.
        holds : that count, in order.
        activity : that tells bias and scale where the unit sends counts.
        """
        self._said = True
        self._done, other = 0, ""
        for hold in holds:
            if self._done == len(self._groups):
                break
            rest = self._groups[self._done][-1]
            if hold.duration < LONG_ENOUGH * rest.duration:
                continue
            up_b = self._up_of(hold, live, activity)
            wanted = rest.pose.up_b if isinstance(rest, HoldStep) and rest.pose is not None else None
            if up_b is None or wanted is None or angle_between(up_b, wanted) < NEAR:
                self._done, other = self._done + 1, ""
            else:
                other = f" Hold {hold.number} had {describe_direction(up_b)}."
        count = len(self._groups)
        if self._done == count:
            last = " and then ".join(map(step_phrase, self._after))
            words = "All steps are done." if not last else f"Last: {last}; end the capture afterwards."
            return Progress(enough=not last, words=(words,))
        steps = self._groups[self._done]
        do = ", then ".join(filter(None, map(step_phrase, steps)))
        words = f"Step {self._done + 1} of {count}: {do}.{other}"
        facts = {"step": self._done + 1, "steps": count}
        return Progress(
            advice=Advice(do, words, steps, facts), words=(f"{self._done} of {count} steps are done.",)
        )

    def _up_of(self, hold: LiveHold, live: LiveBlocks, activity: Activity) -> Vector | None:
        """The unit vector up of a hold; None where it is not known."""
        if hold.number not in self._up_b:
            force = in_si(live, activity).specific_force
            size = live.cut.size
            start, stop = -(-hold.hold.start // size) - live.first, hold.hold.stop // size - live.first
            part = None if force is None or start < 0 else force[start:stop]
            mean = None if part is None or not len(part) else part.mean(axis=0)
            norm = 0.0 if mean is None else float(np.linalg.norm(mean))
            self._up_b[hold.number] = None if mean is None or not norm > 0.0 else mean / norm
        return self._up_b[hold.number]


def step_phrase(step: Step) -> str:
    """Return what to do in a step, as a phrase; empty for a turn that only leads to the next pose.

    Parameters
    ----------
    step : of a protocol.
    """
    seconds = time_words(step.duration)
    if isinstance(step, HoldStep):
        pose = "the unit as it lies" if step.pose is None else describe_direction(step.pose.up_b)
        named = f" ({step.name})" if step.name and step.pose is not None else ""
        return f"hold {pose}{named} for {seconds}"
    if isinstance(step, TurnStep):
        if step.axis_b is None or step.angle is None:
            return ""
        return f"turn by {np.degrees(step.angle):.4g}° about {_axis(step.axis_b)}"
    if isinstance(step, SpinStep):
        axis = "the axis that points up" if step.axis_b is None else _axis(step.axis_b)
        named = f" ({step.name})" if step.name else ""
        return f"let the table turn at {np.degrees(step.rate):.6g}°/s about {axis} for {seconds}{named}"
    if isinstance(step, SoakStep):
        return f"let it come to {step.temperature_celsius:g} °C and lie for {seconds}"
    tumbled = f", turned to another pose every {time_words(step.tumbled)}" if step.tumbled else ""
    return f"take the chamber from {step.start_celsius:g} to {step.stop_celsius:g} °C in {seconds}{tumbled}"


def _axis(direction: Vector) -> str:
    return describe_direction(direction).removesuffix(" up")
