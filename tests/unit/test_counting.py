"""How far work is, and how long the rest takes."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from tumble import counting
from tumble.counting import Stage, counted, listening, time_words


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[float]]:
    monkeypatch.setattr(counting, "_OFTEN", -1.0)
    shares: list[float] = []
    with listening(shares.append):
        yield shares


def test_a_loop_says_how_much_of_it_is_done(said: list[float]) -> None:
    assert list(counted([3.0, 1.0, 4.0], 8.0, float)) == [3.0, 1.0, 4.0]
    assert said == [0.0, 3.0 / 8.0, 4.0 / 8.0, 1.0]


def test_a_loop_within_a_loop_says_nothing(said: list[float]) -> None:
    for _ in counted("ab", 2):
        assert list(counted(range(5), 5)) == [0, 1, 2, 3, 4]
    assert said == [0.0, 0.5, 1.0]
    # What ended early does not silence what comes next.
    for _ in counted("ab", 2):
        break
    assert list(counted("c", 1)) == ["c"]
    assert said[3:] == [0.0, 0.0, 1.0]


def test_where_nobody_listens_nothing_is_said() -> None:
    assert list(counted("abc", 3)) == ["a", "b", "c"]


def test_the_rest_takes_as_long_as_what_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    shown: list[str] = []
    stage = Stage[str](shown.append)
    stage.begin("reading")
    now[0] = 150.0
    stage.at(0.0)  # the loop begins now, whenever the stage did
    now[0] = 150.5
    stage.at(0.01)
    now[0] = 160.0
    stage.at(0.25)
    assert shown == ["reading", "reading ━━━━━╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌ 25 %, 30 s left"]
    assert time_words(180.0) == "3 min"
