"""Who says what comes next (information, steps or what noise still needs), and what a capture says, as events."""

from __future__ import annotations

import json
import math
import typing
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import field
from typing import Any, cast

import numpy as np

from tumble.arrays import Series, Vector, Vectors
from tumble.attitude import angle_between
from tumble.calibration import describe_direction
from tumble.capture.live_holds import MOST_BLOCKS, LiveBlocks, LiveHold, in_si
from tumble.counting import time_words
from tumble.errors import RecordingError, UsageError
from tumble.noise import Channel, characterise, seconds_needed
from tumble.protocol import HoldStep, Protocol, RampStep, SoakStep, SpinStep, Step, TurnStep
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.segmentation import Activity


@dataclass(frozen=True)
class Advice:
    """What a person is to do next.

    Attributes
    ----------
    do : as a phrase: "hold +z up for 3 s".
    words : a sentence with it.
    steps : the same as steps of a protocol, for those who draw them.
    facts : more for programs, SI.
    """

    do: str
    words: str
    steps: tuple[Step, ...] = ()
    facts: Mapping[str, Any] = field(default_factory=dict[str, Any])


@dataclass(frozen=True)
class Progress:
    """What is known by now.

    Attributes
    ----------
    sigmas : standard uncertainty by parameter, SI; None where nothing is told yet.
    up_b : (holds, 3) unit vectors up of the holds, for those who draw.
    advice : what to do next; None where that is not known yet.
    enough : whether to stop.
    words : why, or why not yet.
    """

    sigmas: dict[str, float | None] = field(default_factory=dict[str, float | None])
    up_b: Vectors = field(default_factory=lambda: np.zeros((0, 3)))
    advice: Advice | None = None
    enough: bool = False
    words: tuple[str, ...] = ()


class Coach(typing.Protocol):
    """Judges what there is and says what is next.

    Attributes
    ----------
    blocks : how many blocks of samples it wants kept.
    """

    blocks: int

    @property
    def hold(self) -> float:
        """How long the present pose is to be held, s."""
        ...

    def look_at_clock(self, time: Series) -> None:
        """Take the next stamps."""
        ...

    def due(self, time: float) -> bool:
        """Say whether it has something to say at a time, s, without a new hold."""
        ...

    def judge(self, live: LiveBlocks, holds: Sequence[LiveHold], activity: Activity) -> Progress:
        """Return what is known and what is next."""
        ...


# Events at which a bell rings: what a person waits for who looks at the unit.
BELLS = {"hold_accepted": 1, "hold_refused": 2, "hold_complete": 1, "enough": 3}


@dataclass(frozen=True)
class Event:
    """One thing that happened.

    Attributes
    ----------
    kind : ``started``, ``remark``, ``caution``, ``hold_accepted``, ``hold_complete``, ``hold_closed``,
        ``hold_refused``, ``hold_dropped``, ``sigma``, ``next_pose``, ``enough``, ``silence``, ``back``,
        ``clock_jumped``, ``resumed``, ``ended``, ``calibrated``, ``not_calibrated`` or
        ``characterised``.
    time : s on the recording's clock.
    words : one or two sentences.
    facts : for programs, SI.
    """

    kind: str
    time: float
    words: str
    facts: Mapping[str, Any] = field(default_factory=dict[str, Any])

    def to_json(self) -> str:
        """Return the event as one line of JSON, without its end."""
        line = {"t": round(self.time, 4), "event": self.kind, **self.facts, "words": self.words}
        return json.dumps(_plain(line), ensure_ascii=False, allow_nan=False)


def _plain(value: Any) -> Any:
    """Values that JSON has: numbers of numpy as Python's, what is no number as null."""
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in cast("Mapping[Any, Any]", value).items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in cast("Sequence[Any]", value)]
    if isinstance(value, float):
        return float(f"{value:.6g}") if math.isfinite(value) else None
    return value


# s of rest before the first judgement, and the growth of the recording until the next.
FIRST, GROWTH = 120.0, 0.15
# Hours of blocks that are kept: 5 MB each.
HOURS = 12


class RestCoach:
    """What the noise so far shows, found anew as the recording grows, beside the samples that come in.

    Parameters
    ----------
    patient : wait for what is computed; for recordings that are replayed.
    """

    def __init__(self, *, patient: bool = False) -> None:
        self.blocks = HOURS * MOST_BLOCKS
        self._patient = patient
        self._begun: float | None = None
        self._next = FIRST
        self._found: Future[tuple[bool, str]] | None = None
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="noise")

    @property
    def hold(self) -> float:
        """No hold is long enough: the unit is not to be touched."""
        return float("inf")

    def look_at_clock(self, time: Series) -> None:
        """Take the next stamps."""
        if self._begun is None:
            self._begun = float(time[0])

    def due(self, time: float) -> bool:
        """Say whether the recording has grown enough, or what was computed of it is there."""
        if self._found is not None:
            return self._patient or self._found.done()
        return self._begun is not None and time - self._begun >= self._next

    def judge(self, live: LiveBlocks, holds: Sequence[LiveHold], activity: Activity) -> Progress:
        """Return what is known of the noise.

        Parameters
        ----------
        live : the blocks.
        holds, activity : not needed: what rests is found by the characterisation.
        """
        if self._found is None:
            recording = live.averaged()
            if recording.duration < FIRST:
                return Progress(words=("Leave the unit alone: nothing is known of its noise yet.",))
            self._next = recording.duration * (1.0 + GROWTH)
            self._found = self._pool.submit(_judged, recording)
            if not self._patient:
                return Progress(words=("Computing what the noise still needs.",))
        enough, words = self._found.result()
        self._found = None
        advice = None if enough else Advice("leave the unit alone", words)
        return Progress(advice=advice, enough=enough, words=(words,))


def _judged(recording: Recording) -> tuple[bool, str]:
    """Whether N, B and K of all channels are known to 10 %, and what each triad still needs."""
    try:
        channels = characterise(recording, taus="octave").channels
    except (RecordingError, UsageError) as error:
        return False, str(error)
    forces, gyros = ([c for c in channels if c.is_gyro == gyro] for gyro in (False, True))
    triads = (("Accelerometers", forces), ("Gyros", gyros))
    said = [_needs(name, of, recording.duration) for name, of in triads if of]
    return all(enough for enough, _ in said), " ".join(words for _, words in said)


def _needs(name: str, channels: list[Channel], seconds: float) -> tuple[bool, str]:
    fits = [channel.fit for channel in channels if channel.fit is not None]
    if not fits:
        return False, f"{name}: no model of the noise yet."
    known, parts = list[str](), list[str]()
    for letter in "NBK":
        needed = max(seconds_needed(fit, letter) for fit in fits)
        left = needed - seconds
        if left <= 0.0:
            known.append(letter)
        elif np.isfinite(needed):
            least = "" if all(letter in fit.chosen for fit in fits) else "at least "
            parts.append(f"{letter} needs {least}{time_words(left)} more")
        else:
            parts.append(f"{letter} is not seen")
    head = [f"{' and '.join(known)} known to 10 %"] if known else []
    return not parts, f"{name}: {', '.join(head + parts)}."


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
