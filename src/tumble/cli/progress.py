"""What the user sees while work is going on: one line on the terminal's error stream."""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager


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
