"""Lines over a network, on standard input, and in a file that another program writes while we read."""

from __future__ import annotations

import os
import socket
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from select import select

from tumble.capture.link import Line, Link, source_of_lines
from tumble.capture.source import Source
from tumble.errors import UsageError

_MOST = 1 << 16


class _Socket:
    """An open socket; of TCP an empty read is the other side's end, of UDP a packet is a line at least."""

    def __init__(self, own: socket.socket, *, packets: bool) -> None:
        self._own, self._packets = own, packets

    def read(self, seconds: float) -> bytes:
        """Return what came."""
        if not select([self._own], [], [], seconds)[0]:
            return b""
        data = self._own.recv(_MOST)
        if not self._packets:
            if not data:
                raise ConnectionError("the other side has closed")
            return data
        # A packet need not end its line.
        return data + b"\n"

    def close(self) -> None:
        """Let go of it."""
        self._own.close()


def split_address(address: str, host: str | None) -> tuple[str, int]:
    """Return host and port of ``HOST:PORT`` or ``PORT``.

    Parameters
    ----------
    address : as written.
    host : where none is named; None if one must be.

    Raises
    ------
    UsageError
        If it is none.
    """
    name, _, port = address.rpartition(":")
    if not port.isdigit() or not 0 < int(port) < 65536 or not (name or host):
        raise UsageError(f"{address} is no address: write HOST:PORT, as 192.168.4.1:5000.")
    return name.strip("[]") or host or "", int(port)


def _tcp(address: str) -> Line:
    """A TCP server that sends."""
    host, port = split_address(address, None)

    def connect() -> Link:
        try:
            own = socket.create_connection((host, port), timeout=5.0)
        except OSError as error:
            raise UsageError(f"Nobody answers at {host}:{port}: {error.strerror or error}.") from error
        return _Socket(own, packets=False)

    return connect, f"{host}:{port}"


def port_here(listen: Callable[[str, int], Link], name: str, address: str) -> Line:
    """Return the line of what is sent to a port of this machine.

    Parameters
    ----------
    listen : opens the port of an interface.
    name : what the port is called.
    address : PORT, or HOST:PORT where one of several interfaces is meant.

    Raises
    ------
    UsageError
        If it is no address; opening the line raises it if the port is taken.
    """
    host, port = split_address(address, "0.0.0.0")

    def connect() -> Link:
        try:
            return listen(host, port)
        except OSError as error:
            raise UsageError(f"{name} {port} cannot be opened: {error.strerror or error}.") from error

    return connect, f"{name} {port}"


def source_at_port(name: str, title: str, listen: Callable[[str, int], Link], called: str) -> Source:
    """Return a source of what is sent to a port of this machine.

    Parameters
    ----------
    name, title : of the source.
    listen, called : see `port_here`.
    """
    return source_of_lines(name, title, f"{name}:PORT", partial(port_here, listen, called))


def _packets(host: str, port: int) -> Link:
    own = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        own.bind((host, port))
    except OSError:
        own.close()
        raise
    return _Socket(own, packets=True)


class _Input:
    """Standard input."""

    def read(self, seconds: float) -> bytes | None:
        """Return what came; None at its end."""
        handle = sys.stdin.fileno()
        if not select([handle], [], [], seconds)[0]:
            return b""
        return os.read(handle, _MOST) or None

    def close(self) -> None:
        """Leave it: it belongs to the caller."""


class _Growing:
    """A file that grows; one that becomes shorter was begun anew."""

    def __init__(self, path: Path) -> None:
        try:
            self._file = path.open("rb")
        except OSError as error:
            raise UsageError(f"{path} cannot be read: {error.strerror or error}.") from error
        self._path = path

    def read(self, seconds: float) -> bytes:
        """Return what was added."""
        data = self._file.read(_MOST)
        if data:
            return data
        if self._path.stat().st_size < self._file.tell():
            raise OSError("the file was begun anew")
        time.sleep(seconds)
        return b""

    def close(self) -> None:
        """Let go of it."""
        self._file.close()


def _follow(address: str) -> Line:
    path = Path(address)
    return partial(_Growing, path), path.name


SOURCES = (
    source_of_lines("tcp", "a TCP server that sends lines", "tcp:HOST:PORT", _tcp),
    source_at_port("udp", "packets that are sent to a UDP port here", _packets, "UDP port"),
    source_of_lines("stdin", "standard input (or -)", "-", lambda _: (_Input, "standard input")),
    source_of_lines("follow", "a file that grows", "follow:FILE", _follow),
)
