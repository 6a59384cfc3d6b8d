"""The map of the house is that of the source, and what it points to is there."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs" / "site"))

from map_page import page_with_floors, pages_with_tables  # noqa: E402  (a script of the documentation, in no package)

PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
QUESTIONS = PAGE[PAGE.index("## Where is") : PAGE.index("## How do I add")]
ADDING = PAGE[PAGE.index("## How do I add") : PAGE.index("## Rules")]


def test_the_floors_are_those_of_the_contract() -> None:
    assert page_with_floors(PAGE) == PAGE, "the floors are behind the contract: run `make map`"


def test_the_map_fits_two_screens() -> None:
    assert len(PAGE.splitlines()) <= 110
    assert len(PAGE.split()) <= 700


def test_tables_of_records_have_the_records_rows() -> None:
    for page, made in pages_with_tables().items():
        assert made == page.read_text(encoding="utf-8"), f"{page.name} is behind the source: run `make map`"


@pytest.mark.parametrize(("room", "modules"), re.findall(r"`([a-z_.]+)` → ((?:`\w+`(?:, )?)+)", QUESTIONS))
def test_an_answer_names_a_module_that_is_there(room: str, modules: str) -> None:
    for name in re.findall(r"`(\w+)`", modules):
        assert (ROOT / "src" / "tumble" / room.replace(".", "/") / f"{name}.py").is_file()


@pytest.mark.parametrize("place", re.findall(r"`([a-z_]+/[a-z_/.]+)`", ADDING))
def test_where_something_is_added_is_there(place: str) -> None:
    assert (ROOT / "src" / "tumble" / place).exists()


SCIENCE = (ROOT / "docs" / "science.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("place", sorted(set(re.findall(r"`((?:\w+/)*\w+\.\w+)`", SCIENCE))))
def test_an_equation_stands_where_the_page_of_science_says(place: str) -> None:
    module, _, name = place.rpartition(".")
    texts = [path.read_text("utf-8") for path in (ROOT / "src" / "tumble").rglob(f"{module}.py")]
    assert any(name == "py" or re.search(rf"^ *(def|class) {name}\b", text, re.M) for text in texts)
