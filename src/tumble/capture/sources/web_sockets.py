"""WebSockets: lines or frames of any server, the app SensorServer, and ROS by foxglove_bridge."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from typing import Any, TypeGuard, cast
from urllib.parse import quote

from tumble.capture.decoders.foxglove import IMU, message
from tumble.capture.decoders.sensor_server import CORRECTED, UNCALIBRATED
from tumble.capture.link import Link, pieces_of_link
from tumble.capture.source import Piece, Source, SourceOptions
from tumble.capture.sources.sockets import split_address
from tumble.errors import UsageError, install
from tumble.recording.formats.bags.ros_messages import FIELD, plain_type

# s to connect, and until a server has said something; bytes of a message.
_CONNECT, _ANSWER, _LONGEST = 5.0, 2.0, 1 << 24
# s without a message after which a bridge has said what it has.
_QUIET = 0.4
_SUBPROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
_ENCODINGS = {"cdr": True, "ros1": False}


class _WebSocket:
    """An open WebSocket; what its library raises is the system's."""

    def __init__(self, url: str, protocols: Sequence[str] | None = None) -> None:
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
                url,
                subprotocols=protocols,  # type: ignore[arg-type]  # names of protocols are strings
                open_timeout=_CONNECT,
                max_size=_LONGEST,
                proxy=None,
            )
            self._own: Any = self._context.enter_context(opened)
        except (OSError, WebSocketException, ValueError) as error:
            raise UsageError(f"Nobody answers as a WebSocket at {url}: {error}.") from error

    def message(self, seconds: float) -> bytes | str | None:
        """Return the next message, None if there is none yet."""
        try:
            return self._own.recv(timeout=seconds)
        except TimeoutError:
            return None
        except self._lost as error:
            raise ConnectionError(str(error)) from error

    def read(self, seconds: float) -> bytes:
        """Return the messages that came, text with its line's end."""
        found = self.message(seconds)
        parts: list[bytes] = []
        while found is not None:
            parts.append(found if isinstance(found, bytes) else found.encode().rstrip(b"\n") + b"\n")
            found = self.message(0.0) if len(parts) < 1000 else None
        return b"".join(parts)

    def send(self, text: str) -> None:
        """Send a message."""
        try:
            self._own.send(text)
        except self._lost as error:
            raise ConnectionError(str(error)) from error

    def close(self) -> None:
        """Let go of it."""
        self._context.close()


def _read_web_socket(address: str, options: SourceOptions) -> Iterator[Piece]:
    """Yield what a WebSocket sends: lines of text, or frames."""
    url = f"ws:{address}" if address.startswith("//") else f"ws://{address}"
    return pieces_of_link(lambda: _WebSocket(url), url, options)


class _Begun:
    """A socket whose first messages were read already."""

    def __init__(self, own: _WebSocket, first: bytes) -> None:
        self._own, self._first = own, first

    def read(self, seconds: float) -> bytes:
        """Return what came."""
        first, self._first = self._first, b""
        return first or self._own.read(seconds)

    def close(self) -> None:
        """Let go of it."""
        self._own.close()


def _read_sensor_server(address: str, options: SourceOptions) -> Iterator[Piece]:
    """Yield what the app SensorServer sends: the sensors without the system's corrections, if the phone has them."""
    host, port = split_address(address if ":" in address else f"{address}:8080", None)
    wishes = (UNCALIBRATED, UNCALIBRATED[:2], CORRECTED, CORRECTED[:2], CORRECTED[:1])
    sets = [options.topics] if options.topics else wishes

    def connect() -> Link:
        for names in sets:
            listed = quote(json.dumps(list(names), separators=(",", ":")))
            own = _WebSocket(f"ws://{host}:{port}/sensors/connect?types={listed}")
            try:
                # The app closes a socket that asks for a sensor that the phone lacks.
                return _Begun(own, own.read(_ANSWER))
            except ConnectionError:
                own.close()
        raise UsageError(f"The phone at {host}:{port} has none of the sensors {', '.join(sets[-1])}.")

    return pieces_of_link(connect, f"the phone at {host}", options, "sensorserver")


class _Bridge:
    """A socket of foxglove_bridge with its topics subscribed."""

    def __init__(self, url: str, topics: Sequence[str]) -> None:
        self._own = _WebSocket(url, _SUBPROTOCOLS)
        self._wanted = list(topics)
        try:
            chosen = _chosen(self._advertised(), topics, url)
            asked = [{"id": n, "channelId": channel["id"]} for n, channel in enumerate(chosen)]
            self._own.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
        except (OSError, UsageError):
            self.close()
            raise
        self._subscribed = [
            (plain_type(one["schemaName"]) == FIELD, _ENCODINGS[one["encoding"]]) for one in chosen
        ]

    def _advertised(self) -> list[dict[str, Any]]:
        """What is offered until nothing follows for a moment, or what is wanted is among it."""
        found: list[dict[str, Any]] = []
        end = time.monotonic() + _ANSWER
        while time.monotonic() < end:
            text = self._own.message(_QUIET)
            said = _document(text) if isinstance(text, str) else {}
            if said.get("op") == "advertise":
                found += [one for one in said.get("channels", []) if _is_channel(one)]
            names = {one["topic"] for one in found}
            if names.issuperset(self._wanted) if self._wanted else text is None and found:
                break
        return found

    def read(self, seconds: float) -> bytes:
        """Return the messages that came."""
        parts: list[bytes] = []
        found = self._own.message(seconds)
        while found is not None:
            if isinstance(found, bytes) and len(found) > 13 and found[0] == 1:
                number = int.from_bytes(found[1:5], "little")
                if number < len(self._subscribed):
                    field, cdr = self._subscribed[number]
                    parts.append(message(found, number, field=field, cdr=cdr))
            found = self._own.message(0.0) if len(parts) < 1000 else None
        return b"".join(parts)

    def close(self) -> None:
        """Let go of it."""
        self._own.close()


def _document(text: str) -> dict[str, Any]:
    try:
        said = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return cast("dict[str, Any]", said) if isinstance(said, dict) else {}


def _is_channel(one: Any) -> TypeGuard[dict[str, Any]]:
    if not isinstance(one, dict):
        return False
    said = cast("dict[str, Any]", one)
    texts = [said.get(name) for name in ("topic", "encoding", "schemaName")]
    return (
        isinstance(said.get("id"), int)
        and all(isinstance(text, str) for text in texts)
        and said["encoding"] in _ENCODINGS
        and plain_type(said["schemaName"]) in (IMU, FIELD)
    )


def _chosen(channels: list[dict[str, Any]], topics: Sequence[str], url: str) -> list[dict[str, Any]]:
    """The channels of the wanted topics; without a wish the only IMU, and the only magnetometer beside it."""
    units = [one for one in channels if plain_type(one["schemaName"]) == IMU]
    fields = [one for one in channels if plain_type(one["schemaName"]) == FIELD]
    listed = ", ".join(one["topic"] for one in units) or "none"
    missing = [name for name in topics if name not in {one["topic"] for one in channels}]
    if missing:
        raise UsageError(f"--topic {missing[0]}: {url} has no such IMU; it has {listed}.")
    if topics:
        return [next(one for one in channels if one["topic"] == name) for name in topics]
    if len(units) != 1:
        raise UsageError(
            f"{url} has these topics of sensor_msgs/Imu: {listed}. "
            + ("Name one with --topic." if units else "Start the driver of the IMU.")
        )
    return units + (fields if len(fields) == 1 else [])


def _read_foxglove(address: str, options: SourceOptions) -> Iterator[Piece]:
    """Yield what foxglove_bridge sends of `sensor_msgs/Imu` topics."""
    host, port = split_address(address if ":" in address else f"{address or 'localhost'}:8765", None)
    url = f"ws://{host}:{port}"
    return pieces_of_link(lambda: _Bridge(url, options.topics), url, options, "foxglove")


SOURCES = (
    Source("ws", "a WebSocket that sends lines or frames", "ws://HOST:PORT/PATH", _read_web_socket),
    Source(
        "sensorserver",
        "an Android phone with the app SensorServer",
        "sensorserver:HOST:8080",
        _read_sensor_server,
    ),
    Source("foxglove", "ROS by foxglove_bridge", "foxglove:HOST:8765", _read_foxglove),
)
