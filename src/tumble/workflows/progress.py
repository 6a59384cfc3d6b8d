"""What the workflows of the package's front begin with: one thread, and nobody to tell."""

from __future__ import annotations

import os
from contextlib import AbstractContextManager, nullcontext

THREADS_OF = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "BLIS_NUM_THREADS")
"""Settings of the user's by which libraries of linear algebra take their number of threads."""


def silent(_: object) -> None:
    """Say it to nobody."""


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
