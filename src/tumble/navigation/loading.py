"""Loading of compiled code: what numba makes as it starts is no garbage, and is not searched for any."""

from __future__ import annotations

import gc
from collections.abc import Generator
from contextlib import contextmanager


@contextmanager
def collector_paused() -> Generator[None, None, None]:
    """Pause the garbage collector where it runs.

    numba makes half a million objects as it starts: looking through them again and again takes a fifth of that time.
    """
    running = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if running:
            gc.enable()


__all__ = ["collector_paused"]
