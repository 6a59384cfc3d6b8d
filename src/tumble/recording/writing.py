"""Writing beside, then renaming: an earlier file is never lost or half overwritten."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from tumble.errors import OutputError


@contextmanager
def written_beside(path: Path) -> Generator[Path, None, None]:
    """Give a path beside `path` to write to; afterwards it takes the place of `path`.

    Raises
    ------
    OutputError
        If the file cannot be written; what stood at `path` is then intact.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield beside
        beside.replace(path)
    except OSError as error:
        raise OutputError(f"{path} could not be written: {error.strerror or error}.") from error
    finally:
        # On a read-only place even removing what is not there is an error, and not the one to tell.
        with suppress(OSError):
            beside.unlink(missing_ok=True)


@contextmanager
def uninterrupted() -> Generator[None, None, None]:
    """Let a stop (Ctrl-C, a request to end) pass unheard for the moment in which finished files take their places.

    It comes too late to stop anything: heard, it would leave one file of two in place.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, signal.SIG_IGN) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
