"""Text: CSV and its relatives, any delimiter, with or without header.

Read in blocks, of which a small file has one.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import BinaryIO

import numpy as np

from tumble.counting import counted
from tumble.errors import RecordingError
from tumble.files import opened, size_of
from tumble.recording.formats.table import RawTable, hash_file
from tumble.recording.formats.text_layout import (
    COMMENTS,
    TextLayout,
    find_layout,
    is_comment,
    is_number,
)
from tumble.recording.formats.text_parsing import name_bad_cell, parse
from tumble.recording.recording import Remark, Source

NAME = "text"
ENDINGS = (".csv", ".txt", ".tsv", ".dat", ".log", ".mat")
ASKED = 2  # almost anything is text

_HEAD = 64 * 1024
_CHUNK = 16 * 1024 * 1024
LONGEST_LINE = 1 << 20
"""Bytes of a line: a thousand columns of numbers with all digits have 25 kB."""
_FEWEST_LINES = 4  # that the head has, so that a wide table is recognised
_MARKS = (b"\xff\xfe", b"\xfe\xff", b"\xef\xbb\xbf")  # UTF-16 of either order, UTF-8


def recognises(head: bytes) -> bool:
    """Say whether a file that begins so is text."""
    if head.startswith(_MARKS):
        return True
    return b"\0" not in head and sum(b < 9 or 13 < b < 32 for b in head[:1024]) == 0


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


def read_table(path: Path) -> RawTable:
    """Read a text file whole.

    Raises
    ------
    RecordingError
        If the file is empty, holds no rows of numbers, or has a cell that is not a number.
    OSError
        If the file cannot be read.
    """
    first, *others = read_table_blocks(path)
    if others:
        blocks = (first, *others)
        first.columns = [np.concatenate([b.columns[i] for b in blocks]) for i in range(len(first.columns))]
        first.remarks = [remark for block in blocks for remark in block.remarks]
    first.source = hash_file(path)
    return first


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


def read_table_blocks(path: Path) -> Iterator[RawTable]:
    """Read a text file piece by piece, 16 MiB of text at a time.

    The blocks carry no SHA-256 (the file would have to be read twice).

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
    return RawTable(path, _names_of(layout), columns, Source(path.name, ""), remarks)


def _names_of(layout: TextLayout) -> tuple[str, ...] | None:
    """Return the names of the columns that are handed over, or None."""
    return None if layout.header is None else tuple(layout.header[i] for i in layout.number_columns)
