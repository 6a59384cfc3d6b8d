"""Phones by HTTP: phyphox, which is asked, and Sensor Logger, which pushes to this machine."""

from __future__ import annotations

import json
import queue
import threading
import time
from collections.abc import Iterator
from http.client import HTTPConnection, HTTPException
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, cast

from tumble.capture.decoders.phyphox import USUAL, buffers_of
from tumble.capture.link import pieces_of_link
from tumble.capture.source import Piece, Source, SourceOptions
from tumble.capture.sources.sockets import pieces_of_port, split_address
from tumble.errors import UsageError

# s to wait for an answer; bytes of a pushed document, and how many wait to be read.
_PATIENCE, _LONGEST, _WAITING = 5.0, 1 << 22, 1000


class _Phyphox:
    """The remote access of phyphox: each sensor's buffers from the newest stamp that was seen on."""

    def __init__(self, host: str, port: int) -> None:
        self._host, self._port = host, port
        self._own = HTTPConnection(host, port, timeout=_PATIENCE)
        try:
            config = self._ask("/config")
            # An app that measures already goes on.
            self._ask("/control?cmd=start")
        except OSError as error:
            self.close()
            raise UsageError(
                f"No phyphox answers at {host}:{port}: open an experiment with accelerometer and gyroscope, and "
                f"switch on “Allow remote access” in its menu ({error})."
            ) from error
        try:
            self._buffers = buffers_of(config)
        except (LookupError, TypeError, AttributeError, ValueError):
            config, self._buffers = {}, dict(USUAL)
        if config and "force" not in self._buffers:
            self.close()
            raise UsageError(
                f"The experiment that phyphox at {host}:{port} shows reads no accelerometer with its time: open "
                "one with “Acceleration (with g)” and “Gyroscope”."
            )
        self._first = json.dumps(config).encode() + b"\n" if config else b""
        self._since: dict[str, float] = {}

    def _ask(self, path: str) -> dict[str, Any]:
        try:
            self._own.request("GET", path)
            said = json.loads(self._own.getresponse().read())
        except (HTTPException, ValueError, RecursionError) as error:
            self._own.close()
            raise OSError(f"{path} is not answered: {error!r}") from error
        if not isinstance(said, dict):
            raise OSError(f"{path} is not answered")
        return cast("dict[str, Any]", said)

    def read(self, seconds: float) -> bytes:
        """Return what was measured since."""
        if self._first:
            first, self._first = self._first, b""
            return first
        time.sleep(seconds)
        wishes: list[str] = []
        for stamp, *axes in self._buffers.values():
            since = self._since.get(stamp)
            wishes.append(f"{stamp}={'full' if since is None else repr(since)}")
            wishes += [f"{axis}={'full' if since is None else f'{since!r}|{stamp}'}" for axis in axes]
        said = self._ask("/get?" + "&".join(wishes))
        for stamp, *_ in self._buffers.values():
            self._since.update(_newest(said, stamp))
        return json.dumps(said).encode() + b"\n"

    def close(self) -> None:
        """Let go of it."""
        self._own.close()


def _newest(said: dict[str, Any], stamp: str) -> dict[str, float]:
    """The last stamp of an answer by its buffer's name; none where nothing came."""
    try:
        return {stamp: float(said["buffer"][stamp]["buffer"][-1])}
    except (LookupError, TypeError, ValueError):
        return {}


def _read_phyphox(address: str, options: SourceOptions) -> Iterator[Piece]:
    """Yield what phyphox measures."""
    host, port = split_address(address if ":" in address else f"{address}:80", None)
    return pieces_of_link(lambda: _Phyphox(host, port), f"the phone at {host}", options, "phyphox")


class _Pushed:
    """A server that takes what Sensor Logger posts."""

    def __init__(self, host: str, port: int) -> None:
        self._came: queue.Queue[bytes] = queue.Queue(_WAITING)
        came = self._came

        class Handler(BaseHTTPRequestHandler):
            """Takes a document and answers."""

            timeout = 30.0

            def do_POST(self) -> None:
                """Take a document."""
                length = self.headers.get("Content-Length", "")
                if not length.isdigit() or int(length) > _LONGEST:
                    self.send_error(413)
                    return
                body = self.rfile.read(int(length))
                try:
                    # A document of several lines becomes one.
                    came.put_nowait(body.replace(b"\n", b" ").replace(b"\r", b" ") + b"\n")
                    self.send_response(200)
                except queue.Full:
                    self.send_response(503)
                self.send_header("Content-Length", "0")
                self.end_headers()

            def log_message(self, format: str, *args: object) -> None:
                """Say nothing."""

        self._server = ThreadingHTTPServer((host, port), Handler)
        self._server.daemon_threads = True
        threading.Thread(target=self._server.serve_forever, daemon=True, name="pushed").start()

    def read(self, seconds: float) -> bytes:
        """Return what came."""
        try:
            return self._came.get(timeout=seconds)
        except queue.Empty:
            return b""

    def close(self) -> None:
        """Let go of the port."""
        self._server.shutdown()
        self._server.server_close()


def _read_pushed(address: str, options: SourceOptions) -> Iterator[Piece]:
    """Yield what Sensor Logger pushes to a port of this machine, see `pieces_of_port`."""
    return pieces_of_port(_Pushed, "Port", address, options, "sensorlogger")


SOURCES = (
    Source("phyphox", "a phone with the app phyphox", "phyphox:HOST:8080", _read_phyphox),
    Source(
        "sensorlogger",
        "a phone whose app Sensor Logger pushes to a port here",
        "sensorlogger:PORT",
        _read_pushed,
    ),
)
