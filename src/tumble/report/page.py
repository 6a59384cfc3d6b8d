"""A page described once: a title and blocks that say what stands on it, not how it looks.

`report.html` makes a file of it that works offline, `report.terminal` prints it. Text is plain here: what stands
between backticks is code, and only the templates escape.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from typing import Literal

from tumble.records import dataclass
from tumble.report.figures.record import Figure


@dataclass(frozen=True, slots=True)
class Heading:
    """The title of what follows."""

    text: str


@dataclass(frozen=True, slots=True)
class Facts:
    """Names with what they are."""

    pairs: Sequence[tuple[str, str]]


@dataclass(frozen=True, slots=True)
class Sentences:
    """Sentences as a list, as a paragraph each, or as notes to what stands above."""

    sentences: Sequence[str]
    look: Literal["list", "paragraphs", "notes"] = "list"


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
class Figures:
    """Figures that stand together, with one caption that says what to look for."""

    figures: Sequence[Figure]
    caption: str


@dataclass(frozen=True, slots=True)
class Code:
    """Lines to be copied as they are."""

    text: str


@dataclass(frozen=True, slots=True)
class Verdict:
    """The judgement in a few words, and its reasons."""

    fit: bool
    words: str
    reasons: Sequence[str]


@dataclass(frozen=True, slots=True)
class Footer:
    """The last line of a page."""

    text: str


@dataclass(frozen=True, slots=True)
class Blanks:
    """Names of what is written by hand on a printed sheet, a line of them at a time."""

    lines: Sequence[Sequence[str]]


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
class Cards:
    """Steps in their order."""

    cards: Sequence[Card]


Block = Heading | Facts | Sentences | Table | Figures | Code | Verdict | Footer | Blanks | Cards


@dataclass(frozen=True, slots=True)
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
