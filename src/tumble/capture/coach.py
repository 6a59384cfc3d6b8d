"""Who says what comes next (information, steps or what noise still needs), and what a capture says, as events."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any, Protocol, cast

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.capture.live_holds import LiveBlocks, LiveHold
from tumble.protocol import Step
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


class Coach(Protocol):
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
