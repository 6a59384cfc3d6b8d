"""The one place that makes HTML and XML: the templates, which escape what they are given."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from jinja2 import Environment


@cache
def templates(room: str = "report") -> Environment:
    """Return the templates of a room; those of `report` are its pages and what a notebook shows."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader(str(files("tumble") / room / "templates")),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def notebook_html(
    heads: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    title: str = "",
    words: str = "",
    notes: Sequence[str] = (),
    foot: str = "",
) -> str:
    """Return a table as a notebook shows it.

    Parameters
    ----------
    heads, rows : of the table; no heads for a table whose first column names the rows.
    title, words, notes : above it, the notes as a list.
    foot : below it.
    """
    given = {"heads": heads, "rows": rows, "title": title, "words": words, "notes": notes, "foot": foot}
    return templates().get_template("notebook.html").render(given)
