"""Opening what a user names: ordinary files only, texts and documents of a bounded size."""

from __future__ import annotations

import errno
import os
import stat
from io import BufferedReader
from pathlib import Path

LARGEST_TEXT = 64 << 20
"""Bytes of a text that is read whole and is no recording, such as a list of intervals or a GNSS track."""

_KINDS = (
    (stat.S_ISFIFO, "a pipe, whose bytes can be read only once: write them to a file and give that"),
    (stat.S_ISSOCK, "a socket: write what it sends to a file and give that"),
    (stat.S_ISCHR, "a device or a terminal: give an ordinary file"),
    (stat.S_ISBLK, "a disk: give an ordinary file"),
    (stat.S_ISDIR, "a folder: name the file in it"),
)


def size_of(path: Path) -> int:
    """Return the size in bytes of an ordinary file.

    Raises
    ------
    OSError
        If it is not there, or is a pipe, a socket, a device or a folder; `strerror` says which and what to do.
    """
    found = path.stat()
    if not stat.S_ISREG(found.st_mode):
        words = next((text for is_kind, text in _KINDS if is_kind(found.st_mode)), "no ordinary file")
        raise OSError(errno.EINVAL, f"it is {words}", os.fspath(path))
    return found.st_size


def opened(path: Path) -> BufferedReader:
    """Open an ordinary file for its bytes.

    Raises
    ------
    OSError
        If it cannot be opened, or is no ordinary file.
    """
    size_of(path)
    return path.open("rb")


def read_text(path: Path, largest: int = LARGEST_TEXT, *, errors: str = "strict") -> str:
    """Return the text of a file in UTF-8, with or without its mark.

    Parameters
    ----------
    path : of the file.
    largest : bytes that such a file may have.
    errors : what to do with bytes that are no UTF-8: ``strict`` or ``replace``.

    Raises
    ------
    OSError
        If it cannot be opened, is no ordinary file, or is longer.
    UnicodeDecodeError
        If it is no UTF-8, and `errors` is ``strict``.
    """
    with opened(path) as file:
        content = file.read(largest + 1)
    if len(content) > largest:
        raise OSError(
            errno.EFBIG, f"it is longer than {_in_words(largest)}, which no such file is", os.fspath(path)
        )
    return content.decode("utf-8-sig", errors)


def _in_words(octets: int) -> str:
    return f"{octets >> 20} MB" if octets >= 1 << 20 else f"{octets >> 10} kB"
