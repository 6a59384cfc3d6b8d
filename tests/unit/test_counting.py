"""How far work is, and how long the rest takes."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator

import pytest

from tumble import counting
from tumble.counting import Stage, about, counted, listening, part, stepped, time_words


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
    assert said[3:] == [0.0, 1.0, 0.0, 1.0]


def test_where_nobody_listens_nothing_is_said() -> None:
    assert list(counted("abc", 3)) == ["a", "b", "c"]
    with part(0.2, 0.6), about(3):
        stepped()


def test_loops_one_after_the_other_are_parts_of_one_bar(said: list[float]) -> None:
    with part(0.0, 0.5):
        assert list(counted("ab", 2)) == ["a", "b"]
    with part(0.5, 1.0):
        assert list(counted("cd", 2)) == ["c", "d"]
    assert said == [0.0, 0.25, 0.5, 0.5, 0.5, 0.75, 1.0]


def test_steps_of_an_iteration_are_counted_against_the_usual_number(said: list[float]) -> None:
    """Of one that takes longer nobody knows how much is done; a loop within it says nothing."""
    stepped()
    with about(4):
        for _ in counted(range(6), 6):
            stepped()
    stepped()
    assert [str(share) for share in said] == ["0.0", "0.25", "0.5", "0.75", "nan", "nan", "nan", "1.0"]


def test_work_that_takes_longer_than_it_seemed_states_no_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    stage = Stage()
    stage.begin("adjustment")
    stage.at(0.0)
    now[0] = 105.0
    stage.at(0.5)
    assert stage.words().endswith("50 %, 5 s left")
    now[0] = 112.0
    assert stage.words().endswith("50 %, 12 s so far")
    stage.at(math.nan)
    assert stage.words() == "adjustment, 12 s so far"


def test_the_rest_takes_as_long_as_what_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    stage = Stage()
    stage.begin("reading")
    now[0] = 150.0
    stage.at(0.0)  # the loop begins now, whenever the stage did
    now[0] = 150.5
    stage.at(0.01)
    assert stage.words() == "reading"
    now[0] = 160.0
    stage.at(0.25)
    assert stage.words() == "reading ━━━━━╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌ 25 %, 30 s left"
    assert time_words(180.0) == "3 min"


def test_words_change_while_nobody_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """A time left runs down, a name makes room for the bar, and of unknown work it is said how long it has taken."""
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    stage = Stage()
    stage.begin("adjustment")
    now[0] = 101.0
    assert stage.words() == "adjustment"
    now[0] = 105.0
    assert stage.words() == "adjustment, 5 s so far"
    stage.begin("reading")
    stage.at(0.0)
    now[0] = 115.0
    stage.at(0.25)
    now[0] = 120.0
    assert stage.words().endswith("25 %, 25 s left")
    stage.begin("the next of several in a loop, which has a rather long name of its own")
    assert stage.words(77) == "the next of several in a loop, which ha… ━━━━━╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌ 25 %, 25 s left"
    assert len(stage.words(77)) == 77
    now[0] = 200.0
    assert stage.words().endswith("25 %, 95 s so far")
    stage.at(1.0)
    now[0] = 201.0
    assert stage.words(20) == "the ne…, 96 s so far"
    stage.begin("writing")
    assert stage.words() == "writing"
