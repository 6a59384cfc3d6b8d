"""The live view of a capture in a terminal of 80 columns."""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Sequence
from types import TracebackType
from typing import TYPE_CHECKING

from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from tumble.capture.events import BELLS, Event
from tumble.capture.targets import SHOWN
from tumble.cli.terminal import plain, table

if TYPE_CHECKING:
    from tumble.capture.machine import Capture

# Hz, signs of a bar, and lines of what was said last.
RATE, BAR, LINES = 10.0, 24, 6
_STYLES = {
    "hold_refused": "red",
    "caution": "yellow",
    "silence": "bold red",
    "enough": "bold green",
    "calibrated": "bold green",
}


class LiveView:
    """Redraws some lines as a capture goes on, and rings.

    Parameters
    ----------
    targets : wished-for standard uncertainties, SI, by group.
    bell : whether to ring.
    """

    def __init__(self, targets: dict[str, float], *, bell: bool) -> None:
        self._targets, self._bell = targets, bell
        self._said: deque[Event] = deque(maxlen=LINES)
        self._next = ""
        self._drawn = 0.0
        self._live = Live(console=Console(), auto_refresh=False, transient=False)

    def __enter__(self) -> LiveView:
        self._live.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._live.__exit__(kind, error, trace)

    def __call__(self, events: Sequence[Event], capture: Capture) -> None:
        """Take what happened; a listener of `run_capture`."""
        for event in events:
            if event.kind == "next_pose":
                self._next = event.words
            elif event.kind != "sigma":
                self._said.append(event)
            if self._bell and event.kind in BELLS:
                sys.stdout.write("\a" * BELLS[event.kind])
        now = time.monotonic()
        if events or now - self._drawn > 1.0 / RATE:
            self._drawn = now
            self._live.update(self.drawn(capture), refresh=True)

    def drawn(self, capture: Capture) -> Group:
        """Return the view of a capture.

        Parameters
        ----------
        capture : that goes on.
        """
        resting, still = capture.search.resting, capture.search.stillness
        parts: list[object] = [
            Text(
                f"{capture.time:7.1f} s   {len(capture.holds)} holds   {capture.channels.rate:.4g} Hz", "bold"
            ),
            _bar(
                "movement",
                min(still, 2.0) / 2.0,
                "still" if still < 1.0 else "moving",
                "green" if still < 1 else "red",
            ),
        ]
        held = 0.0 if resting is None else resting.duration
        words = "turn, then keep still" if resting is None else _held_words(held, capture.hold_seconds)
        parts.append(_bar("this hold", min(held / capture.hold_seconds, 1.0), words, "cyan"))
        parts += [Text(plain(self._next), "bold yellow"), self._table(capture)]
        parts += [Text(f"{e.time:7.1f} s  {plain(e.words)}", _STYLES.get(e.kind, "")) for e in self._said]
        return Group(*parts)  # type: ignore[arg-type]  # rich's own union of what can be drawn

    def _table(self, capture: Capture) -> object:
        """The worst uncertainty of each group of parameters, against its target."""
        from tumble.design.joint_information import GROUPS, NAMES

        rows: list[list[str]] = []
        sigmas = capture.progress.sigmas
        for group, part in GROUPS.items():
            names = [name for name in NAMES[part] if name in sigmas]
            told = [sigma for name in names if (sigma := sigmas[name]) is not None]
            if not names:
                continue
            unit, size = SHOWN[group]
            worst = (
                f"{max(told) / size:.3g} {unit}"
                if len(told) == len(names)
                else f"{len(told)} of {len(names)} determined"
            )
            target = self._targets.get(group)
            reached = target is not None and len(told) == len(names) and max(told) <= target
            wish = "" if target is None else f"{target / size:.3g} {unit}{' reached' if reached else ''}"
            rows.append([group, worst, wish])
        return table(("parameters", "uncertainty", "target"), rows, right=(1, 2), box=None)


def _bar(name: str, share: float, words: str, style: str) -> Text:
    full = round(BAR * max(min(share, 1.0), 0.0))
    return Text.assemble(f"{name:<10}", ("█" * full + "░" * (BAR - full), style), f"  {words}")


def _held_words(held: float, wanted: float) -> str:
    return f"{held:.1f} of {wanted:g} s" if wanted < float("inf") else f"{held:.0f} s"
