"""`tumble units` as it is typed: one argument or two, numbers below zero, options that are none."""

from __future__ import annotations

import pytest


def test_number_and_unit_may_be_one_argument_or_two(tumble) -> None:
    apart = tumble("units", "60", "ug/√Hz")
    assert apart.status == 0
    assert "42.4264" in apart.out  # read as one-sided
    assert tumble("units", "60 ug/√Hz").out == apart.out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("-1", "deg/√h"), "-1.0 is no amount of noise"),
        (("0.3",), "0.3 has no unit"),
        (("deg/√h", "0.3"), "No number: deg/√h"),
        (("0.3", "deg/√h", "--rat", "100"), "No such option: --rat"),
        (("--rat", "100", "0.3", "deg/√h"), "No such option: --rat"),
    ],
)
def test_what_cannot_be_read_is_said(tumble, words: tuple[str, ...], said: str) -> None:
    answer = tumble("units", *words)
    assert answer.status == 2
    assert said in answer.err
    assert "Traceback" not in answer.err
