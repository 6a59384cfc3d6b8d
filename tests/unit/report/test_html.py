"""How a page looks as HTML: signs, code, and tables that stand on the screen with their last column."""

from __future__ import annotations

import re

import pytest

from tumble.report.html import render_page
from tumble.report.page import Figures, Page, Sentences, Table, section


def cells(table: Table) -> list[str]:
    return re.findall(r"<td[^>]*>(.*?)</td>", render_page(Page("Cells", [table])))


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("-0.5 ± 0.1", "−0.5 ± 0.1"),
        ("[-0.5, -.25]", "[−0.5, −.25]"),
        ("3.2e-05", "3.2e−05"),
        ("(1.2 ± 0.3)e-4", "(1.2 ± 0.3)e−4"),
        ("edge of -x and +y", "edge of −x and +y"),
        ("non-orthogonality yz", "non-orthogonality yz"),
        ("step-003.csv of 2026-01-02", "step-003.csv of 2026-01-02"),
        ("--turn-on-bias", "--turn-on-bias"),
    ],
)
def test_a_minus_is_a_minus_and_a_hyphen_a_hyphen(text: str, shown: str) -> None:
    assert cells(Table(["what"], [[text]])) == [shown]
    assert cells(Table(["what"], [[text]], verbatim=True)) == [text]


def test_what_stands_between_backticks_is_code_and_a_single_one_is_itself() -> None:
    page = render_page(Page("Code", [Sentences(["Say `tumble <x>` twice.", "A ` alone."])]))
    assert "Say <code>tumble &lt;x&gt;</code> twice." in page
    assert "A ` alone." in page


def test_many_columns_may_be_broader_than_the_text_and_long_words_fold() -> None:
    """At 1280 pixels no table has to be moved sideways: fourteen columns are the most that a report has."""
    many = render_page(Page("Many", [Table([f"source {k}" for k in range(14)], [["1.2e-05"] * 14])]))
    assert '<div class="scroll broad"><table class="dense">' in many
    words = "accelerometer bias 77 %, accelerometer scale and angles 17 %"
    few = render_page(Page("Few", [Table(["after", "most of it from"], [["10 s", words]])]))
    assert f'<td class="words">{words}</td>' in few
    assert "broad" not in few.split("</style>")[1]


def test_a_page_without_figures_brings_no_script_and_may_run_none() -> None:
    page = render_page(Page("Words", section("Nothing", Sentences(["Nothing."]))))
    assert "<script" not in page
    assert "script-src" not in page


def test_sentences_that_are_none_leave_no_empty_list() -> None:
    assert len(section("Nothing", Sentences([]), Figures([], "none"))) == 2
