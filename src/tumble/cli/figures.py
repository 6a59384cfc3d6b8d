"""`--figures`: the figures of a command's pages as files for a paper."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, TypeAlias

from tumble.cli.groups import ADVANCED, option
from tumble.errors import UsageError

FiguresOption: TypeAlias = Annotated[
    str | None,
    option(
        ADVANCED,
        "pdf|svg|png",
        "Also draw the figures of the page for a paper, one column wide, in the folder figures beside it.",
        "--figures",
    ),
]


def check_figures(form: str | None, output: Path | None) -> None:
    """Refuse before minutes of work what cannot be drawn.

    Parameters
    ----------
    form : as asked for, or None.
    output : where the page will be, or None.

    Raises
    ------
    UsageError
        If the form is unknown, no page is written, or the library is not installed.
    """
    if form is None:
        return
    from tumble.report.figures.paper import FORMS, require_library

    if form not in FORMS:
        raise UsageError(f"--figures {form}: give one of {', '.join(FORMS)}.")
    if output is None:
        raise UsageError("--figures draws the figures of the page, and no page is written: give -o FOLDER.")
    require_library()


def draw_figures(form: str | None, files: Iterable[Path]) -> list[Path]:
    """Draw the figures of the pages among files; return what was drawn.

    Parameters
    ----------
    form : as asked for, or None.
    files : that were written.

    Raises
    ------
    OutputError
        If a figure cannot be written.
    """
    if form is None:
        return []
    from tumble.report.figures.paper import draw_page

    return [made for file in files if file.suffix == ".html" for made in draw_page(file, form)]
