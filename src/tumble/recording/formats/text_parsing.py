"""Parsing rows of numbers: compiled where there is nothing else, by polars where there are other cells as well."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from tumble.arrays import Series
from tumble.recording.formats.sentences import CHECKSUM
from tumble.recording.formats.text_layout import ISO_TIME, TextLayout, is_comment, is_number

if TYPE_CHECKING:
    import polars as pl

_MISSING = ["", "NA", "N/A", "na", "null", "NULL", "None", "none", "-", "--", "?"]
Piece: TypeAlias = dict[int, Series]
"""Columns by their index."""

_CHECKSUMS = re.compile(rb"\*[0-9A-Fa-f]{2,4}(?=\s*?$)", re.MULTILINE)


def parse(body: bytes, layout: TextLayout) -> list[Series] | None:
    """Parse whole lines: compiled where all cells are numbers or empty, else by polars.

    Returns
    -------
    The columns of numbers, missing cells as NaN; None if a cell is not a number (see `name_bad_cell`). Three that
    follow each other share one (rows, 3) array: so triads need no further copy if time comes first or last, as it
    mostly does.
    """
    piece = _parsed(body, layout)
    if piece is None:
        return None
    blocks = [np.column_stack([piece[i] for i in g]) for g in _groups(piece, list(layout.number_columns))]
    return _without_blank_rows([block[:, j] for block in blocks for j in range(block.shape[1])])


def _parsed(body: bytes, layout: TextLayout) -> Piece | None:
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
            return {i: table[:rows, i] for i in layout.number_columns}
    frame = _parse_frame(squeeze(body, layout), layout)
    if frame is None:
        return None
    return {
        i: _iso_seconds(frame[str(i)].to_list()) if i in layout.iso_columns else frame[str(i)].to_numpy()
        for i in layout.number_columns
    }


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


def _groups(piece: Piece, numbers: list[int]) -> list[list[int]]:
    """Which columns go side by side: by threes, but for one that grows as time does."""
    groups: list[list[int]] = []
    while numbers:
        alone = len(numbers) < 3 or bool(np.all(np.diff(piece[numbers[0]][:50]) > 0.0))
        groups.append(numbers[: 1 if alone else 3])
        numbers = numbers[len(groups[-1]) :]
    return groups


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
