"""A page on a terminal: tables, sentences and the verdict; figures stay in the HTML page."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from tumble.report.page import Block, Code, Facts, Heading, Sentences, Table, Verdict

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table as RichTable
    from rich.text import Text

# Narrower than this, a terminal shows a table without its spare columns rather than folded.
WIDE_TERMINAL = 104


def print_blocks(blocks: Iterable[Block], console: Console) -> None:
    """Print what a terminal can show, an empty line after each group.

    Parameters
    ----------
    blocks : of a page.
    console : where to.
    """
    for block in blocks:
        if isinstance(block, Table):
            console.print(_rich_table(block, console))
            console.print()
        elif isinstance(block, Sentences):
            mark = "- " if block.look == "list" else ""
            for sentence in block.sentences:
                console.print(f"{mark}{sentence}", markup=False)
            console.print()
        elif isinstance(block, Verdict):
            _print_verdict(block, console)
        elif isinstance(block, Heading):
            console.print(block.text, style="bold", markup=False)
        elif isinstance(block, Facts):
            for name, value in block.pairs:
                console.print(f"{name}: {value}", markup=False)
            console.print()
        elif isinstance(block, Code):
            console.print(block.text, markup=False, soft_wrap=True)


def _print_verdict(verdict: Verdict, console: Console) -> None:
    """Print the verdict in capitals, and its reasons."""
    style = "bold green" if verdict.fit else "bold red"
    console.print(verdict.words.upper(), style=style, markup=False)
    for reason in verdict.reasons:
        console.print(f"- {reason}", markup=False)


def _rich_table(table: Table, console: Console) -> RichTable:
    """Return a table for a terminal, whose console makes harmless what a terminal would obey."""
    from rich import box
    from rich.table import Table as RichTable

    def text(words: str, style: str = "") -> Text:
        return console.render_str(words, style=style, markup=False, emoji=False, highlight=False)

    drawn = RichTable(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False, highlight=False)
    columns = len(table.heads) - (table.spare if console.width < WIDE_TERMINAL else 0)
    for place, head in enumerate(table.heads[:columns]):
        right = place in table.right
        drawn.add_column(text(head), overflow="fold", justify="right" if right else "left")
    for number, row in enumerate(table.rows):
        if table.looks.get(number) == "group":
            if number:
                drawn.add_section()
            drawn.add_row(text(row[0], "bold"))
        else:
            drawn.add_row(*(text(cell) for cell in row[:columns]))
    return drawn


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows as lines of plain text with aligned columns, for files and pipes.

    Parameters
    ----------
    rows : cells, heads first; a row of one cell stands alone, after an empty line.
    """
    most = max(map(len, rows))
    width = [max(len(row[i]) for row in rows if len(row) == most) for i in range(most)]
    lines: list[str] = []
    for row in rows:
        if len(row) < most:
            lines += ["", *row]
        else:
            lines.append("  ".join(cell.ljust(w) for cell, w in zip(row, width, strict=True)).rstrip())
    return lines
