"""How a text file is laid out: delimiter, decimal sign, comments, header and the first row of numbers.

Sentences of navigation units have no header: the maker fixes what stands in each cell.

References
----------
VectorNav, *VN-100 User Manual*, asynchronous ASCII messages (VNIMU, VNYMR, VNQMR, VNMAR): gauss, m/s², rad/s.
"""

from __future__ import annotations

import re
from collections import Counter
from itertools import islice

from tumble.errors import RecordingError
from tumble.recording.columns import NAMES
from tumble.records import dataclass
from tumble.units import find_unit

CHECKSUM = re.compile(r"\*[0-9A-Fa-f]{2,4}\s*$")
"""What a sentence ends with."""

_CELLS = {kind: tuple(cells.split(",")) for kind, cells in NAMES["VectorNav"].items()}


def names_of_sentence(cells: list[str]) -> tuple[str, ...] | None:
    """Return the names of the columns of a row that is, or has in it, a sentence; None of any other row.

    Parameters
    ----------
    cells : of one row, without the checksum.

    Examples
    --------
    >>> names_of_sentence(["12.5", "$VNMAR", *"123456789"])[:4]
    ('t', 'sentence', 'mx [gauss]', 'my [gauss]')
    """
    where = next((i for i, cell in enumerate(cells) if cell in _CELLS), None)
    if where is None or where > 1:
        return None
    names = _CELLS[cells[where]]
    return ("t",) * where + ("sentence", *names) if len(cells) == where + 1 + len(names) else None


COMMENTS = ("#", "%", "//", "!")
"""What a comment line may begin with."""

MOST_COLUMNS = 2000
_SPLIT_ANY = re.compile(r"[;,\t|\s]+")
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
ISO_TIME = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:[.,]\d+)?Z?")
_SAMPLE_LINES = 200
_PADDED = 3  # columns of whole numbers that begin with a zero; one may be the time of day
_NO_UNIT = ("", "-", "1", "na", "n/a")


@dataclass(frozen=True, slots=True)
class TextLayout:
    """Where the numbers of a text file are.

    Attributes
    ----------
    delimiter : one character, or None for any run of white space.
    decimal_comma : whether the numbers are written 1,5.
    header : names of the columns, or None.
    columns : number of columns of a full row.
    first_line : number (from 1) of the line with the first full row.
    text_columns : indices of columns that hold text or nothing.
    iso_columns : indices of columns that hold ISO 8601 date and time.
    comment : what comment lines begin with, or None if none was seen.
    quoted : whether cells stand in double quotes.
    partial_lines : numbers of incomplete rows before the first full one.
    checksums : whether each row ends with a checksum, as ``*5E``.
    """

    delimiter: str | None
    decimal_comma: bool
    header: tuple[str, ...] | None
    columns: int
    first_line: int
    text_columns: frozenset[int] = frozenset()
    iso_columns: frozenset[int] = frozenset()
    comment: str | None = None
    quoted: bool = False
    partial_lines: tuple[int, ...] = ()
    checksums: bool = False

    @property
    def number_columns(self) -> tuple[int, ...]:
        """Indices of the columns that hold numbers (or ISO times)."""
        skipped = self.text_columns - self.iso_columns
        return tuple(i for i in range(self.columns) if i not in skipped)

    def cells(self, line: str) -> list[str]:
        """Return the cells of one line, without quotes and surrounding space."""
        return _split_cells(line, self.delimiter)


def _split_cells(line: str, delimiter: str | None) -> list[str]:
    """Return the cells of one line, without quotes and surrounding space."""
    cells = line.split() if delimiter is None else line.split(delimiter)
    return [cell.strip().strip('"').strip() for cell in cells]


def is_number(cell: str, decimal_comma: bool = False) -> bool:
    """Say whether a cell reads as a number (nan and inf do, an empty cell does not)."""
    try:
        float(cell.replace(",", ".", 1) if decimal_comma else cell)
    except ValueError:
        return False
    return "_" not in cell


def is_comment(line: str) -> bool:
    """Say whether a line is a comment."""
    return line.lstrip().startswith(COMMENTS)


def _is_row(line: str) -> bool:
    """A row has at least two numbers, and they are at least half of what it holds."""
    if not line.strip() or is_comment(line):
        return False
    cells = [c.strip('"') for c in _SPLIT_ANY.split(line.strip()) if c]
    numbers = sum(is_number(c) for c in cells)
    return numbers >= 2 and 2 * numbers >= len(cells)


def _find_delimiter(rows: list[str], before: list[str]) -> tuple[str | None, bool]:
    """Return the delimiter and whether the decimal sign is a comma; `before` are the lines before the rows."""

    def commas(cells: list[str]) -> bool:
        filled = [c for c in cells if c]
        return any(_DECIMAL_COMMA.fullmatch(c) for c in filled) and not any("." in c for c in filled)

    for candidate in (";", "\t", "|"):
        if all(candidate in row for row in rows):
            cells = [_split_cells(row, candidate) for row in rows]
            blank = sum(any(not c for c in row[:-1]) for row in cells)
            if candidate == "\t" and 2 * blank > len(cells) and not _are_names(before, len(cells[0])):
                break  # runs of tabs used to align columns
            return candidate, all(commas(row) for row in cells)
    if all("," in row for row in rows):
        words = [row.split() for row in rows]
        if all(len(w) > 1 and commas(w) and all("," not in c[-1:] for c in w) for w in words):
            return None, True
        return ",", False
    return None, False


def _are_names(lines: list[str], count: int) -> bool:
    """Whether one of some lines has a name between each two of `count` - 1 tabs: cells may then be empty."""
    cells = [line.split("\t") for line in lines[-8:]]
    return any(len(c) == count and all(name.strip() for name in c) for c in cells)


def _joined_brackets(cells: list[str]) -> list[str]:
    """Join 'ax', '[m/s^2]' into one name where a header is split at spaces."""
    joined: list[str] = []
    for cell in cells:
        if joined and (cell[:1] in "[(" or joined[-1].count("[") > joined[-1].count("]")):
            joined[-1] += " " + cell
        else:
            joined.append(cell)
    return joined


def _is_units_row(cells: list[str]) -> bool:
    kinds = ("specific force", "angular rate", "time", "temperature", "velocity increment", "angle increment")
    bare = [c.strip("[]()") for c in cells]
    known = [any(find_unit(k, c) for k in kinds) for c in bare if c not in _NO_UNIT]
    return len(known) >= 3 and all(known)


def _find_header(before: list[str], delimiter: str | None, columns: int) -> tuple[str, ...] | None:
    """Return the names in the last line before the rows that has one cell a column."""
    units: list[str] | None = None
    for line in reversed(before[-8:]):
        text = line.strip().lstrip("#%!/ ") if is_comment(line) else line.strip()
        options = [_split_cells(text, delimiter)]
        if delimiter is None:
            options += [_joined_brackets(options[0]), _split_cells(text, ",")]
        elif delimiter != ",":
            options.append(_split_cells(text, ","))
        for cells in options:
            if len(cells) != columns or any(is_number(c) for c in cells) or not any(cells):
                continue
            if units is None and _is_units_row(cells):
                units = cells
                break
            if units is None:
                return tuple(cells)
            bare = [u.strip("[]()") for u in units]
            return tuple(f"{c} [{u}]" if u not in _NO_UNIT else c for c, u in zip(cells, bare, strict=True))
    return None


def find_layout(head: str, name: str) -> TextLayout:
    """Find out how a text file is laid out from its beginning.

    Parameters
    ----------
    head : the first tens of kilobytes of the file, ending at a line's end where possible.
    name : the file's name, for messages.

    Raises
    ------
    RecordingError
        If the file is empty, has a header and no rows, or holds no rows of numbers at all.
    """
    lines = [line.rstrip("\r") for line in head.split("\n")]  # as the rows are cut, not as Unicode ends lines
    if not any(line.strip() for line in lines):
        raise RecordingError(f"{name} is empty; give a recording with one row a sample.")
    numbers = list(islice((i for i, line in enumerate(lines) if _is_row(line)), _SAMPLE_LINES))
    if not numbers:
        raise RecordingError(_no_rows(lines, name))
    rows = [lines[i] for i in numbers]
    checksums = all(CHECKSUM.search(row) for row in rows)
    rows = [CHECKSUM.sub("", row) for row in rows] if checksums else rows
    delimiter, decimal_comma = _find_delimiter(rows, lines[: numbers[0]])
    cells = [_split_cells(row, delimiter) for row in rows]
    columns = Counter(len(c) for c in cells).most_common(1)[0][0]
    if columns > MOST_COLUMNS:
        raise RecordingError(
            f"{name} has {columns} columns, and tables of more than {MOST_COLUMNS} are not read; save those of the IMU "
            "alone."
        )
    full = [i for i, c in zip(numbers, cells, strict=True) if len(c) == columns]
    partial = tuple(i + 1 for i in numbers if i < full[0])
    sample = [c for c in cells if len(c) == columns]
    words, iso = _text_columns(sample, columns, decimal_comma)
    if delimiter == "," and _are_halves(sample, lines[: full[0]]):
        raise RecordingError(
            f"{name} has decimal commas, and commas between its columns too ({rows[0].strip()[:30]}): nothing shows "
            "which is which. Save it with semicolons or tabs between the columns, or with decimal points."
        )
    before = [line for line in lines[: full[0]] if line.strip() and not _is_row(line)]
    comments = [line.lstrip() for line in lines if is_comment(line)]
    return TextLayout(
        delimiter=delimiter,
        decimal_comma=decimal_comma,
        header=_find_header(before, delimiter, columns) or names_of_sentence(sample[0]),
        columns=columns,
        first_line=full[0] + 1,
        text_columns=words,
        iso_columns=iso,
        comment=next((c for c in COMMENTS if comments and comments[-1].startswith(c)), None),
        quoted=any('"' in row for row in rows),
        partial_lines=partial,
        checksums=checksums,
    )


def _are_halves(sample: list[list[str]], before: list[str]) -> bool:
    """Whether cells between commas are halves of numbers with decimal commas: 9,81 as 9 and 81.

    Every second one is then of digits alone, and some show that they are no whole numbers: -0 before the comma, 03
    behind it in three columns, or half as many names above them.
    """
    whole = [cell for row in sample for cell in row[::2]]
    parts = [[row[i] for row in sample] for i in range(1, len(sample[0]), 2)]
    if len(sample[0]) % 2 or not all(re.fullmatch(r"[+-]?\d+", cell) for cell in whole):
        return False
    if not all(cell.isascii() and cell.isdigit() for part in parts for cell in part):
        return False
    padded = sum(any(len(cell) > 1 and cell[0] == "0" for cell in part) for part in parts)
    names = [_split_cells(line, ",") for line in before if not is_comment(line)]
    halved = any(len(n) == len(parts) and not any(is_number(c) for c in n) for n in names)
    return "-0" in whole or padded >= _PADDED or halved


def _text_columns(
    sample: list[list[str]], columns: int, decimal_comma: bool
) -> tuple[frozenset[int], frozenset[int]]:
    """Return which columns hold no numbers in most rows, and which of those hold ISO times."""
    words: set[int] = set()
    iso: set[int] = set()
    for i in range(columns):
        cells = [row[i] for row in sample]
        filled = [cell for cell in cells if cell]
        if filled and all(is_number(cell, decimal_comma) for cell in filled):
            continue  # empty cells are those of a slower sensor
        if 2 * sum(is_number(c, decimal_comma) for c in cells) <= len(cells):
            words.add(i)
            if all(ISO_TIME.fullmatch(c) for c in cells):
                iso.add(i)
    return frozenset(words), frozenset(iso)


def _no_rows(lines: list[str], name: str) -> str:
    """Say what a text without rows of numbers seems to be."""
    filled = [line for line in lines if line.strip()]
    cells = [_split_cells(filled[-1], d) for d in (",", ";", "\t", None)]
    if len(filled) <= 3 and max(len(c) for c in cells) >= 4:
        return f"{name} has a header but no rows of numbers; was the recording started?"
    if all(is_number(line.strip()) for line in filled[:50]):
        return (
            f"{name} has a single column of numbers; a recording needs at least the three columns "
            "of one triad (see the formats page)."
        )
    return (
        f"{name} holds text without rows of numbers (line 1 begins {filled[0].strip()[:30]!r}); "
        "give a table with one row a sample, such as t,ax,ay,az,gx,gy,gz."
    )
