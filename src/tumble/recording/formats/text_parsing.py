"""Parsing rows of numbers: by numpy where a file is small, by polars where it is large.

numpy reads about 200 MB/s and is there already; polars reads some 600 MB/s on two cores but takes 0.2 s
to import, which pays from some tens of megabytes on.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series
from tumble.recording.formats.sentences import CHECKSUM
from tumble.recording.formats.table import as_columns
from tumble.recording.formats.text_layout import COMMENTS, ISO_TIME, TextLayout, is_comment, is_number

if TYPE_CHECKING:
    import polars as pl

_MISSING = ["", "NA", "N/A", "na", "null", "NULL", "None", "none", "-", "--", "?"]
_GATHERED_ROWS = 65_536  # three columns of so many rows stay in the cache while they are put side by side


_CHECKSUMS = re.compile(rb"\*[0-9A-Fa-f]{2,4}(?=\s*?$)", re.MULTILINE)


def parse(body: bytes, layout: TextLayout, by_polars: bool) -> list[Series] | None:
    """Parse a piece of a file by numpy where it can be, else by polars.

    Returns
    -------
    The columns of numbers, missing cells as NaN; None if a cell is not a number (see `name_bad_cell`).
    """
    body = prepare(body, layout)
    if not by_polars and not layout.iso_columns:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # numpy warns of an empty piece
            try:
                return _parsed_by_numpy(body, layout)
            except ValueError:
                pass  # missing cells: polars reads them; anything else it refuses too
    return gather([parse_frame(squeeze(body, layout), layout)], layout)


def prepare(body: bytes, layout: TextLayout) -> bytes:
    """Return a body with decimal points in place of commas, without checksums and quotes that nothing needs."""
    if layout.checksums:
        body = _CHECKSUMS.sub(b"", body)
    if layout.decimal_comma:
        body = body.replace(b",", b".")
    if layout.quoted and not layout.text_columns:
        body = body.replace(b'"', b"")
    return body


def _parsed_by_numpy(body: bytes, layout: TextLayout) -> list[Series]:
    """Parse with numpy's reader; raises ValueError at the first cell that is not a number."""
    comment = (
        next((c for c in COMMENTS if c.encode() in body), None) if layout.comment or b"#" in body else None
    )
    every = len(layout.number_columns) == layout.columns
    matrix = np.loadtxt(
        io.BytesIO(body),
        delimiter=layout.delimiter,
        comments=comment,
        usecols=None if every else layout.number_columns,
        ndmin=2,
        encoding="latin-1",
    )
    if matrix.shape[1] != len(layout.number_columns):
        raise ValueError("number of columns changed")
    return as_columns(matrix)


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


def parse_frame(body: bytes, layout: TextLayout) -> pl.DataFrame | None:
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


def gather(frames: Iterable[pl.DataFrame | None], layout: TextLayout) -> list[Series] | None:
    """Return the columns of consecutive frames; three that follow each other share one (rows, 3) array.

    So triads need no further copy if time comes first or last, as it mostly does. The arrays grow with each frame: all
    frames together would take the memory of them again. None where a frame is none.
    """
    numbers = [i for i in layout.number_columns if i not in layout.iso_columns]
    times: dict[int, list[Series]] = {i: [] for i in layout.iso_columns}
    groups, blocks, rows = list[list[int]](), list[npt.NDArray[np.float64]](), 0
    for frame in frames:
        if frame is None:
            return None
        if not rows:
            groups = _groups(frame, numbers)
            blocks = [np.empty((0, len(group))) for group in groups]
        start, rows = rows, rows + frame.height
        for block, group in zip(blocks, groups, strict=True):
            block.resize((rows, len(group)), refcheck=False)
            side_by_side(frame, [str(i) for i in group], block[start:])
        for i, made in times.items():
            made.append(_iso_seconds(frame[str(i)].to_list()))
    columns = {i: np.concatenate(made) for i, made in times.items() if made}
    columns |= {
        i: block[:, j] for group, block in zip(groups, blocks, strict=True) for j, i in enumerate(group)
    }
    return _without_blank_rows([columns[i] for i in layout.number_columns if i in columns])


def side_by_side(frame: pl.DataFrame, names: Sequence[str], block: npt.NDArray[np.float64]) -> None:
    """Copy columns of a frame into a (rows, columns) array, piece by piece."""
    for start in range(0, frame.height, _GATHERED_ROWS):
        piece = frame.slice(start, _GATHERED_ROWS)
        for j, name in enumerate(names):
            block[start : start + piece.height, j] = piece[name].to_numpy()


def _groups(frame: pl.DataFrame, numbers: list[int]) -> list[list[int]]:
    """Which columns go side by side: by threes, but for one that grows as time does."""
    groups: list[list[int]] = []
    while numbers:
        alone = len(numbers) < 3 or _seems_time(frame[str(numbers[0])])
        groups.append(numbers[: 1 if alone else 3])
        numbers = numbers[len(groups[-1]) :]
    return groups


def _seems_time(series: pl.Series) -> bool:
    """Whether a column grows at its beginning: only a hint for `gather`, which columns go together."""
    beginning = series.head(50).to_numpy()
    return bool(np.all(np.diff(beginning) > 0.0))


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
