"""Who does the work: processes of this machine, or a Dask cluster; anything that is a `concurrent.futures.Executor`."""

from __future__ import annotations

import os
import signal
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from itertools import islice
from typing import Any, TypeVar

from tumble.errors import UsageError, install
from tumble.files import without_password

Task = TypeVar("Task")
Outcome = TypeVar("Outcome")
# Tasks that wait for each worker, so that none is idle while results are written.
_AHEAD = 2


def cores() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def processes(workers: int) -> ProcessPoolExecutor:
    """Return a pool of processes that leave Ctrl-C to the one that started them.

    Parameters
    ----------
    workers : how many.
    """
    from multiprocessing import get_context

    return ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_begin)


@contextmanager
def _stops_held() -> Generator[None, None, None]:
    """Hold Ctrl-C back while a worker may be started: it inherits that until it is ready, and here it comes after."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin() -> None:
    import threading
    import warnings

    # A worker waits for tasks at a pipe that it holds open itself: of a parent that was killed it hears nothing there.
    threading.Thread(target=_end_with_parent, daemon=True).start()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    warnings.simplefilter("ignore")


def _end_with_parent() -> None:
    from multiprocessing import parent_process

    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextmanager
def dask_cluster(address: str) -> Generator[tuple[Executor, int], None, None]:
    """Give an executor on a Dask cluster, and how many tasks it takes at a time.

    Parameters
    ----------
    address : of its scheduler, as ``tcp://host:8786``.

    Raises
    ------
    UsageError
        If the library is not installed, or nobody answers.
    """
    try:
        from distributed import Client  # pyright: ignore[reportMissingTypeStubs]
    except ImportError:
        raise UsageError(f"--scheduler needs dask.distributed: {install('fleet')}.") from None
    known: Any = Client
    try:
        client = known(address, timeout=10, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        words = str(error).partition("\n")[0][:160].rstrip(".")
        raise UsageError(without_password(f"No Dask scheduler answers at {address}: {words}.")) from None
    try:
        threads = sum(int(count) for count in client.nthreads().values())
        yield client.get_executor(pure=False), max(threads, 1)
    finally:
        client.close()


class Hands:
    """Runs tasks on an executor, a few ahead of what is done, and finds the task that kills its worker.

    A pool that breaks is made anew. Those tasks that were under way are then run one at a time, so that the guilty
    one is known, and it alone is lost.
    """

    def __init__(self, make: Callable[[], Executor], workers: int, *, renewable: bool = True) -> None:
        self._make, self._workers, self._renewable = make, workers, renewable
        self._executor = make()

    def run(
        self, work: Callable[[Task], Outcome], tasks: Iterable[Task], lost: Callable[[Task, str], Outcome]
    ) -> Iterator[Outcome]:
        """Yield outcomes as they come.

        Parameters
        ----------
        work : what is done to each; it and the tasks can be pickled.
        tasks : taken one by one.
        lost : what the outcome is of a task whose worker died, or that could not be done, with the reason.
        """
        waiting = iter(tasks)
        suspects: deque[Task] = deque()
        pending: dict[Future[Outcome], Task] = {}
        while True:
            alone = bool(suspects)
            room = max(_AHEAD * self._workers - len(pending), 0)
            chosen = [suspects.popleft()] if alone else list(islice(waiting, room))
            broken = not self._submit(work, chosen, pending, suspects)
            if not pending and not broken:
                return
            done, _ = wait(pending, return_when=FIRST_COMPLETED)
            for future in done:
                task = pending.pop(future)
                try:
                    outcome = future.result()
                except BrokenExecutor:
                    broken = True
                    if not alone:
                        suspects.append(task)
                        continue
                    outcome = lost(task, "the process that worked on it ended (out of memory?)")
                except Exception as error:  # noqa: BLE001 (an executor's own errors, such as a killed worker)
                    outcome = lost(
                        task, f"its worker could not do it ({type(error).__name__}: {str(error)[:120]})"
                    )
                yield outcome
            if broken:
                suspects.extend(pending.values())
                pending.clear()
                self._renew()

    def _submit(
        self,
        work: Callable[[Task], Outcome],
        chosen: list[Task],
        pending: dict[Future[Outcome], Task],
        suspects: deque[Task],
    ) -> bool:
        """Hand tasks over; whether the executor took them."""
        for place, task in enumerate(chosen):
            try:
                with _stops_held():
                    pending[self._executor.submit(work, task)] = task
            except BrokenExecutor:
                suspects.extend(chosen[place:])
                return False
        return True

    def _renew(self) -> None:
        if not self._renewable:
            raise UsageError(
                "The executor broke: one of its workers ended. What is done is kept; run it again."
            )
        self._executor.shutdown(wait=False, cancel_futures=True)
        self._executor = self._make()

    def stop(self, *, at_once: bool) -> None:
        """Let the executor go.

        Parameters
        ----------
        at_once : without waiting for tasks that have begun.
        """
        if not self._renewable:
            return
        if at_once:
            from multiprocessing import active_children

            # They leave Ctrl-C to this process: what they have begun may take hours.
            for worker in active_children():
                worker.terminate()
        # Waited for in any case: what the pool has of the system would be called leaked.
        self._executor.shutdown(wait=True, cancel_futures=True)


@contextmanager
def hands(
    workers: int | None = None, scheduler: str | None = None, executor: Executor | None = None
) -> Generator[Hands, None, None]:
    """Give what runs tasks.

    Parameters
    ----------
    workers : processes; None for one a processor.
    scheduler : address of a Dask cluster instead.
    executor : of a caller instead.

    Raises
    ------
    UsageError
        If there are no workers, or no cluster answers.
    """
    if workers is not None and workers < 1:
        raise UsageError(f"--workers {workers}: give one or more.")
    if executor is not None:
        yield Hands(lambda: executor, workers or cores(), renewable=False)
    elif scheduler is not None:
        with dask_cluster(scheduler) as (cluster, threads):
            yield Hands(lambda: cluster, threads, renewable=False)
    else:
        count = workers or cores()
        own = Hands(lambda: processes(count), count)
        try:
            yield own
        except BaseException:
            own.stop(at_once=True)
            raise
        own.stop(at_once=False)
