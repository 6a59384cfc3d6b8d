"""Linear algebra works on one thread inside a call, and on as many as before after it."""

import threading
from collections.abc import Iterator

import numpy as np
import pytest
import threadpoolctl

from tumble.workflows.request import THREADS_OF, StreamRequest, asked, one_thread


def threads() -> list[int]:
    return [pool["num_threads"] for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "blas"]


@pytest.fixture
def two_threads(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """A process in which nobody set the number, and the library takes two."""
    for name in THREADS_OF:
        monkeypatch.delenv(name, raising=False)
    assert np.linalg
    with threadpoolctl.threadpool_limits(2, "blas"):
        yield threads()


def test_a_call_of_the_front_takes_one_thread(two_threads: list[int]) -> None:
    def seen(_: StreamRequest) -> list[int]:
        return threads()

    assert 2 in two_threads
    assert set(asked(StreamRequest)(seen)()) == {1}
    assert threads() == two_threads


def test_calls_beside_each_other_leave_no_limit_behind(two_threads: list[int]) -> None:
    inside, leave = threading.Event(), threading.Event()

    def first() -> None:
        with one_thread():
            inside.set()
            leave.wait(30)

    other = threading.Thread(target=first)
    other.start()
    inside.wait(30)
    with one_thread():
        leave.set()
        other.join()
    assert threads() == two_threads


def test_a_setting_of_the_user_stands(two_threads: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    with one_thread():
        assert threads() == two_threads
