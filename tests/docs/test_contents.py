"""Every page stands in one section of the site, and says there for whom it is."""

from __future__ import annotations

import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs"
sys.path.insert(0, str(DOCS / "site"))

import contents  # noqa: E402  (a script of the documentation, in no package)

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
