"""How far work of known size is, and how long it still takes: loops count as they go, and whoever shows it listens."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

T = TypeVar("T")

_LISTENER: ContextVar[Callable[[float], None] | None] = ContextVar("listener", default=None)
_STEPPED: ContextVar[Callable[[], None] | None] = ContextVar("stepped", default=None)
_OFTEN = 0.2  # s between two words
_TOO_EARLY = 1.0  # s from when on a time left is no guess
_UNKNOWN = 2.0  # s from when on it is said how long work of unknown size has taken
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
            if done < total and time.monotonic() - last > _OFTEN:
                last = time.monotonic()
                show(done / total)
    finally:
        show(1.0)
        _LISTENER.set(show)


@contextmanager
def part(first: float, last: float) -> Generator[None]:
    """Let what is counted within be a part of what is being done, from one share of it to another.

    Parameters
    ----------
    first, last : shares.
    """
    show = _LISTENER.get()
    if show is None:
        yield
        return
    if first > 0.0:
        show(first)
    with listening(lambda share: show(first + (last - first) * share)):
        yield


@contextmanager
def about(steps: int) -> Generator[None]:
    """Count the steps of work that ends when it is settled, against how many there usually are; see `stepped`.

    Parameters
    ----------
    steps : as many as recordings usually take. How much of work that takes more is done, nobody knows: the share is
        no number from then on, and no time left is said.
    """
    show = _LISTENER.get()
    if show is None:
        yield
        return
    done, last = 0, 0.0

    def one() -> None:
        nonlocal done, last
        done += 1
        if time.monotonic() - last > _OFTEN:
            last = time.monotonic()
            show(done / steps if done < steps else math.nan)

    was = _LISTENER.set(None), _STEPPED.set(one)
    show(0.0)
    try:
        yield
    finally:
        show(1.0)
        _LISTENER.reset(was[0])
        _STEPPED.reset(was[1])


def stepped() -> None:
    """Say that one step of an iteration is done."""
    if (one := _STEPPED.get()) is not None:
        one()


@contextmanager
def listening(show: Callable[[float], None]) -> Generator[None]:
    """Hand what is counted meanwhile to a function, as the share that is done.

    Parameters
    ----------
    show : called with 0 when a loop begins, and with no number (nan) where the share is not known any more.
    """
    before = _LISTENER.set(show)
    try:
        yield
    finally:
        _LISTENER.reset(before)


class Stage:
    """What is being done, with a bar of how much of it is done and how long the rest takes."""

    def __init__(self) -> None:
        self._name = ""
        self._restart()

    def begin(self, words: str) -> None:
        """Say what is being done from now on; a loop that is not at its end goes on."""
        self._name = words
        if not 0.0 < self._share < 1.0:
            self._restart()

    def at(self, share: float) -> None:
        """Say how much of it is done; no number where nobody knows."""
        if share <= 0.0:
            self._restart()
            return
        self._share, self._told = share, time.monotonic()

    def words(self, room: int | None = None) -> str:
        """Return what is being done, with how long the rest takes from now on, or how long it has taken so far.

        Parameters
        ----------
        room : signs that there is room for; a long name is cut for it.
        """
        so_far, taken, how_far = time.monotonic() - self._began, self._told - self._began, ""
        if taken > _TOO_EARLY and self._share < 1.0:
            left = taken / self._share - so_far
            # What takes longer than it seemed has no time left that anybody could state.
            rest = f"{time_words(so_far)} so far" if left < -0.5 else f"{time_words(max(left, 0.0))} left"
            full = round(_WIDTH * self._share)
            bar = "━" * full + "╌" * (_WIDTH - full)
            how_far = f" {bar} {100.0 * self._share:.0f} %, {rest}"
        elif so_far > _UNKNOWN:
            how_far = f", {time_words(so_far)} so far"
        name, most = self._name, None if room is None else max(room - len(how_far), 1)
        return (name if most is None or len(name) <= most else f"{name[: most - 1]}…") + how_far

    def _restart(self) -> None:
        self._began = self._told = time.monotonic()
        self._share = 0.0


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
