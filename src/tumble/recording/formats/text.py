"""Text: CSV and its relatives, any delimiter, with or without header.

Read in blocks, of which a small file has one.
Rows of numbers are parsed by a compiled loop where there is nothing else, by polars where there are other cells, too.

How a text file is laid out: delimiter, decimal sign, comments, header and the first row of numbers.

Sentences of navigation units have no header: the maker fixes what stands in each cell.

Text exports of Xsens and Movella: MT Manager, MTw and DOT.

The names of the columns are theirs; what they do not say is the unit of the clock and of the gyro, and
that increments of orientation are quaternions.

References
----------
VectorNav, *VN-100 User Manual*, asynchronous ASCII messages (VNIMU, VNYMR, VNQMR, VNMAR): gauss, m/s², rad/s.
Xsens, *MT Low-Level Communication Protocol Documentation* (SampleTimeFine: ticks of 0.1 ms);
Movella, *DOT User Manual* (SampleTimeFine in µs, angular velocity in degrees a second).
"""

from __future__ import annotations

import io
import re
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from tumble.arrays import Series
from tumble.counting import counted
from tumble.errors import RecordingError
from tumble.files import opened, size_of
from tumble.recording.columns import NAMES
from tumble.recording.formats.table import RawTable
from tumble.recording.samples import Remark
from tumble.records import dataclass
from tumble.sample_rates import CRYSTAL, sample_rate
from tumble.units import find_unit

if TYPE_CHECKING:
    import polars as pl

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


@dataclass(frozen=True)
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


_HEAD = 64 * 1024
_CHUNK = 16 * 1024 * 1024
LONGEST_LINE = 1 << 20
"""Bytes of a line: a thousand columns of numbers with all digits have 25 kB."""
_FEWEST_LINES = 4  # that the head has, so that a wide table is recognised
_MARKS = (b"\xff\xfe", b"\xfe\xff", b"\xef\xbb\xbf")  # UTF-16 of either order, UTF-8


def _plain(body: bytes) -> bytes:
    """Return text as UTF-8 without byte order mark and with line feeds."""
    if body.startswith((b"\xff\xfe", b"\xfe\xff")):
        body = body.decode("utf-16", "replace").encode()
    if body.startswith(b"\xef\xbb\xbf"):
        body = body[3:]
    if b"\r" in body[:_HEAD] and b"\n" not in body[:_HEAD]:
        body = body.replace(b"\r", b"\n")
    return body


def _decoded(head: bytes) -> str:
    try:
        return head.decode()
    except UnicodeDecodeError:
        return head.decode("latin-1")


def _layout_of(body: bytes, name: str) -> TextLayout:
    _refuse_long_lines(body[:_CHUNK], name)
    head = body[:_HEAD]
    if body.count(b"\n", 0, _HEAD) < _FEWEST_LINES:
        head = body[: _FEWEST_LINES * LONGEST_LINE]
    if len(body) > len(head) and b"\n" in head:
        head = head[: head.rindex(b"\n") + 1]
    if b"\0" in head:
        raise RecordingError(f"{name} is binary, not text; see the formats page.")
    return find_layout(_decoded(head), name)


def _refuse_long_lines(body: bytes, name: str) -> None:
    """Refuse a text with a line that no table has, which takes many times its size to be parsed."""
    start = 0
    while len(body) - start > LONGEST_LINE:
        end = body.rfind(b"\n", start, start + LONGEST_LINE)
        if end < 0:
            raise RecordingError(
                f"{name} has a line of more than {LONGEST_LINE >> 20} MB, which no table of samples has; give a "
                "recording with one row a sample."
            )
        start = end + 1


def _body_start(body: bytes, first_line: int) -> int:
    start = 0
    for _ in range(first_line - 1):
        start = body.index(b"\n", start) + 1
    return start


def _truncation(tail: str, layout: TextLayout) -> str | None:
    """Say what is wrong with a last line that has no end, or return None.

    A line with all its cells is taken as cut in its last number if that is none any more, or has fewer
    decimals than each of up to 50 rows before it.
    """
    lines = [line.rstrip("\r") for line in tail.removesuffix("\n").split("\n")]
    if not lines or tail.endswith(("\n", "\r")) or is_comment(lines[-1]) or not lines[-1].strip():
        return None
    last = layout.cells(lines[-1])
    if len(last) < layout.columns:
        return f"the last line is cut short ({len(last)} of {layout.columns} columns) and is left out"
    sign = "," if layout.decimal_comma else "."
    others = [layout.cells(line)[-1] for line in lines[-51:-1] if len(layout.cells(line)) == layout.columns]
    decimals = [len(cell.partition(sign)[2]) for cell in others]
    shorter = len(others) >= 10 and len(last[-1].partition(sign)[2]) < min(decimals)
    numbers = any(is_number(cell, layout.decimal_comma) for cell in others)
    if shorter or (numbers and not is_number(last[-1], layout.decimal_comma)):
        return "the last line seems cut in its last number and is left out"
    return None


def _lines(path: Path) -> io.BytesIO:
    with opened(path) as file:
        return io.BytesIO(_plain(file.read()))


def _line(path: Path, layout: TextLayout, start: int, row: int) -> str:
    """Return the line of the file that a row of the block from row `start` on stands in."""
    row += start
    for number, line in enumerate(_lines(path), start=1):
        text = line.strip()
        if number < layout.first_line or not text or text.startswith(tuple(c.encode() for c in COMMENTS)):
            continue
        if row == 0:
            return f"line {number}"
        row -= 1
    return "the last line"


def _layout_remarks(path: Path, layout: TextLayout) -> list[Remark]:
    """Say which lines and columns are not used."""
    header = layout.header
    words = sorted(layout.text_columns - layout.iso_columns)
    notes: list[Remark] = []
    if layout.partial_lines:
        lines = ", ".join(str(n) for n in layout.partial_lines[:5])
        notes.append(Remark("mended", f"{path.name}: incomplete first rows (line {lines}) are left out."))
    if words:
        which = ", ".join(repr(header[i]) if header else str(i + 1) for i in words[:5])
        notes.append(Remark("found", f"{path.name}: columns without numbers ({which}) are not used."))
    return notes


def _pieces(file: BinaryIO, rest: bytes, name: str, size: int) -> Iterator[tuple[bytes, bool]]:
    """Yield pieces of whole lines, and with each whether it is the last one."""
    while rest:
        more = file.read(size)
        _refuse_long_lines(rest, name)
        end = rest.rfind(b"\n") + 1 if more else len(rest)
        body = rest[:end]
        if body and not body.isspace():
            yield body, not more
        rest = rest[end:] + more


def read_tables(path: Path) -> Iterator[RawTable]:
    """Read a text file piece by piece, 16 MiB of text at a time.

    Raises
    ------
    RecordingError
        If the file is empty, holds no rows of numbers, or has a cell that is not a number.
    OSError
        If the file cannot be read.
    """
    with opened(path) as file:
        head = file.read(_CHUNK)
        if head.startswith(_MARKS[:2]) or b"\n" not in head:
            head += file.read()  # UTF-16 and lone carriage returns cannot be cut at a line feed
        head = _plain(head)
        layout = _layout_of(head, path.name)
        rest = head[_body_start(head, layout.first_line) :]
        row = 0
        pieces = _pieces(file, rest, path.name, _CHUNK)
        for body, last in counted(pieces, size_of(path), lambda piece: len(piece[0])):
            table = _block(path, layout, body, last)
            table.remarks += [] if row else _layout_remarks(path, layout)
            table.place = partial(_line, path, layout, row)
            row += len(table)
            yield table


def _block(path: Path, layout: TextLayout, body: bytes, last: bool) -> RawTable:
    """Parse one piece of a file."""
    remarks: list[Remark] = []
    if last and (cut := _truncation(_decoded(body[-_HEAD:]), layout)):
        body = body[: body.rfind(b"\n") + 1]
        remarks.append(Remark("mended", f"{path.name}: {cut}."))
    columns = parse(body, layout)
    if columns is None:
        raise RecordingError(name_bad_cell(_lines(path), layout, path.name))
    return RawTable(path, _names_of(layout), columns, remarks)


def _names_of(layout: TextLayout) -> tuple[str, ...] | None:
    """Return the names of the columns that are handed over, or None."""
    return None if layout.header is None else tuple(layout.header[i] for i in layout.number_columns)


_MISSING = ["", "NA", "N/A", "na", "null", "NULL", "None", "none", "-", "--", "?"]

_CHECKSUMS = re.compile(rb"\*[0-9A-Fa-f]{2,4}(?=\s*?$)", re.MULTILINE)


def parse(body: bytes, layout: TextLayout) -> list[Series] | None:
    """Parse whole lines: compiled where all cells are numbers or empty, else by polars.

    Returns
    -------
    The columns of numbers, missing cells as NaN; None if a cell is not a number (see `name_bad_cell`).
    """
    from tumble.recording.formats.kernels import parse_rows

    if layout.checksums or layout.decimal_comma or layout.quoted:
        body = prepare(body, layout)
    words = layout.text_columns
    if not layout.iso_columns and not (words and (layout.quoted or layout.delimiter is None)):
        numbers = np.frombuffer(body if body.endswith(b"\n") else body + b"\n", np.uint8)
        table = np.empty((np.count_nonzero(numbers == ord("\n")), layout.columns))
        skipped = np.array([i in words for i in range(layout.columns)], dtype=np.uint8)
        rows = parse_rows(numbers, ord(layout.delimiter or "\0"), skipped, table)
        if rows >= 0:
            every = np.ascontiguousarray(table[:rows].T)
            return _without_blank_rows([every[i] for i in layout.number_columns])
    frame = _parse_frame(squeeze(body, layout), layout)
    if frame is None:
        return None
    return _without_blank_rows(
        [
            _iso_seconds(frame[str(i)].to_list()) if i in layout.iso_columns else frame[str(i)].to_numpy()
            for i in layout.number_columns
        ]
    )


def prepare(body: bytes, layout: TextLayout) -> bytes:
    """Return a body with decimal points in place of commas, without checksums and quotes that nothing needs."""
    if layout.checksums:
        body = _CHECKSUMS.sub(b"", body)
    if layout.decimal_comma:
        body = body.replace(b",", b".")
    if layout.quoted and not layout.text_columns:
        body = body.replace(b'"', b"")
    return body


def squeeze(body: bytes, layout: TextLayout) -> bytes:
    """Return text with each run of spaces inside a line as one, which is what polars can split at."""
    if layout.delimiter is not None:
        return body
    if b"\t" in body or b"\r" in body:
        body = body.translate(bytes.maketrans(b"\t\r", b"  "))
    a = np.frombuffer(body, np.uint8)
    space, end = a == 32, a == 10
    keep = np.empty(a.size, bool)
    keep[0] = not space[0]
    # Of a run the first space stays, unless it begins a line.
    np.logical_or(space[:-1], end[:-1], out=keep[1:])
    np.logical_and(keep[1:], space[1:], out=keep[1:])
    np.logical_not(keep[1:], out=keep[1:])
    trailing = bool(np.any(space[:-1] & end[1:]))
    text = body if keep.all() else a[keep].tobytes()
    return text.replace(b" \n", b"\n") if trailing else text


def _parse_frame(body: bytes, layout: TextLayout) -> pl.DataFrame | None:
    """Parse with polars what has decimal points and single spaces (see `prepare`); None if a cell is not a number."""
    import polars as pl

    names = [str(i) for i in range(layout.columns)]
    types = [pl.String if i in layout.text_columns else pl.Float64 for i in range(layout.columns)]
    for missing in (None, _MISSING):  # looking for words in place of numbers costs time
        try:
            return pl.read_csv(
                body,
                has_header=False,
                schema=dict(zip(names, types, strict=True)),
                columns=list(layout.number_columns),
                separator=layout.delimiter or " ",
                comment_prefix=layout.comment,
                quote_char='"' if layout.quoted else None,
                null_values=missing,
                encoding="utf8-lossy",
            )
        except pl.exceptions.PolarsError:
            continue
    return None


def _iso_seconds(cells: list[str | None]) -> Series:
    """Return ISO 8601 times as seconds of the Unix epoch."""
    text = ["NaT" if c is None else c.strip().rstrip("Z").replace(",", ".") for c in cells]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # of time zones, which are dropped
            stamps = np.array(text, dtype="datetime64[ns]")
    except (ValueError, UserWarning):  # a cell that is none: each by itself
        stamps = np.array([_iso_stamp(cell) for cell in text], dtype="datetime64[ns]")
    seconds = (stamps - np.datetime64(0, "ns")) / np.timedelta64(1, "s")
    return np.asarray(seconds, dtype=np.float64)


def _iso_stamp(cell: str) -> np.datetime64:
    """Return an ISO 8601 time, of anything else none."""
    try:
        return np.datetime64(cell if ISO_TIME.fullmatch(cell) else "NaT", "ns")
    except ValueError:
        return np.datetime64("NaT", "ns")


def _without_blank_rows(columns: list[Series]) -> list[Series]:
    """Leave out the rows that are empty in every column (blank lines)."""
    if not columns or not len(columns[0]) or not all(np.isnan(c.sum()) for c in columns):
        return columns
    blank = np.logical_and.reduce([np.isnan(c) for c in columns])
    return [c[~blank] for c in columns] if blank.any() else columns


def name_bad_cell(file: Iterable[bytes], layout: TextLayout, name: str) -> str:
    """Return the sentence on the first cell or row that cannot be read.

    Parameters
    ----------
    file : the lines of the whole file.
    layout : what was expected of them.
    name : the file's name.
    """
    for number, raw in enumerate(file, start=1):
        line = raw.decode("latin-1").strip("\r\n")
        line = CHECKSUM.sub("", line) if layout.checksums else line
        if number < layout.first_line or not line.strip() or is_comment(line):
            continue
        cells = layout.cells(line)
        if len(cells) > layout.columns:
            return (
                f"{name}, line {number} has {len(cells)} columns where the others have {layout.columns}; "
                "mend or delete the line."
            )
        bad = [
            i
            for i, cell in enumerate(cells)
            if i not in layout.text_columns
            and not is_number(cell, layout.decimal_comma and "," in cell)
            and cell not in _MISSING
        ]
        if len(bad) > 1 or (bad and len(cells) < layout.columns):
            return f"{name}, line {number} is text and no row of numbers ({line.strip()[:40]!r}); delete the line."
        for i in bad:
            column = f"column {i + 1}" if layout.header is None else f"column {layout.header[i]!r}"
            return (
                f"{name}, line {number}, {column} holds {cells[i][:30]!r} instead of a number; mend the cell."
            )
    return f"{name} cannot be read as a table of numbers with {layout.columns} columns."


_TICK = 100.0  # µs
_MOST_HERTZ_OF_TICKS = 4000.0
_RATE = re.compile(rb"(?:Update Rate|Sample rate|OutputRate)\s*[:,]+\s*(\d+(?:\.\d+)?)\s*Hz", re.IGNORECASE)
_XSENS_HEAD = 8192


def read_xsens(path: Path) -> Iterator[RawTable]:
    """Read an export of Xsens piece by piece."""
    with opened(path) as file:
        head = file.read(_XSENS_HEAD)
    scale: float | None = None
    for table in read_tables(path):
        scale = _clock(table) if scale is None else scale  # one clock, or none, for all pieces
        yield _interpreted(table, head, scale)


def _interpreted(table: RawTable, head: bytes, scale: float) -> RawTable:
    """Return the table with the columns of the clock and the triads named with their units."""
    if table.names is None:
        return table
    columns = dict(zip(table.names, table.columns, strict=True))
    found = {"t [us]": scale * columns["SampleTimeFine"]} if scale else {}
    found |= _triads(columns, is_dot=b"DeviceTag" in head or b"OutputRate" in head)
    if (temperature := columns.get("Temperature")) is not None:
        found["temperature"] = temperature
    rate = table.rate
    if "t [us]" not in found and (match := _RATE.search(head)):
        rate = sample_rate(f"{float(match.group(1))}±{1e6 * CRYSTAL}ppm")
        text_ = f"{table.path.name} has no stamps; its header says {rate:g} Hz."
        table.remarks.append(Remark("found", text_))
    return replace(table, names=tuple(found), columns=list(found.values()), rate=rate, clock=CRYSTAL)


def _clock(table: RawTable) -> float:
    """Return the stamps' unit in µs: ticks of 0.1 ms with MT units, µs with DOT; zero without stamps."""
    stamps = dict(zip(table.names or (), table.columns, strict=False)).get("SampleTimeFine")
    if stamps is None or not np.all(np.isfinite(stamps)) or stamps.size < 2 or not np.ptp(stamps):
        return 0.0
    step = float(np.median(np.abs(np.diff(stamps))))
    are_ticks = 1e6 / (_TICK * max(step, 1.0)) >= 1.0 and 1e6 / max(step, 1.0) > _MOST_HERTZ_OF_TICKS
    return _TICK if are_ticks else 1.0


def _triads(columns: dict[str, Series], *, is_dot: bool) -> dict[str, Series]:
    """Return the triads: rates where there are any, else increments; and the magnetometer."""
    found: dict[str, Series] = {}
    if {"Acc_X", "Acc_Y", "Acc_Z"} <= set(columns):
        found |= {f"a{a.lower()} [m/s^2]": columns[f"Acc_{a}"] for a in "XYZ"}
    elif names := _present(columns, ("VelInc_X", "VelInc_Y", "VelInc_Z"), ("dV[1]", "dV[2]", "dV[3]")):
        found |= {f"a{a} [m/s]": columns[n] for a, n in zip("xyz", names, strict=True)}
    if {"Gyr_X", "Gyr_Y", "Gyr_Z"} <= set(columns):
        unit = "deg/s" if is_dot else "rad/s"
        found |= {f"g{a.lower()} [{unit}]": columns[f"Gyr_{a}"] for a in "XYZ"}
    elif names := _present(
        columns,
        tuple(f"OriInc_q{i}" for i in range(4)),
        ("dQ_W", "dQ_X", "dQ_Y", "dQ_Z"),
        ("dq_W", "dq_X", "dq_Y", "dq_Z"),
    ):
        turned = _rotation_vectors([columns[n] for n in names])
        found |= {f"g{a} [rad]": v for a, v in zip("xyz", turned, strict=True)}
    if {"Mag_X", "Mag_Y", "Mag_Z"} <= set(columns):
        # In units of the field at the place of Xsens' own calibration: no unit of a field, so counts.
        found |= {f"m{a.lower()} [counts]": columns[f"Mag_{a}"] for a in "XYZ"}
    return found


def _present(columns: dict[str, Series], *choices: tuple[str, ...]) -> tuple[str, ...]:
    """Return the first group of names that are all there, or none."""
    return next((names for names in choices if set(names) <= set(columns)), ())


def _rotation_vectors(quaternion: list[Series]) -> list[Series]:
    """Return the rotation vectors of quaternions, scalar first as the file has them."""
    scalar, vector = quaternion[0], np.stack(quaternion[1:])
    length = np.sqrt(np.sum(vector**2, axis=0))
    angle = 2.0 * np.arctan2(length, np.abs(scalar))
    scale = np.where(length > 0.0, angle / np.where(length > 0.0, length, 1.0), 2.0) * np.where(
        scalar < 0.0, -1.0, 1.0
    )
    return [scale * v for v in vector]
