"""The site's own scripts: every page in one section, the map that of the source, the rules of docs/style.md kept."""

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS / "site"))

# Scripts of the documentation, in no package.
import contents  # noqa: E402
import words  # noqa: E402
from map_page import page_with_floors, pages_with_tables  # noqa: E402

# `make docs` writes more into docs/reference.
PAGES = sorted(
    page.relative_to(DOCS).with_suffix("").as_posix()
    for page in DOCS.rglob("*.md")
    if DOCS / "reference" not in page.parents and page != DOCS / "index.md"
)


def test_every_page_stands_in_one_section() -> None:
    assert {page: contents.sections_of(page) for page in PAGES if len(contents.sections_of(page)) != 1} == {}
    assert set(contents.READERS) == set(contents.CONTENTS)


def test_every_entry_leads_to_a_page() -> None:
    named = {one for pages in contents.CONTENTS.values() for one in pages if "*" not in one}
    assert {one for one in named if not one.startswith("reference/")} <= set(PAGES)


def test_a_page_says_for_whom_it_is() -> None:
    for page in PAGES:
        text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
        title, empty, said = contents.with_reader(page, text).splitlines()[:3]
        assert text.startswith(title)
        assert (empty, said) == ("", f"*{contents.READERS[contents.sections_of(page)[0]]}*")
    assert contents.with_reader("nowhere", "# A\n\nb\n") == "# A\n\nb\n"


# --- the map of the house

MAP = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
QUESTIONS = MAP[MAP.index("## Where is") : MAP.index("## How do I add")]
ADDING = MAP[MAP.index("## How do I add") : MAP.index("## Rules")]


def test_the_floors_are_those_of_the_contract() -> None:
    assert page_with_floors(MAP) == MAP, "the floors are behind the contract: run `make map`"


def test_the_map_fits_two_screens() -> None:
    assert len(MAP.splitlines()) <= 110
    assert len(MAP.split()) <= 700


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


# --- messages, help and pages keep the rules


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
