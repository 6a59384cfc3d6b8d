"""What the user sees while work is going on, and the moment from which it cannot be stopped."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager

state = {"results stand": False}
"""Whether files of this call are already in their places."""


@contextmanager
def progress(quiet: bool) -> Generator[Callable[[str], None], None, None]:
    """Give a function that shows a stage in words; silent where nobody looks."""
    if quiet or not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console

    console = Console(stderr=True)
    with console.status("starting") as status:
        yield lambda stage: status.update(stage)


def results_stand() -> None:
    """Ignore Ctrl-C from here on: the files are in their places, and only words about them are left."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    state["results stand"] = True
