"""HTTP: lines that are posted to a port here, and the app phyphox, which is asked.

References
----------
phyphox wiki, *Remote-interface communication*: `/config` with the experiment's inputs, `/get` with its buffers.
"""

from __future__ import annotations

import json
import queue
import threading
import time
from contextlib import suppress
from functools import partial
from http.client import HTTPConnection, HTTPException
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, cast

from tumble.capture.link import Line, source_of_lines
from tumble.capture.sources.streams import source_at_port, split_address
from tumble.errors import UsageError

# s to wait for an answer; bytes of a posted document, and how many wait to be read.
_PATIENCE, _LONGEST, _WAITING = 5.0, 1 << 22, 1000
# The sensors that phyphox has, by the names that `rank_sensor` knows.
_KINDS = {"accelerometer": "accelerometer", "gyroscope": "gyroscope", "magnetic_field": "magneticfield"}


class _Phyphox:
    """The remote access of phyphox: each sensor's buffers from the newest stamp on, as lines of JSON."""

    def __init__(self, host: str, port: int) -> None:
        self._own = HTTPConnection(host, port, timeout=_PATIENCE)
        try:
            self._buffers = _buffers_of(self._ask("/config"))
            # An app that measures already goes on.
            self._ask("/control?cmd=start")
        except OSError as error:
            self.close()
            raise UsageError(
                f"No phyphox answers at {host}:{port}: open an experiment with accelerometer and gyroscope, and "
                f"switch on “Allow remote access” in its menu ({error})."
            ) from error
        if "accelerometer" not in self._buffers:
            self.close()
            raise UsageError(
                f"The experiment that phyphox at {host}:{port} shows reads no accelerometer with its time: open "
                "one with “Acceleration (with g)” and “Gyroscope”."
            )
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
        time.sleep(seconds)
        wishes: list[str] = []
        for stamp, *axes in self._buffers.values():
            since = self._since.get(stamp)
            wishes.append(f"{stamp}={'full' if since is None else repr(since)}")
            wishes += [f"{axis}={'full' if since is None else f'{since!r}|{stamp}'}" for axis in axes]
        said = self._ask("/get?" + "&".join(wishes))
        payload: list[dict[str, Any]] = []
        try:
            for name, buffers in self._buffers.items():
                # The axes of a sensor that is just being read may have unlike lengths.
                for t, *axes in zip(*(said["buffer"][one]["buffer"] for one in buffers), strict=False):
                    if None not in (t, *axes):
                        self._since[buffers[0]] = float(t)
                        payload.append({"name": name, "time": round(1e9 * t), "values": axes})
        except (LookupError, TypeError, ValueError) as error:
            raise OSError("/get is not answered") from error
        return json.dumps({"payload": payload}).encode() + b"\n"

    def close(self) -> None:
        """Let go of it."""
        self._own.close()


def _buffers_of(config: dict[str, Any]) -> dict[str, tuple[str, ...]]:
    """The buffers of time, x, y and z by sensor, as an experiment's configuration names them."""
    found: dict[str, tuple[str, ...]] = {}
    try:
        for source in config["inputs"]:
            outputs: dict[str, str] = {}
            for one in source["outputs"]:
                outputs.update(one)
            if source["source"] in _KINDS and all(name in outputs for name in "txyz"):
                found[_KINDS[source["source"]]] = tuple(outputs[name] for name in "txyz")
    except (LookupError, TypeError, ValueError) as error:
        raise OSError("/config is not answered") from error
    return found


def _phyphox(address: str) -> Line:
    host, port = split_address(address if ":" in address else f"{address}:80", None)
    return partial(_Phyphox, host, port), f"the phone at {host}"


class _Posted:
    """A server that takes lines, and documents of JSON, that are posted to it."""

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
                with suppress(ValueError, RecursionError):
                    # A document of several lines becomes one.
                    body = json.dumps(json.loads(body)).encode()
                try:
                    came.put_nowait(body + b"\n")
                    self.send_response(200)
                except queue.Full:
                    self.send_response(503)
                self.send_header("Content-Length", "0")
                self.end_headers()

            def log_message(self, format: str, *args: object) -> None:
                """Say nothing."""

        self._server = ThreadingHTTPServer((host, port), Handler)
        self._server.daemon_threads = True
        threading.Thread(target=self._server.serve_forever, daemon=True, name="posted").start()

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


SOURCES = (
    source_of_lines("phyphox", "a phone with the app phyphox", "phyphox:HOST:8080", _phyphox),
    source_at_port("http", "lines or JSON that are posted to a port here", _Posted, "Port"),
)
