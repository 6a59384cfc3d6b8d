"""Bytes that come in over a line, a port or a socket: opened again when they are lost, decoded as they come."""

from __future__ import annotations

import importlib
import pkgutil
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from typing import Protocol

from tumble.capture.source import Notice, Piece, SourceOptions
from tumble.errors import UsageError
from tumble.records import dataclass

# s between attempts to open a lost line again, and of a read.
AGAIN, READ = 0.5, 0.1
# Bytes, and s, after which it is decided what a line sends.
ENOUGH_TO_TELL, LONG_ENOUGH = 2048, 1.0
# Of the frames or lines, as many may be damaged before it is said.
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
    """Makes samples of bytes. Garbage and half frames are counted and passed over, never raised.

    Attributes
    ----------
    good, damaged : how many frames or lines there were.
    """

    good: int
    damaged: int

    def feed(self, data: bytes, arrived: float) -> list[Piece]:
        """Take bytes that arrived at a time (s on the host's clock), and return what is complete."""
        ...

    def end(self) -> list[Piece]:
        """Return what is left when nothing follows."""
        ...


@dataclass(frozen=True, slots=True)
class Format:
    """A format that decoders are made for.

    Attributes
    ----------
    name, title : as asked for with ``--format``, and in words.
    recognises : whether some first bytes are of it.
    decoder : makes one, from the options and the name of the stream.
    """

    name: str
    title: str
    recognises: Callable[[bytes], bool]
    decoder: Callable[[SourceOptions, str], Decoder]


@cache
def formats() -> dict[str, Format]:
    """Return the formats by name: a file of `capture.decoders` each; plain text comes last, when none recognises it."""
    import tumble.capture.decoders as room

    modules = [
        importlib.import_module(f"{room.__name__}.{m.name}") for m in pkgutil.iter_modules(room.__path__)
    ]
    records: list[Format] = [module.FORMAT for module in modules if hasattr(module, "FORMAT")]
    return {one.name: one for one in sorted(records, key=lambda one: (one.name == "text", one.name))}


def find_format(name: str) -> Format:
    """Return the format of a name.

    Parameters
    ----------
    name : of `formats`.

    Raises
    ------
    UsageError
        If there is none.
    """
    found = formats().get(name)
    if found is None:
        listed = ", ".join(f"{one.name} ({one.title})" for one in formats().values())
        raise UsageError(f"--format {name}: known are {listed}.")
    return found


def pieces_of_link(
    connect: Callable[[], Link], name: str, options: SourceOptions, spoken: str | None = None
) -> Iterator[Piece]:
    """Yield what a line sends; a line that is lost is told, and opened again when it is back.

    Parameters
    ----------
    connect : opens the line.
    name : of the stream, for messages.
    options : as given; without a format it is found from the first bytes.
    spoken : the only format that the line speaks, whatever the options say.

    Raises
    ------
    UsageError
        If the line cannot be opened at the start, or the format is unknown.
    RecordingError
        If the stream cannot be a recording, such as one whose header contradicts gravity.
    """
    wanted = spoken or options.format
    chosen = None if wanted is None else find_format(wanted)
    link: Link | None = connect()
    stream = _Stream(options, name, chosen)
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

    def __init__(self, options: SourceOptions, name: str, chosen: Format | None) -> None:
        self._options, self._name, self._format = options, name, chosen
        self._head = b""
        self._begun = time.monotonic()
        self._decoder: Decoder | None = None
        self._said = False

    def take(self, data: bytes) -> list[Piece]:
        """Return what is complete."""
        now = time.monotonic()
        if self._decoder is None:
            self._head += data
            found = self._format or _recognised(self._head)
            late = len(self._head) > ENOUGH_TO_TELL or now - self._begun > LONG_ENOUGH
            if found is None and not late:
                return [None]
            self._decoder = (found or formats()["text"]).decoder(self._options, self._name)
            data, self._head = self._head, b""
        pieces = self._decoder.feed(data, now)
        damaged, total = self._decoder.damaged, self._decoder.damaged + self._decoder.good
        if not self._said and total >= 50 and damaged > DAMAGED * total:
            self._said = True
            words = (
                f"{damaged} of {total} lines or frames cannot be read: see to baud rate, cable or --format."
            )
            pieces.append(Notice("caution", words))
        return pieces or [None]

    def end(self) -> list[Piece]:
        """Return what is left."""
        if self._decoder is None and self._head:
            self._decoder = (_recognised(self._head) or formats()["text"]).decoder(self._options, self._name)
            return self._decoder.feed(self._head, time.monotonic()) + self._decoder.end()
        return [] if self._decoder is None else self._decoder.end()


def _recognised(head: bytes) -> Format | None:
    return next((one for one in formats().values() if one.name != "text" and one.recognises(head)), None)
