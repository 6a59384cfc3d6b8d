"""Opening what a user names: ordinary files only, texts and documents of a bounded size."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Generator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path

from tumble.errors import TumbleError, UsageError

LARGEST_TEXT = 64 << 20
"""Bytes of a text that is read whole and is no recording, such as a list of intervals or a GNSS track."""

_KINDS = (
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device or a terminal"),
    (stat.S_ISBLK, "a disk"),
    (stat.S_ISDIR, "a folder"),
)


def kind_of(found: os.stat_result) -> str:
    """Return what something is that is no ordinary file, nothing for one."""
    return next((words for is_kind, words in _KINDS if is_kind(found.st_mode)), "")


def size_of(path: Path) -> int:
    """Return the size in bytes of an ordinary file.

    Raises
    ------
    OSError
        If it is not there, or is a pipe, a socket, a device or a folder; `strerror` says which and what to do.
    """
    found = path.stat()
    if kind := kind_of(found):
        raise OSError(errno.EINVAL, f"it is {kind}: give an ordinary file", os.fspath(path))
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


@contextmanager
def reading(path: Path, what: str, error: type[TumbleError] = UsageError, hint: str = "") -> Generator[None]:
    """Open and read a file that a user named: whatever is wrong with it is one sentence.

    Parameters
    ----------
    path : of the file.
    what : it should be, with its article.
    error : that the sentence is raised as.
    hint : where such a file comes from, if it is not there.

    Raises
    ------
    TumbleError
        Where an OSError, or a ValueError whose words end a sentence, comes from within.
    """
    try:
        yield
    except FileNotFoundError:
        there = f"There is no {what.removeprefix('a ').removeprefix('an ')} {path}"
        raise error(f"{there}: {hint}." if hint else f"{there}.") from None
    except UnicodeDecodeError as problem:
        raise error(
            f"{path} cannot be read as {what}: it is no text in UTF-8 (byte {problem.start + 1})."
        ) from None
    except OSError as problem:
        raise error(f"{path} cannot be read as {what}: {problem.strerror or problem}.") from problem
    except ValueError as problem:
        raise error(f"{path} cannot be read as {what}: {problem}.") from problem


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
