"""Workers end with the program that began them."""

from __future__ import annotations

import os
import subprocess
import sys
import time

BEGIN = """
import os, time
from tumble.workflows.batches.executors import processes
if __name__ == "__main__":
    pool = processes(1)
    print(pool.submit(os.getpid).result(), flush=True)
    time.sleep(60.0)
"""


def is_there(number: int) -> bool:
    try:
        os.kill(number, 0)
    except ProcessLookupError:
        return False
    return True


def test_workers_of_a_program_that_is_killed_end_too() -> None:
    with subprocess.Popen([sys.executable, "-c", BEGIN], stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        worker = int(program.stdout.readline())
        assert is_there(worker)
        program.kill()
    for _ in range(300):
        if not is_there(worker):
            return
        time.sleep(0.1)
    os.kill(worker, 9)
    raise AssertionError("its worker waits for tasks that nobody will give it")
