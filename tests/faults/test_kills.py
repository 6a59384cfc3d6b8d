"""Commands that are killed, stopped, given no more disk or run twice at once: results are whole, nothing is left."""

import sys

import pytest
from tests.faults.kills import COMMANDS, cut_short, kills, writers

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")


def test_runs_that_are_killed_or_stopped_leave_whole_results() -> None:
    ended, wrong = kills(len(COMMANDS), seed=7)
    assert wrong == []
    assert sum(ended.values()) == len(COMMANDS)


def test_a_disk_that_takes_no_more_leaves_the_earlier_result() -> None:
    runs, wrong = cut_short(["apply to Parquet"])
    assert wrong == []
    assert runs == 2


def test_two_writers_leave_one_whole_result() -> None:
    assert writers(2, ["simulate", "apply to Parquet"]) == (2, [])
