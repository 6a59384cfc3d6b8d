"""Sources whose sensors come apart: each against a small server that was written from the protocol's public text."""

import json
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

import numpy as np
import pytest
from tests.unit.capture.test_links import collected

from tumble.capture.apart import ApartSensors
from tumble.capture.source import Channels, Notice, Piece, SourceOptions, find_source
from tumble.errors import UsageError
from tumble.recording import Samples, joined

RATE = 100.0


def force_at(t: float) -> list[float]:
    """Straight lines, so that what is interpolated is known too."""
    return [0.1 + 0.2 * t, -0.3 * t, 9.7 + 0.05 * t]


def turn_at(t: float) -> list[float]:
    return [0.01 * np.sin(3.0 * t), -0.02, 0.03 + 0.001 * t]


def field_at(t: float) -> list[float]:
    return [20.0 + t, -5.0, 43.0 - t]


def check(pieces: list[Piece], *, fewest: int = 100, field: bool = True, unit: str = "m/s^2") -> Channels:
    """What came is what was sent: the gyro at its stamps, the force between its own."""
    channels = next(p for p in pieces if isinstance(p, Channels))
    samples = joined([p for p in pieces if isinstance(p, Samples)])
    assert len(samples) >= fewest
    assert (channels.specific_force_unit, channels.angular_rate_unit) == (unit, "rad/s")
    assert channels.rate == pytest.approx(RATE, rel=0.02)
    assert np.all(np.diff(samples.time) > 0.0)
    # The first gyro sample's clock, found by its line.
    t = (samples.angular_rate[:, 2] - 0.03) / 0.001
    np.testing.assert_allclose(np.diff(t), np.diff(samples.time), atol=1e-6)
    size = 9.80665 if unit == "g" else 1.0
    np.testing.assert_allclose(size * samples.specific_force, [force_at(one) for one in t], atol=1e-6)
    np.testing.assert_allclose(samples.angular_rate, [turn_at(one) for one in t], atol=1e-9)
    assert (samples.magnetic_field is not None) == field
    if samples.magnetic_field is not None:
        there = np.isfinite(samples.magnetic_field).all(axis=1)
        assert 0.1 * len(samples) < np.count_nonzero(there) < 0.5 * len(samples)
        expected = np.array([field_at(one) for one in t[there]])
        np.testing.assert_allclose(samples.magnetic_field[there], expected, atol=2.0 / RATE)
    return channels


@contextmanager
def http_server(answer: Callable[[str], object]) -> Generator[int]:
    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            body = json.dumps(answer(self.path)).encode()
            self.send_response(200)
            self.send_header("Content-Type", "application/json")
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *args: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield server.server_address[1]
    finally:
        server.shutdown()
        server.server_close()


class Phyphox:
    """An experiment with buffers of its own names, as the wiki describes /config, /control and /get."""

    def __init__(self) -> None:
        self.begun: float | None = None
        self.asked: list[str] = []

    def __call__(self, path: str) -> object:
        self.asked.append(path)
        url = urlsplit(path)
        if url.path == "/config":

            def outputs(name: str, time_name: str) -> list[dict[str, str]]:
                return [{"x": name + "X"}, {"y": name + "Y"}, {"z": name + "Z"}, {"t": time_name}]

            return {
                "crc32": "9566a693",
                "title": "mine",
                "inputs": [
                    {"source": "accelerometer", "outputs": outputs("a", "a_time")},
                    {"source": "gyroscope", "outputs": outputs("gyr", "gyr_time")},
                    {"source": "magnetic_field", "outputs": outputs("mag", "mag_time")},
                ],
                "export": [],
            }
        if url.path == "/control":
            self.begun = self.begun or time.monotonic()
            return {"result": True}
        assert url.path == "/get"
        now = 3.0 + time.monotonic() - self.begun
        buffers: dict[str, object] = {}
        for name, (wish,) in parse_qs(url.query, strict_parsing=True).items():
            letters = "a_time aX aY aZ" if name[0] == "a" else name[:3] + "_time"
            function = {"a": force_at, "g": turn_at, "m": field_at}[name[0]]
            step, shift = {"a": (0.012, 0.003), "g": (0.01, 0.0), "m": (0.05, 0.001)}[name[0]]
            stamps = np.arange(0.0, now - shift, step) + shift
            threshold, _, reference = wish.partition("|")
            if threshold != "full":
                assert (reference or name) == letters.split()[0] or name.endswith("_time")
                stamps = stamps[stamps > float(threshold)]
            axis = "XYZ".find(name[-1])
            values = stamps if name.endswith("_time") else [function(t)[axis] for t in stamps]
            mode = "full" if wish == "full" else "partial"
            buffers[name] = {"size": 0, "updateMode": mode, "buffer": list(values)}
        status = {"session": "a1", "measuring": True, "timedRun": False, "countDown": 0}
        return {"buffer": buffers, "status": status}


def test_phyphox() -> None:
    phone = Phyphox()
    with http_server(phone) as port:
        source, address = find_source(f"phyphox:127.0.0.1:{port}")
        found = collected(source.open(address, SourceOptions()), 350)
    check(found, fewest=350)
    assert "/control?cmd=start" in phone.asked
    assert sum("full" in path for path in phone.asked) == 1


def test_what_is_no_phyphox_is_refused_with_what_to_do() -> None:
    with http_server(lambda path: {"inputs": []}) as port, pytest.raises(UsageError, match="Acceleration"):
        next(find_source("phyphox:")[0].open(f"127.0.0.1:{port}", SourceOptions()))


def logger_document(number: int, *, in_g: bool) -> dict[str, object]:
    """A push of half a second, as the app's page of examples shows it; the sensors stand one after another."""
    begin = 1_698_501_144_401_773_000
    payload: list[dict[str, object]] = []
    size = 9.80665 if in_g else 1.0

    def add(name: str, step: float, shift: float, values: Callable[[float], list[float]]) -> None:
        for k in range(round(0.5 * number / step), round(0.5 * (number + 1) / step)):
            t = k * step + shift
            x, y, z = values(t)
            stamp = begin + round(1e9 * t)
            payload.append(
                {"name": name, "time": str(stamp), "accuracy": 3, "values": {"z": z, "y": y, "x": x}}
            )

    add("gyroscope", 0.01, 0.0, lambda t: [9.0, 9.0, 9.0])
    add("gyroscopeuncalibrated", 0.01, 0.0, turn_at)
    add("accelerometer", 0.01, 0.002, lambda t: [0.0, 0.1, 0.0])
    add("accelerometeruncalibrated", 0.0125, 0.002, lambda t: [v / size for v in force_at(t)])
    add("magnetometeruncalibrated", 0.05, 0.004, field_at)
    payload.append({"name": "microphone", "time": begin, "values": {"dBFS": -160}})
    return {"messageId": number, "sessionId": "identifier", "deviceId": "identifier", "payload": payload}


@pytest.mark.parametrize("in_g", [False, True], ids=["Android", "iPhone"])
def test_sensor_logger_pushes(in_g: bool) -> None:
    source, _ = find_source("http:1")
    with http_server(lambda path: {}) as port:
        free = port
    pieces = source.open(f"127.0.0.1:{free}", SourceOptions())
    assert next(pieces) is None
    link = HTTPConnection("127.0.0.1", free, timeout=5.0)
    for number in range(6):
        document = json.dumps(logger_document(number, in_g=in_g), indent=1 if number % 2 else None)
        link.request("POST", "/data", document, {"Content-Type": "application/json"})
        answer = link.getresponse()
        assert answer.status == 200
        answer.read()
    link.close()
    found = collected(pieces, 290)
    check(found, fewest=290, unit="g" if in_g else "m/s^2")


@contextmanager
def web_socket_server(handle: Callable[[Any], None]) -> Generator[int]:
    pytest.importorskip("websockets", reason="the extra web")
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.server import serve

    def run(socket: Any) -> None:
        with suppress(ConnectionClosed):
            handle(socket)

    with serve(run, "127.0.0.1", 0) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield server.socket.getsockname()[1]
        server.shutdown()


def test_sensor_server_and_a_phone_that_lacks_some_sensors() -> None:
    asked: list[list[str]] = []

    def phone(socket: Any) -> None:
        url = urlsplit(str(socket.request.path))
        assert url.path == "/sensors/connect"
        types = json.loads(unquote(url.query.removeprefix("types=")))
        asked.append(types)
        if any(name.endswith("_uncalibrated") for name in types):
            socket.close(4001, "Sensor of type is not found on the device")
            return
        for k in range(500):
            t = 0.01 * k
            sensors = {"gyroscope": turn_at, "accelerometer": force_at, "magnetic_field": field_at}
            for name, values in sensors.items():
                if name != "magnetic_field" or k % 5 == 0:
                    stamp, kind = 3_925_657_519_043_709 + round(1e9 * t), "android.sensor." + name
                    sample = {"accuracy": 2, "timestamp": stamp, "values": values(t), "type": kind}
                    socket.send(json.dumps(sample))

    with web_socket_server(phone) as port:
        source, address = find_source(f"sensorserver:127.0.0.1:{port}")
        found = collected(source.open(address, SourceOptions()), 480)
    check(found, fewest=480)
    assert len(asked) == 3
    assert asked[0][0] == "android.sensor.accelerometer_uncalibrated"
    assert asked[-1] == ["android.sensor." + n for n in ("accelerometer", "gyroscope", "magnetic_field")]


def test_lines_over_a_web_socket_that_goes_and_comes_back() -> None:
    rest = iter(range(10**6))

    def handle(socket: Any) -> None:
        socket.send("t,ax [m/s^2],ay [m/s^2],az [m/s^2],gx [rad/s],gy [rad/s],gz [rad/s]")
        for _ in range(200):
            t = next(rest) / RATE
            socket.send(",".join(f"{v:.9f}" for v in (t, *force_at(t), *turn_at(t))))

    with web_socket_server(handle) as port:
        source, address = find_source(f"ws://127.0.0.1:{port}/imu")
        found = collected(source.open(address, SourceOptions()), 390)
    assert sum(len(p) for p in found if isinstance(p, Samples)) >= 390
    assert [p.kind for p in found if isinstance(p, Notice)][:2] == ["silence", "remark"]


def test_a_clock_that_jumps_in_the_first_second_is_taken_from_there_on() -> None:
    sensors = ApartSensors(SourceOptions(), "a phone")
    sensors.add("force", 0, 50.0, (0.0, 0.0, 9.8))
    sensors.add("rate", 0, 50.0, (0.1, 0.0, 0.0))
    sensors.add("rate", 0, 3.0, (0.1, 0.0, 0.0))  # of the force, nothing waits any more
    assert sensors.pieces() == []
    for k in range(1, 300):
        sensors.add("force", 0, 3.0 + k / RATE, (0.0, 0.0, 9.8))
        sensors.add("rate", 0, 3.0 + k / RATE, (0.1, 0.0, 0.0))
    channels, *samples = sensors.pieces()
    assert isinstance(channels, Channels)
    taken = joined([one for one in samples if isinstance(one, Samples)])
    assert len(taken) > 250
    assert taken.time.max() < 10.0
