"""TCP and UDP: lines over a network."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from select import select

from tumble.capture.link import Link, pieces_of_link
from tumble.capture.source import Piece, Source, SourceOptions
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


def _read_tcp(address: str, options: SourceOptions) -> Iterator[Piece]:
    """Yield what a TCP server sends."""
    host, port = split_address(address, None)

    def connect() -> Link:
        try:
            own = socket.create_connection((host, port), timeout=5.0)
        except OSError as error:
            raise UsageError(f"Nobody answers at {host}:{port}: {error.strerror or error}.") from error
        return _Socket(own, packets=False)

    return pieces_of_link(connect, f"{host}:{port}", options)


def pieces_of_port(
    listen: Callable[[str, int], Link], name: str, address: str, options: SourceOptions
) -> Iterator[Piece]:
    """Yield what is sent to a port of this machine.

    Parameters
    ----------
    listen : opens the port of an interface.
    name : what the port is called.
    address : PORT, or HOST:PORT where one of several interfaces is meant.
    options : as for `pieces_of_link`.

    Raises
    ------
    UsageError
        If the port is taken.
    RecordingError
        If what comes can be no recording.
    """
    host, port = split_address(address, "0.0.0.0")

    def connect() -> Link:
        try:
            return listen(host, port)
        except OSError as error:
            raise UsageError(f"{name} {port} cannot be opened: {error.strerror or error}.") from error

    return pieces_of_link(connect, f"{name} {port}", options)


def _read_udp(address: str, options: SourceOptions) -> Iterator[Piece]:
    """Yield what is sent to a UDP port of this machine, see `pieces_of_port`."""
    return pieces_of_port(_packets, "UDP port", address, options)


def _packets(host: str, port: int) -> Link:
    own = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        own.bind((host, port))
    except OSError:
        own.close()
        raise
    return _Socket(own, packets=True)


SOURCES = (
    Source("tcp", "a TCP server that sends lines", "tcp:HOST:PORT", _read_tcp),
    Source("udp", "packets that are sent to a UDP port here", "udp:PORT", _read_udp),
)
