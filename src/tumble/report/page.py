"""A page described once: a title and blocks that say what stands on it, not how it looks.

`report.html` makes a file of it that works offline, `print_blocks` shows it on a terminal, without figures. Text is
plain here: what stands between backticks is code, and only the templates escape.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from typing import TYPE_CHECKING, Literal

from tumble.records import dataclass
from tumble.report.figures.record import Figure

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table as RichTable
    from rich.text import Text


@dataclass(frozen=True)
class Heading:
    """The title of what follows."""

    text: str


@dataclass(frozen=True)
class Facts:
    """Names with what they are."""

    pairs: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Sentences:
    """Sentences as a list, as a paragraph each, or as notes to what stands above."""

    sentences: Sequence[str]
    look: Literal["list", "paragraphs", "notes"] = "list"


@dataclass(frozen=True)
class Table:
    """Rows of text under heads.

    Attributes
    ----------
    heads : one for each column.
    rows : cells; a row of one cell goes across all columns.
    looks : of some rows, by their number: "group", "why" (of the row above), "first", "chosen", "unseen".
    right : columns that are set to the right.
    verbatim : numbers are to be copied, and keep the minus of the keyboard.
    folded : a summary under which the table is folded away; empty for a table that stands open.
    spare : how many of the last columns a narrow terminal leaves out.
    """

    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    looks: Mapping[int, str] = field(default_factory=dict[int, str])
    right: Sequence[int] = ()
    verbatim: bool = False
    folded: str = ""
    spare: int = 0


@dataclass(frozen=True)
class Figures:
    """Figures that stand together, with one caption that says what to look for."""

    figures: Sequence[Figure]
    caption: str


@dataclass(frozen=True)
class Code:
    """Lines to be copied as they are."""

    text: str


@dataclass(frozen=True)
class Verdict:
    """The judgement in a few words, and its reasons."""

    fit: bool
    words: str
    reasons: Sequence[str]


@dataclass(frozen=True)
class Footer:
    """The last line of a page."""

    text: str


@dataclass(frozen=True)
class Blanks:
    """Names of what is written by hand on a printed sheet, a line of them at a time."""

    lines: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Card:
    """One step on a printed sheet, with a box to tick.

    Attributes
    ----------
    name : after its number.
    svg, arrow : a drawing of the unit, or an arrow that shows which way it is turned; else empty.
    lines : what to do; what stands between backticks is emphasised.
    note : in small print.
    blanks : (what is to be written down, its unit).
    """

    name: str
    lines: Sequence[str]
    svg: str = ""
    arrow: str = ""
    note: str = ""
    blanks: Sequence[tuple[str, str]] = ()


@dataclass(frozen=True)
class Cards:
    """Steps in their order."""

    cards: Sequence[Card]


Block = Heading | Facts | Sentences | Table | Figures | Code | Verdict | Footer | Blanks | Cards


@dataclass(frozen=True)
class Page:
    """A title, and blocks from top to bottom; `wide` for tables of many columns."""

    title: str
    blocks: Sequence[Block]
    wide: bool = False

    @property
    def figures(self) -> list[Figure]:
        """All figures of the page, in order."""
        return [figure for block in self.blocks if isinstance(block, Figures) for figure in block.figures]


def section(title: str, *blocks: Block | Iterable[Block]) -> list[Block]:
    """Return a heading with what follows it.

    Parameters
    ----------
    title : of the section.
    blocks : or groups of them; sentences that are none are left away.
    """
    return [Heading(title), *_flat(blocks)]


def _flat(blocks: Iterable[Block | Iterable[Block]]) -> Iterator[Block]:
    for block in blocks:
        if isinstance(block, Iterable):
            yield from _flat(block)
        elif not (isinstance(block, Sentences) and not block.sentences):
            yield block


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
