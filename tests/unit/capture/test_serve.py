"""The simulated device: what it measures arrives over each line, and the person hears the guide through the folder."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.unit.capture.test_links import collected

from tumble.capture.events import Event
from tumble.capture.samples import Channels
from tumble.capture.serve import person_for, serve
from tumble.capture.simulated_person import SimulatedPerson
from tumble.capture.source import Piece, SourceOptions, find_source
from tumble.errors import UsageError
from tumble.recording.samples import Samples, joined
from tumble.simulation.grades import find_grade


class Until:
    """A person who is called away."""

    def __init__(self, person: SimulatedPerson) -> None:
        self._person, self.away = person, threading.Event()
        self.heard: list[Event] = []

    def __iter__(self) -> Iterator[Piece]:
        for piece in self._person:
            if self.away.is_set():
                return
            yield piece

    def hear(self, events: list[Event]) -> None:
        self.heard += events
        self._person.hear(events)


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.mark.parametrize("kind", ["pty", "udp", "ws"])
def test_a_simulated_unit_is_read_as_a_device(kind: str, tmp_path: Path) -> None:
    where = {"pty": "pty", "udp": f"udp:127.0.0.1:{free_port()}", "ws": f"ws:{free_port()}"}[kind]
    grade = find_grade("consumer-mems")
    person: Any = Until(SimulatedPerson(grade, 3, speed=1.0))
    told: list[str] = []
    there = threading.Event()

    def tell(address: str) -> None:
        told.append(address)
        there.set()

    thread = threading.Thread(target=serve, args=(person, where, tmp_path, tell), daemon=True)
    thread.start()
    assert there.wait(5.0)
    source, address = find_source(told[0])
    (tmp_path / "session.jsonl").write_text('{"t": 1.0, "event": "hold_complete", "words": "a"}\n{"t": 2')
    found = collected(source.open(address, SourceOptions()), 200)
    person.away.set()
    thread.join(5.0)
    assert not thread.is_alive()
    channels = next(p for p in found if isinstance(p, Channels))
    assert (channels.specific_force_unit, channels.angular_rate_unit) == ("m/s^2", "rad/s")
    samples = joined([p for p in found if isinstance(p, Samples)])
    again = [p for p in SimulatedPerson(grade, 3) if isinstance(p, Samples) and p.time[0] < 8.0]
    sent = joined(again)
    assert samples.specific_force is not None
    assert sent.specific_force is not None
    rows = np.searchsorted(sent.time, samples.time - 1e-9)
    same = rows < np.flatnonzero(sent.time < 3.0)[-1]  # while the person rests, whatever is said
    assert np.count_nonzero(same) > 50
    np.testing.assert_array_equal(samples.specific_force[same], sent.specific_force[rows[same]])
    assert [event.kind for event in person.heard] == ["hold_complete"]


def test_where_it_cannot_be_served() -> None:
    person = person_for("tactical", 1, None)
    for where in ("serial", "udp:", "ws:", "pty:7", "udp:1.2.3.4"):
        with pytest.raises(UsageError):
            serve(person, where, None, lambda address: None)
    with suppress(StopIteration):
        person.close()
