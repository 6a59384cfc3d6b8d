"""WebSockets: lines of any server, and the app SensorServer."""

from __future__ import annotations

import json
from contextlib import ExitStack
from functools import partial
from typing import Any
from urllib.parse import quote

from tumble.capture.link import Line, source_of_lines
from tumble.capture.sources.streams import split_address
from tumble.errors import UsageError, install

# s to connect, and until a server has said something; bytes of a message.
_CONNECT, _ANSWER, _LONGEST = 5.0, 2.0, 1 << 24
_SENSORS = ("accelerometer", "gyroscope", "magnetic_field")
_WISHES = tuple(
    tuple(f"{sensor}{kind}" for sensor in _SENSORS[:count])
    for kind, count in (("_uncalibrated", 3), ("_uncalibrated", 2), ("", 3), ("", 2), ("", 1))
)


class _WebSocket:
    """An open WebSocket; what its library raises is the system's."""

    def __init__(self, url: str) -> None:
        try:
            from websockets.exceptions import WebSocketException
            from websockets.sync.client import connect
        except ImportError:
            raise UsageError(f"A WebSocket needs the extra `web`: {install('web')}.") from None
        self._lost = WebSocketException
        try:
            # The library wants it as a context, which the link is not.
            self._context = ExitStack()
            opened: Any = connect(
                url, open_timeout=_CONNECT, close_timeout=_ANSWER, max_size=_LONGEST, proxy=None
            )
            self._own: Any = self._context.enter_context(opened)
        except (OSError, WebSocketException, ValueError) as error:
            raise UsageError(f"Nobody answers as a WebSocket at {url}: {error}.") from error

    def _message(self, seconds: float) -> bytes | str | None:
        """The next message, None if there is none yet."""
        try:
            return self._own.recv(timeout=seconds)
        except TimeoutError:
            return None
        except self._lost as error:
            raise ConnectionError(str(error)) from error

    def read(self, seconds: float) -> bytes:
        """Return the messages that came, text with its line's end."""
        found = self._message(seconds)
        parts: list[bytes] = []
        while found is not None:
            parts.append(found if isinstance(found, bytes) else found.encode().rstrip(b"\n") + b"\n")
            found = self._message(0.0) if len(parts) < 1000 else None
        return b"".join(parts)

    def close(self) -> None:
        """Let go of it."""
        self._context.close()


def _server(address: str) -> Line:
    url = f"ws:{address}" if address.startswith("//") else f"ws://{address}"
    return partial(_WebSocket, url), url


class _Phone(_WebSocket):
    """A socket of the app SensorServer: sensors without the system's corrections, if the phone has them."""

    def __init__(self, host: str, port: int) -> None:
        for names in _WISHES:
            listed = quote(json.dumps([f"android.sensor.{name}" for name in names], separators=(",", ":")))
            super().__init__(f"ws://{host}:{port}/sensors/connect?types={listed}")
            try:
                # The app closes a socket that asks for a sensor that the phone lacks.
                self._first = super().read(_ANSWER)
                return
            except ConnectionError:
                self.close()
        raise UsageError(f"The phone at {host}:{port} has none of the sensors {', '.join(_WISHES[-1])}.")

    def read(self, seconds: float) -> bytes:
        """Return what came."""
        first, self._first = self._first, b""
        return first or super().read(seconds)


def _app(address: str) -> Line:
    host, port = split_address(address if ":" in address else f"{address}:8080", None)
    return partial(_Phone, host, port), f"the phone at {host}"


SOURCES = (
    source_of_lines("ws", "a WebSocket that sends lines", "ws://HOST:PORT/PATH", _server),
    source_of_lines(
        "sensorserver", "an Android phone with the app SensorServer", "sensorserver:HOST:8080", _app
    ),
)
