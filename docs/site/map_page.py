"""The floors of the house, from their contract; rows of tables, from the records.

`python docs/site/map_page.py` (or `make map`) writes them anew: the floors into `docs/architecture.md`, between two
marks, and rows into the tables of procedures and of optional terms. A test fails when a page is behind the source.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from pathlib import Path

from tumble.calibration import PROCEDURES, TERMS

HERE = Path(__file__).resolve().parent
PAGE = HERE.parent / "architecture.md"
SOURCE = HERE.parents[1] / "src"


def floors() -> str:
    """Return the contract that imports point down, a floor a line, from the top."""
    settings = tomllib.loads((SOURCE.parent / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = settings["tool"]["importlinter"]["contracts"]
    (layers,) = (one["layers"] for one in contracts if one["id"] == "floors")
    return "\n".join(["```", *layers, "```", ""])


def page_with_floors(text: str) -> str:
    """Return the page with what is made of the source, between its marks.

    Raises
    ------
    ValueError
        If the marks are not there.
    """
    begin, end = "<!-- floors: made by `make map` -->\n", "<!-- /floors -->\n"
    start = text.index(begin) + len(begin)
    return f"{text[:start]}\n{floors()}\n{text[text.index(end) :]}"


def pages_with_tables() -> dict[Path, str]:
    """Return the pages that have a table of records, with the rows that the records have now."""
    docs = PAGE.parent
    return {
        page: with_rows(page.read_text(encoding="utf-8"), heading, [record.row for record in records])
        for page, heading, records in (
            (
                docs / "procedures" / "index.md",
                "| you have | procedure | needs | gives |",
                PROCEDURES.values(),
            ),
            (docs / "joint.md", "| term | unknowns | tried | what it is good for |", TERMS.values()),
        )
    }


def with_rows(text: str, heading: str, rows: Sequence[str]) -> str:
    """Return a page with the rows under a table's heading: in the order that they stand in, new ones last.

    Raises
    ------
    ValueError
        If there is no such table.
    """
    lines = text.split("\n")
    start = lines.index(heading) + 2
    stop = next(i for i in range(start, len(lines)) if not lines[i].startswith("|"))
    names = [_name_of(line) for line in lines[start:stop]]
    placed = sorted(
        rows, key=lambda row: names.index(name) if (name := _name_of(row)) in names else len(names)
    )
    return "\n".join([*lines[:start], *placed, *lines[stop:]])


def _name_of(row: str) -> str:
    """The first name of a row, in backquotes or brackets."""
    found = re.search(r"`([^`]+)`|\[([^]]+)\]", row)
    return "" if found is None else found[1] or found[2]


if __name__ == "__main__":
    for page, made in pages_with_tables().items():
        page.write_text(made, encoding="utf-8")
    PAGE.write_text(page_with_floors(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
