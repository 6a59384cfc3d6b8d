"""What the capture has to show and what viewers ask, between the capture's thread and the server's."""

from __future__ import annotations

import json
import struct
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from tumble.capture.events import Event
from tumble.capture.machine import Capture
from tumble.capture.targets import groups_of
from tumble.recording.samples import Samples

# s of samples in one column of the traces; columns and events that are kept for who comes late.
COLUMN, KEPT, MOST_EVENTS = 1.0 / 30.0, 600, 2000
# A column on the wire: its time, then least and greatest of three forces and three rates.
_FRAME = struct.Struct("<d12f")


class Hub:
    """A capture's state for viewers.

    Parameters
    ----------
    targets : wished-for standard uncertainties, SI, by group.
    """

    def __init__(self, targets: dict[str, float]) -> None:
        self._lock = threading.Lock()
        self._targets = targets
        self._columns: deque[bytes] = deque(maxlen=KEPT)
        self._column_count = 0
        self._events: list[str] = []
        self._first_event = 0
        self._state = ""
        self._wishes: list[dict[str, Any]] = []
        self._open: tuple[int, np.ndarray, np.ndarray] | None = None
        self.stop_wanted = False

    def tap(self, samples: Samples) -> None:
        """Take samples for the traces.

        Parameters
        ----------
        samples : as they were recorded.
        """
        nothing = np.full((len(samples), 3), np.nan)
        force = nothing if samples.specific_force is None else samples.specific_force
        rate = nothing if samples.angular_rate is None else samples.angular_rate
        values = np.hstack([force, rate])
        numbers = np.floor(samples.time / COLUMN).astype(np.int64)
        for number in np.unique(numbers).tolist():
            part = values[numbers == number]
            self._put(int(number), part.min(axis=0), part.max(axis=0))

    def _put(self, number: int, low: np.ndarray, high: np.ndarray) -> None:
        if self._open is not None and self._open[0] == number:
            self._open = number, np.minimum(low, self._open[1]), np.maximum(high, self._open[2])
            return
        if self._open is not None:
            at, least, greatest = self._open
            frame = _FRAME.pack(at * COLUMN, *np.column_stack([least, greatest]).ravel().tolist())
            with self._lock:
                self._columns.append(frame)
                self._column_count += 1
        self._open = number, low, high

    def __call__(self, events: Sequence[Event], capture: Capture) -> None:
        """Take what happened; a listener of `run_capture`."""
        for wish in self._taken():
            if wish.get("do") == "drop" and isinstance(wish.get("hold"), int):
                capture.drop(wish["hold"])
        state = json.dumps(_state_of(capture, self._targets), allow_nan=False)
        lines = [event.to_json() for event in events]
        with self._lock:
            self._state = state
            self._events += lines
            if len(self._events) > MOST_EVENTS:
                self._first_event += len(self._events) - MOST_EVENTS
                del self._events[:-MOST_EVENTS]

    def _taken(self) -> list[dict[str, Any]]:
        with self._lock:
            wishes, self._wishes = self._wishes, []
        return wishes

    def wish(self, wish: dict[str, Any]) -> None:
        """Take what the leading viewer asks: to drop a hold, or to stop.

        Parameters
        ----------
        wish : ``{"do": "drop", "hold": 3}`` or ``{"do": "stop"}``; anything else is passed over.
        """
        if wish.get("do") == "stop":
            self.stop_wanted = True
        elif wish.get("do") == "drop":
            with self._lock:
                self._wishes = [*self._wishes[-50:], wish]

    def columns_since(self, number: int) -> tuple[int, bytes]:
        """Return the columns that came after a number of them, and the number now.

        Parameters
        ----------
        number : of columns that a viewer has.
        """
        with self._lock:
            new = min(self._column_count - number, len(self._columns))
            content = b"".join(list(self._columns)[len(self._columns) - new :]) if new > 0 else b""
            return self._column_count, content

    def events_since(self, number: int) -> tuple[int, list[str]]:
        """Return the events, as JSON, that came after a number of them, and the number now.

        Parameters
        ----------
        number : of events that a viewer has.
        """
        with self._lock:
            total = self._first_event + len(self._events)
            return total, self._events[max(number - self._first_event, 0) :]

    @property
    def state(self) -> str:
        """The present state as JSON; nothing before the first samples."""
        with self._lock:
            return self._state


def _state_of(capture: Capture, targets: dict[str, float]) -> dict[str, Any]:
    resting = capture.search.resting
    up_b = capture.direction
    stillness = capture.search.stillness
    return {
        "time": round(capture.time, 2),
        "rate": capture.channels.rate,
        "units": [capture.channels.specific_force_unit, capture.channels.angular_rate_unit],
        "stillness": round(min(stillness, 99.0), 3) if np.isfinite(stillness) else None,
        "up": None if up_b is None else [round(float(v), 4) for v in up_b],
        "resting": None
        if resting is None
        else {"hold": resting.number, "seconds": round(resting.duration, 2)},
        # A unit at rest for its noise has no hold that is long enough.
        "hold_seconds": capture.hold_seconds if np.isfinite(capture.hold_seconds) else None,
        "holds": [
            {
                "hold": told.hold.number,
                "seconds": round(told.hold.duration, 1),
                "pose": told.pose,
                "note": told.note,
                "up": None if told.up_b is None else [round(float(v), 4) for v in told.up_b],
            }
            for told in capture.holds
        ],
        "groups": [asdict(row) for row in groups_of(capture.progress.sigmas, targets)],
    }
