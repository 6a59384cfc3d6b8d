"""A file that only grows, line by line, and keeps every whole line whatever happens to the program or the disk."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from tumble.errors import OutputError, UsageError
from tumble.files.writing import check_target

# A line is never longer than this; the end of a file that was cut off is looked for so far back.
_LONGEST_LINE = 1 << 20


class GrowingFile:
    """A text file that is appended to; one program at a time.

    Parameters
    ----------
    path : made, in a folder that is there; with `resume` it may be there, and half a last line is cut off.
    resume : go on with what is there.

    Raises
    ------
    UsageError
        If it is no place for a result, is there already without `resume`, or another program appends to it.
    OutputError
        If it cannot be made.
    """

    def __init__(self, path: Path, *, resume: bool = False) -> None:
        check_target(path)
        self.path = path
        flags = os.O_RDWR | os.O_APPEND | os.O_CREAT | (0 if resume else os.O_EXCL)
        try:
            self._handle = os.open(path, flags | getattr(os, "O_BINARY", 0), 0o644)
        except FileExistsError:
            raise UsageError(
                f"{path} is there already, and is not written over: go on with it (--resume), or give another folder."
            ) from None
        except OSError as error:
            raise OutputError(f"{path} could not be written: {error.strerror or error}.") from error
        self._pending: list[bytes] = []
        self._lock()
        self._size = self._whole_lines()

    @property
    def size(self) -> int:
        """Bytes that are in the file, without those that wait."""
        return self._size

    def append(self, lines: bytes) -> None:
        """Keep whole lines until the next `flush`.

        Parameters
        ----------
        lines : each with its end.
        """
        self._pending.append(lines)

    def flush(self, *, durable: bool = False) -> None:
        """Write what waits.

        Parameters
        ----------
        durable : down to the disk, so that even a power cut loses nothing of it.

        Raises
        ------
        OutputError
            If it cannot be written; all lines before are whole.
        """
        content = b"".join(self._pending)
        self._pending.clear()
        try:
            rest = memoryview(content)
            while rest:
                rest = rest[os.write(self._handle, rest) :]
            self._size += len(content)
            if durable:
                os.fsync(self._handle)
        except OSError as error:
            with suppress(OSError):
                os.ftruncate(self._handle, self._size)
                self._size = self._whole_lines()
            raise OutputError(
                f"{self.path} could not be written on: {error.strerror or error}; all before that is kept."
            ) from error

    def close(self) -> None:
        """Write what waits, down to the disk, and let go of the file.

        Raises
        ------
        OutputError
            If it cannot be written; all lines before are whole.
        """
        try:
            self.flush(durable=True)
        finally:
            os.close(self._handle)

    def _lock(self) -> None:
        """Let no other program append; where a system knows no such lock nothing is refused."""
        try:
            import fcntl
        except ImportError:
            return
        try:
            fcntl.flock(self._handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(self._handle)
            raise UsageError(f"{self.path} is being written by another tumble: end that one first.") from None
        except OSError:
            return

    def _whole_lines(self) -> int:
        """Cut off a last line without its end, and return the size."""
        size = os.fstat(self._handle).st_size
        if size == 0:
            return 0
        start = max(size - _LONGEST_LINE, 0)
        with os.fdopen(os.dup(self._handle), "rb") as reader:
            reader.seek(start)
            tail = reader.read()
        whole = start + tail.rfind(b"\n") + 1
        if whole < size:
            os.ftruncate(self._handle, whole)
        return whole
