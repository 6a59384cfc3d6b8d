"""The page: who is served, what comes over its socket, and what its first viewer may ask."""

import http.client
import json
import struct
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from tests.unit.capture.recordings import by_hand, channels_of, events_of, live, pieces_of
from tests.unit.given import signals
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect

from tumble.capture.coach import Event
from tumble.capture.machine import Capture
from tumble.capture.run import CaptureOrder, run_capture
from tumble.capture.source import Piece, Source, SourceOptions
from tumble.web import Hub, PageServer


@pytest.fixture
def served(tmp_path):
    hub = Hub({"gyro scale": 1e-3})
    server = PageServer(hub, tmp_path)
    server.start()
    yield hub, server
    server.stop()


def got(server: PageServer, path: str, host: str | None = None) -> tuple[int, str, dict[str, str]]:
    line = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10.0)
    line.request("GET", path, headers={"Host": host or f"127.0.0.1:{server.port}"})
    answer = line.getresponse()
    text = answer.read().decode()
    line.close()
    return answer.status, text, {k.lower(): v for k, v in answer.getheaders()}


def watching(server: PageServer, **more: Any) -> ClientConnection:
    own = f"http://127.0.0.1:{server.port}"
    return connect(f"ws://127.0.0.1:{server.port}/watch", **{"origin": own, "proxy": None, **more})


def heard(viewer: ClientConnection, key: str) -> Any:
    """The next message that has a key."""
    end = time.monotonic() + 10.0
    while time.monotonic() < end:
        message = viewer.recv(timeout=10.0)
        if isinstance(message, str) and key in (found := json.loads(message)):
            return found[key]
    raise AssertionError(key)


def test_the_page_and_its_files_come_with_a_strict_policy(served):
    status, text, headers = got(served[1], "/")
    assert status == 200
    assert "app.js" in text
    policy = headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert [got(served[1], f"/{name}")[0] for name in ("app.js", "solid.js", "traces.js", "style.css")] == [
        200
    ] * 4


@pytest.mark.parametrize(
    "path", ["/../server.py", "/%2e%2e/server.py", "/etc/passwd", "/recording.csv", "/page"]
)
def test_no_other_file_is_served(served, path):
    assert got(served[1], path)[0] == 404


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "192.168.1.5:80", ""])
def test_a_request_by_another_name_is_refused(served, host):
    assert got(served[1], "/", host or "evil")[0] == 403
    assert got(served[1], "/report", host or "evil")[0] == 403


@pytest.mark.parametrize("origin", ["http://evil.example", None, "null"])
def test_a_socket_that_another_page_opens_is_refused(served, origin):
    with pytest.raises(InvalidStatus):
        watching(served[1], origin=origin)


def test_traces_are_the_least_and_greatest_sample_of_each_thirtieth(served):
    hub, server = served
    recording = by_hand(1, seed=1, rate=1000.0)
    for piece in pieces_of(recording, 0.01):
        hub.tap(piece)
    with watching(server) as viewer:
        frame = b""
        while not frame:
            message = viewer.recv(timeout=10.0)
            frame = message if isinstance(message, bytes) else b""
    columns = [struct.unpack_from("<d12f", frame, at) for at in range(0, len(frame), 56)]
    for time_of, *values in columns[3:10]:
        inside = np.floor(recording.time * 30.0) == round(time_of * 30.0)
        part = signals(recording)[0][inside]
        assert values[0:6:2] == pytest.approx(part.min(axis=0), abs=1e-5)
        assert values[1:6:2] == pytest.approx(part.max(axis=0), abs=1e-5)


def test_events_reach_who_comes_late_and_the_first_leads(served):
    hub, server = served
    capture = Capture(channels_of(by_hand(1, seed=1)), None, 3.0)
    hub([Event("remark", 1.0, "Hello.")], capture)
    with watching(server) as first:
        assert heard(first, "event")["words"] == "Hello."
        assert heard(first, "leads") is True
        with watching(server) as second:
            assert heard(second, "event")["words"] == "Hello."
            assert heard(second, "leads") is False
            second.send(json.dumps({"do": "stop"}))
            second.send("{broken")
            second.send(json.dumps([1, 2]))
            time.sleep(0.3)
            assert not hub.stop_wanted
            first.close()
            assert heard(second, "leads") is True
            second.send(json.dumps({"do": "stop"}))
            end = time.monotonic() + 5.0
            while not hub.stop_wanted and time.monotonic() < end:
                time.sleep(0.02)
            assert hub.stop_wanted


def test_a_dropped_hold_does_not_count_in_the_calibration(tmp_path):
    hub, recording = Hub({}), by_hand(14, seed=11)

    def pieces() -> Iterator[Piece]:
        for number, piece in enumerate(live(recording)):
            if number == 200:
                hub.wish({"do": "drop", "hold": 2})
                hub.wish({"do": "drop", "hold": 99})
            yield piece

    source = Source("test", "", "", lambda address, options: pieces())
    run = run_capture(CaptureOrder(source, "", SourceOptions(), tmp_path, imu=None), [hub], taps=[hub.tap])
    assert run.calibration.calibration.quality.holds == 13
    assert [event["hold"] for event in events_of(tmp_path) if event["event"] == "hold_dropped"] == [2]
