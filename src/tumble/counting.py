"""How far work of known size is, and how long it still takes: loops count as they go, and whoever shows it listens."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Generic, TypeVar

T = TypeVar("T")
W = TypeVar("W")

_LISTENER: ContextVar[Callable[[float], None] | None] = ContextVar("listener", default=None)
_OFTEN = 0.2  # s between two words
_TOO_EARLY = 1.0  # s from when on a time left is no guess
_WIDTH = 20  # signs of a bar


def counted(items: Iterable[T], total: float, size: Callable[[T], float] | None = None) -> Iterator[T]:
    """Yield items, and say after each how much is done to whoever listens; loops within the loop say nothing.

    Parameters
    ----------
    items : to be worked on.
    total : sum of their sizes.
    size : returns what an item counts; None for one.
    """
    show = _LISTENER.get()
    if show is None:
        yield from items
        return
    _LISTENER.set(None)
    try:
        done, last = 0.0, 0.0
        show(0.0)
        for item in items:
            yield item
            done += 1.0 if size is None else size(item)
            if time.monotonic() - last > _OFTEN:
                last = time.monotonic()
                show(min(done / max(total, 1e-9), 1.0))
    finally:
        _LISTENER.set(show)


@contextmanager
def listening(show: Callable[[float], None]) -> Generator[None]:
    """Hand what is counted meanwhile to a function, as the share that is done.

    Parameters
    ----------
    show : called with 0 when a loop begins.
    """
    before = _LISTENER.set(show)
    try:
        yield
    finally:
        _LISTENER.reset(before)


class Stage(Generic[W]):
    """What is being done, with a bar of how much of it is done and how long the rest takes.

    Parameters
    ----------
    show : is handed the words.
    """

    def __init__(self, show: Callable[[W | str], None]) -> None:
        self._show, self._words, self._began = show, "", time.monotonic()

    def begin(self, words: W | str) -> None:
        """Say what is being done from now on."""
        self._words = str(words)
        self._show(words)

    def at(self, share: float) -> None:
        """Say how much of it is done."""
        if share <= 0.0:
            self._began = time.monotonic()
            return
        taken = time.monotonic() - self._began
        if taken > _TOO_EARLY:
            left, full = time_words(taken * (1.0 - share) / share), round(_WIDTH * share)
            bar = "━" * full + "╌" * (_WIDTH - full)
            self._show(f"{self._words} {bar} {100.0 * share:.0f} %, {left} left")


def time_words(seconds: float) -> str:
    """Return a time to wait in words.

    Parameters
    ----------
    seconds : s.

    Examples
    --------
    >>> time_words(45.0), time_words(2400.0), time_words(9000.0)
    ('45 s', '40 min', '2.5 h')
    """
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"
