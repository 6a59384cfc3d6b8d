"""Messages, help and pages keep the rules of docs/style.md that a program can check, and it finds what it should."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs" / "site"))

import words


def test_every_message_keeps_the_rules() -> None:
    assert [str(one) for one in words.judge_messages()] == []


def test_every_page_keeps_the_rules() -> None:
    assert [str(one) for one in words.judge_pages()] == []
    measured = words.readability()
    assert measured["long sentences, %"] <= 100.0 * words.LONG_SHARE
    assert measured["words a page"] <= words.WORDS_A_PAGE


def test_messages_are_read_whole_whatever_way_they_are_written() -> None:
    source = (
        '"""A docstring tells."""\n'
        "x = (\n"
        '    f"The poses {a} tell "\n'
        "    'nothing of it.'\n"
        ")\n"
        'y = f"{one + "the turns tell it"!r}"\n'.replace('"the turns tell it"', "'the turns tell it'")
    )
    assert list(words.messages_of(source)) == [
        (2 + 1, "The poses 1 tell nothing of it."),
        (6, "the turns tell it"),
    ]


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("The holds tell nothing of the gyro.", "a recording determines"),
        ("No parameter is foretold.", "a recording determines"),
        ("It rests. Refused are also empty files.", "the subject comes first"),
        ("Simply record again.", "leave the word out"),
        (" ".join(["word"] * 31) + ".", "31 words, 30 at most"),
    ],
)
def test_what_breaks_a_rule_is_found(text: str, rule: str) -> None:
    (finding,) = words.judge(text, "here")
    assert finding.rule.startswith(rule)


@pytest.mark.parametrize(
    "text",
    [
        "The holds determine nothing of the gyro.",
        "Taken by itself, it rests.",
        " ".join(["word"] * 30) + ". " + " ".join(["word"] * 30) + ".",
        "See [a page](../with-a/path-of.md#seven-words-that-do-not-count).",
    ],
)
def test_what_keeps_the_rules_is_left_alone(text: str) -> None:
    assert words.judge(text, "here") == []


def test_code_formulas_and_links_are_no_prose() -> None:
    page = "# A head\n\n```python\ntold = 1\n```\n\n    tumble tell\n\n$$told$$\n\n| a | b c |\n|---|---|\n| d | e |\n"
    assert words.prose_of(page) == ["A head", "a", "b c", "d", "e"]
