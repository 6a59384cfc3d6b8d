"""The page of Zhang et al. (2010) says what the command says at 500 repetitions."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tumble.reproduction.items import run_item
from tumble_papers.catalogue import ITEMS

PAGE = Path(__file__).resolve().parents[2] / "docs" / "papers" / "zhang-2010.md"
SAID = dict(
    re.findall(r"^    (zhang-\S+): (\d+ of \d+ rows inside|not judged)$", PAGE.read_text("utf-8"), re.M)
)
# Their own page is that of poses; and what navigates has tests of its own, as it takes a minute.
ELSEWHERE = {"zhang-sensitivity", "zhang-designs", "zhang-figure-7", "zhang-figure-10"}


def test_the_page_has_every_item() -> None:
    assert list(SAID) == [name for name in ITEMS if name.startswith("zhang")]


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(SAID) - ELSEWHERE))
def test_as_many_rows_are_inside_as_the_page_says(name: str) -> None:
    inside, judged = run_item(ITEMS[name], 500, 0).counts
    assert (f"{inside} of {judged} rows inside" if judged else "not judged") == SAID[name]
