"""What is a number, a line and a hidden character is said once."""

from __future__ import annotations

import pytest

from tumble.files import lines_of, number_of, shown


@pytest.mark.parametrize("value", [1, 1.0, "1", " +1.0e0 "])
def test_numbers_are_numbers(value: object) -> None:
    assert number_of(value) == 1.0


@pytest.mark.parametrize(
    "value",
    [
        True,
        None,
        [],
        "",
        "x",
        "1_0",
        "\u0661",
        "nan",
        "inf",
        "1e999",
        10**400,
        float("inf"),
        "1" * 5000,
        "0x10",
    ],
)
def test_everything_else_is_none(value: object) -> None:
    with pytest.raises(ValueError, match=r"number|finite|large"):
        number_of(value)


def test_a_line_ends_where_an_editor_ends_it() -> None:
    assert lines_of("a\x0cb\u2028c\x85d\x0be\r\nf\rg\n") == ["a\x0cb\u2028c\x85d\x0be", "f", "g"]


def test_hidden_characters_are_shown_by_their_numbers() -> None:
    assert shown("a\x1b[2J\nb\u202ec") == "a<U+001B>[2J<U+000A>b<U+202E>c"
    assert shown("Größe 1 µm") == "Größe 1 µm"
