"""Who says what comes next: by information, by the steps of a protocol, or by what the noise still needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any, Protocol

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.capture.live_blocks import LiveBlocks
from tumble.capture.live_holds import LiveHold
from tumble.protocol.steps import Step
from tumble.records import dataclass
from tumble.segmentation.activity import Activity


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
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
