"""A simulated unit in the hand of a simulated person, as a device: on a port, in packets, on a socket."""

from __future__ import annotations

import json
import os
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from tumble.capture.events import Event
from tumble.capture.folder import JOURNAL, header_of, lines_of
from tumble.capture.samples import Channels
from tumble.capture.simulated_person import SimulatedPerson
from tumble.capture.sources.sockets import split_address
from tumble.errors import UsageError, install
from tumble.recording.samples import Samples

# s after which the names of the columns are sent again, for those who come later; pieces that a slow reader may lag.
AGAIN, LAGGED = 1.0, 600

Sender = tuple[str, Callable[[bytes], None]]
"""What `tumble capture` reads it by, and what sends some whole lines."""


def serve(person: SimulatedPerson, where: str, guide: Path | None, tell: Callable[[str], None]) -> None:
    """Send what a simulated unit measures, as lines of text in real time, until the person has done.

    Parameters
    ----------
    person : who moves the unit.
    where : "pty", "udp:HOST:PORT" or "ws:PORT".
    guide : folder of the capture whose guide the person follows; None for a list of 26 poses.
    tell : is told where the unit can be read.

    Raises
    ------
    UsageError
        If it cannot be served there.
    """
    heard = None if guide is None else GuideFolder(guide)
    with _sender(where) as (address, send):
        tell(address)
        head, said = b"", -AGAIN
        for piece in person:
            if isinstance(piece, Channels):
                head = header_of(piece)
            elif isinstance(piece, Samples):
                if piece.time[-1] - said >= AGAIN:
                    said = float(piece.time[-1])
                    send(head)
                send(lines_of(piece))
            if heard is not None:
                person.hear(heard.events())


class GuideFolder:
    """The events of a capture, read from its folder as they are written.

    Parameters
    ----------
    folder : of the capture; it may not be there yet.
    """

    def __init__(self, folder: Path) -> None:
        self._file, self._at = folder / JOURNAL, 0
        with suppress(OSError):
            # What was said before belongs to a session that has ended.
            self._at = self._file.stat().st_size

    def events(self) -> list[Event]:
        """Return those that came since."""
        try:
            with self._file.open("rb") as file:
                file.seek(self._at)
                new = file.read()
        except OSError:
            return []
        whole = new[: new.rfind(b"\n") + 1]
        self._at += len(whole)
        found: list[Event] = []
        for line in whole.splitlines():
            with suppress(ValueError, KeyError, TypeError):
                said = json.loads(line)
                found.append(Event(said["event"], said["t"], said["words"], said))
        return found


@contextmanager
def _sender(where: str) -> Generator[Sender]:
    """Open what is served."""
    kind, _, rest = where.partition(":")
    if kind == "pty" and not rest:
        with _port() as sender:
            yield sender
    elif kind == "udp" and rest:
        with _packets(*split_address(rest, "127.0.0.1")) as sender:
            yield sender
    elif kind == "ws" and rest:
        with _socket(*split_address(rest, "127.0.0.1")) as sender:
            yield sender
    else:
        raise UsageError(f"--serve {where}: give pty, udp:HOST:PORT or ws:PORT.")


@contextmanager
def _port() -> Generator[Sender]:
    try:
        import pty
        import tty
    except ImportError:
        raise UsageError("This system has no pseudo-terminals: serve on udp:PORT or ws:PORT.") from None
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    os.set_blocking(ours, False)

    rest = b""

    def send(lines: bytes) -> None:
        nonlocal rest
        # A port that nobody reads is full: whole lines are lost then, as on a cable.
        with suppress(BlockingIOError):
            rest = rest[os.write(ours, rest) :] if rest else rest
            if not rest:
                rest = lines[os.write(ours, lines) :]

    try:
        yield f"serial:{os.ttyname(theirs)}", send
    finally:
        os.close(ours)
        os.close(theirs)


@contextmanager
def _packets(host: str, port: int) -> Generator[Sender]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:

        def send(lines: bytes) -> None:
            for line in lines.splitlines(keepends=True):
                # Where nobody listens, the system may say so.
                with suppress(ConnectionError):
                    own.sendto(line, (host, port))

        yield f"udp:{port}", send


@contextmanager
def _socket(host: str, port: int) -> Generator[Sender]:
    try:
        from websockets.exceptions import WebSocketException
        from websockets.sync.server import serve as serve_sockets
    except ImportError:
        raise UsageError(f"A WebSocket needs the extra `web`: {install('web')}.") from None
    readers: list[deque[bytes]] = []
    ended = threading.Event()

    def reader(link: Any) -> None:
        mine: deque[bytes] = deque(maxlen=LAGGED)
        readers.append(mine)
        with suppress(WebSocketException):
            while not ended.is_set():
                while mine:
                    link.send(mine.popleft().decode())
                time.sleep(0.02)
        readers.remove(mine)

    def send(lines: bytes) -> None:
        for one in list(readers):
            one.append(lines)

    try:
        server = serve_sockets(reader, host, port)
    except OSError as error:
        raise UsageError(f"--serve ws:{host}:{port} cannot be opened: {error.strerror or error}.") from error
    with server:
        threading.Thread(target=server.serve_forever, daemon=True, name="served").start()
        try:
            yield f"ws://{host}:{port}/", send
        finally:
            ended.set()
            server.shutdown()


def person_for(grade: str, seed: int, guide: Path | None) -> SimulatedPerson:
    """Return a person as persons are, with a unit of a grade, in real time.

    Parameters
    ----------
    grade, seed : of the unit.
    guide : folder of the capture that is followed; None for a list of 26 poses in an order of chance.

    Raises
    ------
    UsageError
        If there is no such grade.
    """
    from tumble.capture.simulated_person import twenty_six_in_order
    from tumble.capture.sources.simulated import USUAL
    from tumble.simulation.grades import find_grade

    order = np.random.default_rng([seed, 5]).permutation(26)
    poses = twenty_six_in_order()[order] if guide is None else None
    return SimulatedPerson(find_grade(grade), seed, poses=poses, flaws=USUAL, speed=1.0)
