"""Bytes that come in over a line, a port or a socket: opened again when they are lost, decoded as they come."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Protocol, TypeAlias

from tumble.capture.apart import SensorLines, is_of_sensors
from tumble.capture.source import Notice, Piece, Source, SourceOptions
from tumble.capture.text_lines import TextLines
from tumble.errors import UsageError

# s between attempts to open a lost line again, and of a read.
AGAIN, READ = 0.5, 0.1
# Bytes, and s, after which it is decided what a line sends.
ENOUGH_TO_TELL, LONG_ENOUGH = 2048, 1.0
# Of the lines, as many may be damaged before it is said.
DAMAGED = 0.05


class Link(Protocol):
    """An open line."""

    def read(self, seconds: float) -> bytes | None:
        """Return what came, nothing after some seconds, or None at the end for good; an OSError where it is lost."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


class Decoder(Protocol):
    """Makes samples of bytes. Garbage and half lines are counted and passed over, never raised.

    Attributes
    ----------
    good, damaged : how many lines there were.
    """

    good: int
    damaged: int

    def feed(self, data: bytes, arrived: float) -> list[Piece]:
        """Take bytes that arrived at a time (s on the host's clock), and return what is complete."""
        ...

    def end(self) -> list[Piece]:
        """Return what is left when nothing follows."""
        ...


Line: TypeAlias = tuple[Callable[[], Link], str]
"""How a line is opened, and what it is called in messages."""


def source_of_lines(name: str, title: str, example: str, find: Callable[[str], Line]) -> Source:
    """Return a source that sends lines of text or of JSON.

    Parameters
    ----------
    name, title, example : as of every source.
    find : from what stands behind the colon to the line; it may refuse an address.
    """
    return Source(name, title, example, lambda address, options: _pieces(*find(address), options))


def _pieces(connect: Callable[[], Link], name: str, options: SourceOptions) -> Iterator[Piece]:
    """Yield what a line sends; a line that is lost is told, and opened again when it is back."""
    link: Link | None = connect()
    stream = _Stream(options, name)
    try:
        while True:
            if link is None:
                yield None
                time.sleep(AGAIN)
                with suppress(OSError, UsageError):
                    link = connect()
                    yield Notice("remark", f"{name} is open again.")
                continue
            try:
                data = link.read(READ)
            except OSError:
                with suppress(OSError):
                    link.close()
                link = None
                yield Notice("silence", f"{name} is gone: see to the cable. It goes on when it is back.")
                continue
            if data is None:
                yield from stream.end()
                return
            yield from stream.take(data) if data else [None]
    finally:
        if link is not None:
            link.close()


class _Stream:
    """Bytes until it is known what they are, then a decoder."""

    def __init__(self, options: SourceOptions, name: str) -> None:
        self._options, self._name = options, name
        self._head = b""
        self._begun = time.monotonic()
        self._decoder: Decoder | None = None
        self._said = False

    def take(self, data: bytes) -> list[Piece]:
        """Return what is complete."""
        now = time.monotonic()
        if self._decoder is None:
            self._head += data
            late = len(self._head) > ENOUGH_TO_TELL or now - self._begun > LONG_ENOUGH
            if not late and not is_of_sensors(self._head):
                return [None]
            self._decoder = self._found()
            data, self._head = self._head, b""
        pieces = self._decoder.feed(data, now)
        damaged, total = self._decoder.damaged, self._decoder.damaged + self._decoder.good
        if not self._said and total >= 50 and damaged > DAMAGED * total:
            self._said = True
            words = f"{damaged} of {total} lines cannot be read: see to baud rate and cable."
            pieces.append(Notice("caution", words))
        return pieces or [None]

    def end(self) -> list[Piece]:
        """Return what is left."""
        if self._decoder is None and self._head:
            self._decoder = self._found()
            return self._decoder.feed(self._head, time.monotonic()) + self._decoder.end()
        return [] if self._decoder is None else self._decoder.end()

    def _found(self) -> Decoder:
        kind = SensorLines if is_of_sensors(self._head) else TextLines
        return kind(self._options, self._name)
