"""Standard input, and a file that another program writes while we read."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from select import select

from tumble.capture.link import pieces_of_link
from tumble.capture.source import Piece, Source, SourceOptions
from tumble.errors import UsageError

_MOST = 1 << 16


class _Input:
    """Standard input."""

    def read(self, seconds: float) -> bytes | None:
        """Return what came; None at its end."""
        handle = sys.stdin.fileno()
        if not select([handle], [], [], seconds)[0]:
            return b""
        return os.read(handle, _MOST) or None

    def close(self) -> None:
        """Leave it: it belongs to the caller."""


class _Growing:
    """A file that grows; one that becomes shorter was begun anew."""

    def __init__(self, path: Path) -> None:
        try:
            self._file = path.open("rb")
        except OSError as error:
            raise UsageError(f"{path} cannot be read: {error.strerror or error}.") from error
        self._path = path

    def read(self, seconds: float) -> bytes:
        """Return what was added."""
        data = self._file.read(_MOST)
        if data:
            return data
        if self._path.stat().st_size < self._file.tell():
            raise OSError("the file was begun anew")
        time.sleep(seconds)
        return b""

    def close(self) -> None:
        """Let go of it."""
        self._file.close()


def _read_input(address: str, options: SourceOptions) -> Iterator[Piece]:
    """Yield what comes on standard input, up to its end."""
    return pieces_of_link(_Input, "standard input", options)


def follow(address: str, options: SourceOptions) -> Iterator[Piece]:
    """Yield what is in a file and what is added to it.

    Parameters
    ----------
    address : of the file.
    options : as given.

    Raises
    ------
    UsageError
        If it cannot be read.
    RecordingError
        If what is in it can be no recording.
    """
    path = Path(address)
    return pieces_of_link(lambda: _Growing(path), path.name, options)


SOURCES = (
    Source("stdin", "standard input (or -)", "-", _read_input),
    Source("follow", "a file that grows", "follow:FILE", follow),
)
