"""What a capture says: each event with its time, its facts for programs and its words for people."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any, cast

import numpy as np

from tumble.records import dataclass

# Events at which a bell rings: what a person waits for who looks at the unit.
BELLS = {"hold_accepted": 1, "hold_refused": 2, "hold_complete": 1, "enough": 3}


@dataclass(frozen=True, slots=True)
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
