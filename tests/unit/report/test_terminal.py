"""A page on a terminal: the console has the last word on what is printed."""

from __future__ import annotations

import io
from typing import Any

import pytest
from rich.console import Console
from rich.text import Text

from tumble.report.page import Sentences, Table, Verdict, aligned, print_blocks


class Harmless(Console):
    """Shows what a terminal would obey."""

    def render_str(self, text: str, **options: Any) -> Text:
        return super().render_str(text.replace("\x1b", "<ESC>"), **options)


def printed(*blocks: Any, width: int = 120) -> str:
    screen = Harmless(file=io.StringIO(), width=width, highlight=False)
    print_blocks(blocks, screen)
    assert isinstance(screen.file, io.StringIO)
    return screen.file.getvalue()


def test_nothing_of_a_table_reaches_the_terminal_past_the_console() -> None:
    rows = [["\x1b[2Jgroup"], ["\x1b[2Jcell", "[red]1[/red]", ":smile:"]]
    text = printed(Table(["\x1b[2Jhead", "b", "c"], rows, {0: "group"}))
    assert "\x1b" not in text
    assert text.count("<ESC>[2J") == 3
    assert "[red]1[/red]" in text
    assert ":smile:" in text


@pytest.mark.parametrize(("width", "shown"), [(120, True), (80, False)])
def test_a_narrow_terminal_leaves_out_the_spare_columns(width: int, shown: bool) -> None:
    text = printed(Table(["a", "b", "c"], [["first", "second", "third"]], spare=1), width=width)
    assert "second" in text
    assert ("third" in text) == shown


def test_a_verdict_is_in_capitals_and_its_reasons_stand_below() -> None:
    text = printed(Sentences(["One.", "Two."]), Verdict(False, "Does not serve", ["It drifts [a lot]."]))
    assert text == "- One.\n- Two.\n\nDOES NOT SERVE\n- It drifts [a lot].\n"


def test_lines_are_aligned_and_a_row_of_one_cell_stands_alone() -> None:
    rows = [["name", "value"], ["group"], ["long name", "1"]]
    assert aligned(rows) == ["name       value", "", "group", "long name  1"]
