"""What is said while work is going on: to whom asks, in a notebook as a bar, else to nobody."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from tumble.border import border
from tumble.counting import Stage, listening

THREADS_OF = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "BLIS_NUM_THREADS")
"""Settings of the user's by which libraries of linear algebra take their number of threads."""

P = ParamSpec("P")
R = TypeVar("R")


def silent(_: str) -> None:
    """Say it to nobody."""


def public(function: Callable[P, R]) -> Callable[P, R]:
    """Return a workflow of the package's front: its arguments are checked, and a notebook shows a bar meanwhile.

    Meanwhile linear algebra works on one thread.

    Parameters
    ----------
    function : which takes ``progress``.
    """
    checked = border(function)

    @wraps(function)
    def shown(*args: P.args, **kwargs: P.kwargs) -> R:
        display = None if kwargs.get("progress") is not None else _display_of_notebook()
        if display is None:
            with one_thread():
                return checked(*args, **kwargs)
        bar = _Bar(display)
        stage = Stage[int](bar.show)
        kwargs["progress"] = stage.begin
        try:
            with one_thread(), listening(stage.at):
                made = checked(*args, **kwargs)
        except BaseException:
            bar.end("stopped after")
            raise
        bar.end("done in")
        return made

    return shown


def one_thread() -> AbstractContextManager[object]:
    """Return a context in which linear algebra works on one thread; a user's own setting stands.

    The matrices are small. With a thread for each core, the threads wait for one another at every product: a call
    takes up to eight times as long where other work is done beside it.
    """
    if any(os.environ.get(name) for name in THREADS_OF):
        return nullcontext()
    import numpy as np  # whose library has to be there to be limited
    from threadpoolctl import threadpool_limits

    assert np.linalg
    return threadpool_limits(1, "blas")


def _display_of_notebook() -> Any:
    """What shows HTML in a notebook; None elsewhere, and nothing is imported for it."""
    shell: Any = sys.modules.get("IPython")
    if shell is None or getattr(shell.get_ipython(), "kernel", None) is None:
        return None
    return shell.display


class _Bar:
    """One bar in a notebook, changed in its place."""

    def __init__(self, display: Any) -> None:
        self._html, self._began = display.HTML, time.monotonic()
        self._shown = display.display(self._drawn("starting", busy=True), display_id=True)

    def show(self, stage: str | int) -> None:
        """Show what is being done, or how many samples are."""
        words = f"{stage:,} samples" if isinstance(stage, int) else stage
        self._shown.update(self._drawn(words, busy=True))

    def end(self, words: str) -> None:
        self._shown.update(self._drawn(words, busy=False))

    def _drawn(self, stage: str, *, busy: bool) -> Any:
        from tumble.files.markup import notebook_progress

        return self._html(notebook_progress(stage, time.monotonic() - self._began, busy=busy))
