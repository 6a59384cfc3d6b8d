"""Text: CSV and its relatives, any delimiter, with or without header.

Read in blocks, of which a small file has one.
Rows of numbers are parsed by a compiled loop where there is nothing else, by polars where there are other cells, too.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from tumble.arrays import Series
from tumble.counting import counted
from tumble.errors import RecordingError
from tumble.files import opened, size_of
from tumble.recording.formats.table import RawTable
from tumble.recording.formats.text_layout import (
    CHECKSUM,
    COMMENTS,
    ISO_TIME,
    TextLayout,
    find_layout,
    is_comment,
    is_number,
)
from tumble.recording.samples import Remark

if TYPE_CHECKING:
    import polars as pl


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
