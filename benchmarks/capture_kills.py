"""What is lost of a capture that is killed: kill -9 at times of chance, and what of the samples sent is on the disk.

    python benchmarks/capture_kills.py [KILLS]

A unit sends a line each hundredth of a second over TCP, from the moment that the capture is connected. A kill comes
up to six seconds after the first new line is in the file. The file is to hold every line that was sent until 1.2 s
before it, in order and whole but for the last one; then the capture is resumed in the same folder.
"""

from __future__ import annotations

import os
import random
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from itertools import pairwise
from pathlib import Path

RUN = "import sys; from tumble.cli import program; program()"
HEADER = b"t [s],ax [m/s^2],ay [m/s^2],az [m/s^2],gx [rad/s],gy [rad/s],gz [rad/s]\n"
# s that may be lost: a flush each second, and what is on its way.
LOST = 1.2
# m/s² that the vertical axis says more with each sample: its number.
STEP = 1e-7


class Unit:
    """Sends numbered lines for ever, and knows when it sent which."""

    def __init__(self) -> None:
        self.server = socket.create_server(("127.0.0.1", 0))
        self.port = self.server.getsockname()[1]
        self.sent: list[float] = []
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        while True:
            line, _ = self.server.accept()
            # What a unit measures while nobody is connected is not sent later.
            begun = time.monotonic() - 0.01 * len(self.sent)
            with line:
                try:
                    line.sendall(HEADER)
                    while True:
                        number = len(self.sent)
                        time.sleep(max(0.0, begun + 0.01 * number - time.monotonic()))
                        up = 9.8 + STEP * number
                        line.sendall(f"{0.01 * number:.2f},0.1,-0.2,{up:.7f},0.001,0.002,0.003\n".encode())
                        self.sent.append(time.monotonic())
                except OSError:
                    continue


def rows_of(file: Path) -> list[int]:
    """The numbers of the samples in a file; a last line that was cut is none."""
    if not file.exists():
        return []
    *whole, _ = file.read_bytes().split(b"\n")
    return [round((float(line.split(b",")[3]) - 9.8) / STEP) for line in whole[1:]]


def main(kills: int) -> None:
    """Kill, look, and print what was lost at most."""
    chance, unit = random.Random(7), Unit()
    losses: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        file, resumed = Path(folder) / "out" / "recording.csv", False
        for number in range(kills):
            before = len(rows_of(file))
            command = [
                sys.executable,
                "-c",
                RUN,
                "capture",
                f"tcp:127.0.0.1:{unit.port}",
                "-q",
                "-o",
                str(file.parent),
            ]
            running = subprocess.Popen([*command, *(["--resume"] if resumed else [])])
            end = time.monotonic() + 60.0
            while len(rows_of(file)) <= before and time.monotonic() < end:
                time.sleep(0.02)
            time.sleep(chance.uniform(0.0, 6.0))
            killed = time.monotonic()
            os.kill(running.pid, signal.SIGKILL)
            running.wait()
            rows = rows_of(file)[before:]
            assert len(rows) > 0, f"kill {number}: nothing new was written"
            steps = {b - a for a, b in pairwise(rows)}
            assert steps <= {1}, f"kill {number}: steps of {sorted(steps)} samples"
            losses.append(killed - unit.sent[rows[-1]])
            resumed = True
    late = sum(lost > LOST for lost in losses)
    print(
        f"{kills} kills: whole lines in order; {statistics.median(losses):.2f} s were lost (median), "
        f"{max(losses):.2f} s at most, {late} times more than {LOST} s"
    )
    sys.exit(1 if late else 0)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50)
