"""Text: CSV and its relatives, any delimiter, with or without header, compressed or not.

Small files are parsed by numpy, large ones by polars: numpy reads about 150 MB/s and is there already,
polars reads about 400 MB/s but takes 0.2 s to import, which pays from some 50 MB on.
"""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import Series
from tumble.errors import RecordingError
from tumble.recording.formats.table import RawTable, as_columns, hash_file
from tumble.recording.formats.text_layout import (
    COMMENTS,
    TextLayout,
    find_layout,
    is_comment,
    is_number,
)
from tumble.recording.recording import Remark, Source

if TYPE_CHECKING:
    import polars as pl

NAME = "text"
ENDINGS = (".csv", ".txt", ".tsv", ".dat", ".log", ".mat", ".gz", ".bz2", ".xz")
SUMMARY = "text with any delimiter, with or without header, also compressed (.gz, .bz2, .xz)"

_HEAD = 64 * 1024
_NUMPY_LIMIT = 32 * 1024 * 1024
_CHUNK = 16 * 1024 * 1024
_MISSING = ["", "NA", "N/A", "na", "null", "NULL", "None", "none", "-", "--", "?"]
_OPENERS: dict[bytes, Callable[[Path], io.BufferedIOBase]] = {
    b"\x1f\x8b": lambda path: gzip.GzipFile(path),
    b"BZh": lambda path: bz2.BZ2File(path),
    b"\xfd7zXZ": lambda path: lzma.LZMAFile(path),  # noqa: SIM115
}


def recognises(head: bytes) -> bool:
    """Say whether a file that begins so is text (or compressed, which may hold text)."""
    if head.startswith((*_OPENERS, b"\xff\xfe", b"\xfe\xff")):
        return True
    return b"\0" not in head and sum(b < 9 or 13 < b < 32 for b in head[:1024]) == 0


def _open_plain(path: Path) -> io.BufferedIOBase:
    return path.open("rb")


def _opener(path: Path) -> Callable[[Path], io.BufferedIOBase] | None:
    with path.open("rb") as file:
        magic = file.read(6)
    return next((opener for start, opener in _OPENERS.items() if magic.startswith(start)), None)


def _read_all(path: Path) -> tuple[bytes, list[Remark]]:
    """Return a file's bytes, decompressed; a compressed file that is cut short gives what is there."""
    opener = _opener(path)
    if opener is None:
        return path.read_bytes(), []
    parts: list[bytes] = []
    try:
        with opener(path) as file:
            while part := file.read(1 << 20):
                parts.append(part)
    except (EOFError, lzma.LZMAError, OSError) as error:
        if not parts:
            raise RecordingError(f"{path.name} is compressed and damaged ({error}).") from error
        return b"".join(parts), [
            Remark("mended", f"{path.name}: the compressed file is cut short; what could be read is used.")
        ]
    return b"".join(parts), []


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
    head = body[:_HEAD]
    if len(body) > _HEAD and b"\n" in head:
        head = head[: head.rindex(b"\n") + 1]
    if b"\0" in head:
        raise RecordingError(f"{name} is binary, not text, once decompressed; see the formats page.")
    return find_layout(_decoded(head), name)


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
    lines = tail.splitlines()
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


def _line_finder(path: Path, layout: TextLayout) -> Callable[[int], str]:
    """Return a function from a row's number to its line in the file."""

    def place(row: int) -> str:
        with io.BytesIO(_plain(_read_all(path)[0])) as file:
            for number, line in enumerate(file, start=1):
                text = line.strip()
                if (
                    number < layout.first_line
                    or not text
                    or text.startswith(tuple(c.encode() for c in COMMENTS))
                ):
                    continue
                if row == 0:
                    return f"line {number}"
                row -= 1
        return "the last line"

    return place


# -- parsing ---------------------------------------------------------------------------------------


def _prepared(body: bytes, layout: TextLayout) -> bytes:
    """Return the body with decimal points and without quotes."""
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


def _squeezed(body: bytes) -> bytes:
    """Return the text with each run of white space inside a line as one space."""
    a = np.frombuffer(body.translate(bytes.maketrans(b"\t\r", b"  ")), np.uint8)
    space, end = a == 32, a == 10
    keep = np.ones(a.size, bool)
    keep[1:] = ~(space[1:] & (space[:-1] | end[:-1]))
    keep[0] = not space[0]
    keep[:-1] &= ~(space[:-1] & end[1:])
    # Spaces before a line's end come in runs: the first of the run stays unless it is that end's.
    out = a[keep]
    before_end = (out[:-1] == 32) & (out[1:] == 10)
    if before_end.any():
        out = out[np.concatenate([~before_end, [True]])]
    return out.tobytes()


def _parsed_by_polars(source: Path | bytes, layout: TextLayout, skip_lines: int = 0) -> list[Series]:
    """Parse with polars; raises polars' ComputeError at a cell that is not a number."""
    import polars as pl

    names = [str(i) for i in range(layout.columns)]
    words = layout.text_columns
    schema: dict[str, type[pl.DataType]] = {
        n: pl.String if i in words else pl.Float64 for i, n in enumerate(names)
    }

    def read(missing: list[str] | None) -> pl.DataFrame:
        return pl.read_csv(
            source,
            has_header=False,
            schema=schema,
            columns=list(layout.number_columns),
            separator=layout.delimiter or " ",
            skip_lines=skip_lines,
            comment_prefix=layout.comment,
            decimal_comma=layout.decimal_comma and isinstance(source, Path),
            quote_char='"' if layout.quoted else None,
            null_values=missing,
            encoding="utf8-lossy",
        )

    try:
        frame = read(None)
    except pl.exceptions.ComputeError:
        frame = read(_MISSING)
    columns = [
        _iso_seconds(frame[names[i]].to_list()) if i in words else _float_column(frame[names[i]])
        for i in layout.number_columns
    ]
    return _without_blank_rows(columns)


def _float_column(series: pl.Series) -> Series:
    """Return a polars column as float64, missing cells as NaN, without a copy where it can be."""
    return np.asarray(series.to_numpy(), dtype=np.float64)


def _iso_seconds(cells: list[str | None]) -> Series:
    """Return ISO 8601 times as seconds of the Unix epoch."""
    text = ["NaT" if c is None else c.strip().rstrip("Z").replace(",", ".") for c in cells]
    stamps = np.array(text, dtype="datetime64[ns]")
    seconds = (stamps - np.datetime64(0, "ns")) / np.timedelta64(1, "s")
    return np.asarray(seconds, dtype=np.float64)


def _without_blank_rows(columns: list[Series]) -> list[Series]:
    """Leave out the rows that are empty in every column (blank lines)."""
    if not columns or not len(columns[0]) or not all(np.isnan(c.sum()) for c in columns):
        return columns
    blank = np.logical_and.reduce([np.isnan(c) for c in columns])
    return [c[~blank] for c in columns] if blank.any() else columns


def _parsed(body: bytes, layout: TextLayout, name: str, first_line: int, by_polars: bool) -> list[Series]:
    """Parse a piece of a file, by numpy where it can be, and say where it cannot be parsed."""
    body = _prepared(body, layout)
    if not by_polars and not layout.iso_columns:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # numpy warns of an empty piece
            try:
                return _parsed_by_numpy(body, layout)
            except ValueError:
                pass  # missing cells: polars reads them; anything else is found below
    import polars as pl

    try:
        if layout.delimiter is None and (
            b"  " in body or b"\n " in body or b"\t" in body or body[:1] == b" "
        ):
            return _parsed_by_polars(_squeezed(body), layout)
        return _parsed_by_polars(body, layout)
    except pl.exceptions.PolarsError as error:
        raise RecordingError(_bad_cell(io.BytesIO(body), layout, name, first_line)) from error


def _bad_cell(file: io.BufferedIOBase, layout: TextLayout, name: str, first_line: int) -> str:
    """Name the first cell or row that cannot be read."""
    for number, raw in enumerate(file, start=first_line):
        line = _decoded(raw).strip("\r\n")
        if not line.strip() or is_comment(line):
            continue
        cells = layout.cells(line)
        if len(cells) > layout.columns:
            return (
                f"{name}, line {number} has {len(cells)} columns where the others have {layout.columns}; "
                "mend or delete the line."
            )
        for i, cell in enumerate(cells):
            comma = layout.decimal_comma and "," in cell
            if i in layout.text_columns or is_number(cell, comma) or cell in _MISSING:
                continue
            column = f"column {i + 1}" if layout.header is None else f"column {layout.header[i]!r}"
            return f"{name}, line {number}, {column} holds {cell[:30]!r} instead of a number; mend the cell."
    return f"{name} cannot be read as a table of numbers with {layout.columns} columns."


# -- tables ----------------------------------------------------------------------------------------


def _table(
    path: Path, layout: TextLayout, columns: list[Series], remarks: list[Remark], source: Source
) -> RawTable:
    header = layout.header
    words = sorted(layout.text_columns - layout.iso_columns)
    notes = list(remarks)
    if layout.partial_lines:
        lines = ", ".join(str(n) for n in layout.partial_lines[:5])
        notes.append(Remark("mended", f"{path.name}: incomplete first rows (line {lines}) are left out."))
    if words:
        which = ", ".join(repr(header[i]) if header else str(i + 1) for i in words[:5])
        notes.append(Remark("found", f"{path.name}: columns without numbers ({which}) are not used."))
    return RawTable(path, _names_of(layout), columns, source, notes, _line_finder(path, layout))


def read_table(path: Path) -> RawTable:
    """Read a text file whole.

    Raises
    ------
    RecordingError
        If the file is empty, holds no rows of numbers, or has a cell that is not a number.
    OSError
        If the file cannot be read.
    """
    if path.stat().st_size > _NUMPY_LIMIT and _opener(path) is None:
        return _read_large(path)
    raw, remarks = _read_all(path)
    body = _plain(raw)
    layout = _layout_of(body, path.name)
    if cut := _truncation(_decoded(body[-_HEAD:]), layout):
        body = body[: body.rfind(b"\n") + 1]
        remarks.append(Remark("mended", f"{path.name}: {cut}."))
    body = body[_body_start(body, layout.first_line) :]
    columns = _parsed(body, layout, path.name, layout.first_line, len(body) > _NUMPY_LIMIT)
    return _table(path, layout, columns, remarks, hash_file(path))


def _read_large(path: Path) -> RawTable:
    """Read a large file: polars maps it from the disk while another thread takes its SHA-256."""
    from concurrent.futures import ThreadPoolExecutor

    with path.open("rb") as file:
        head = file.read(_HEAD)
        file.seek(-_HEAD, io.SEEK_END)
        tail = _decoded(file.read())
    utf8 = not head.startswith((b"\xff\xfe", b"\xfe\xff")) and b"\n" in head
    layout = _layout_of(_plain(head), path.name) if utf8 else None
    with ThreadPoolExecutor(1) as pool:
        hashing = pool.submit(hash_file, path)
        if layout is None or layout.delimiter is None:
            return _joined(list(read_table_blocks(path)), hashing.result())
        import polars as pl

        try:
            columns = _parsed_by_polars(path, layout, layout.first_line - 1)
        except pl.exceptions.PolarsError as error:
            with path.open("rb") as file:
                for _ in range(layout.first_line - 1):
                    file.readline()
                raise RecordingError(_bad_cell(file, layout, path.name, layout.first_line)) from error
        source = hashing.result()
    remarks: list[Remark] = []
    if cut := _truncation(tail, layout):
        columns = [c[:-1] for c in columns]
        remarks.append(Remark("mended", f"{path.name}: {cut}."))
    return _table(path, layout, columns, remarks, source)


def _joined(blocks: list[RawTable], source: Source) -> RawTable:
    first = blocks[0]
    count = len(first.columns)
    columns = [np.concatenate([b.columns[i] for b in blocks]) for i in range(count)]
    remarks = [r for b in blocks for r in b.remarks]
    return RawTable(first.path, first.names, columns, source, remarks, first.place)


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
    opener = _opener(path) or _open_plain
    by_polars = path.stat().st_size > _NUMPY_LIMIT
    source = Source(path.name, "")
    with opener(path) as file:
        head = file.read(_CHUNK)
        if head.startswith((b"\xff\xfe", b"\xfe\xff")) or b"\n" not in head:
            # UTF-16 and lone carriage returns cannot be cut at a line feed.
            yield read_table(path)
            return
        rest = _plain(head)
        layout = _layout_of(rest, path.name)
        rest = rest[_body_start(rest, layout.first_line) :]
        line, row, first = layout.first_line, 0, True
        place = _line_finder(path, layout)
        while rest:
            more = _read_on(file, path.name)
            body, rest = _cut_at_line(rest, bool(more))
            remarks: list[Remark] = []
            if not more and (cut := _truncation(_decoded(body[-_HEAD:]), layout)):
                body = body[: body.rfind(b"\n") + 1]
                remarks.append(Remark("mended", f"{path.name}: {cut}."))
            rest += more
            if not body.strip():
                continue
            columns = _parsed(body, layout, path.name, line, by_polars)
            table = _table(path, layout, columns, remarks, source) if first else None
            if table is None:
                table = RawTable(path, _names_of(layout), columns, source, remarks)
            table.place = lambda r, start=row: place(r + start)
            yield table
            first = False
            line += body.count(b"\n")
            row += len(columns[0])


def _names_of(layout: TextLayout) -> tuple[str, ...] | None:
    """Return the names of the columns that are handed over, or None."""
    return None if layout.header is None else tuple(layout.header[i] for i in layout.number_columns)


def _cut_at_line(rest: bytes, more: bool) -> tuple[bytes, bytes]:
    """Return the whole lines and the beginning of the next one."""
    if not more:
        return rest, b""
    end = rest.rfind(b"\n") + 1
    return rest[:end], rest[end:]


def _read_on(file: io.BufferedIOBase, name: str) -> bytes:
    try:
        return file.read(_CHUNK)
    except (EOFError, lzma.LZMAError, OSError) as error:
        raise RecordingError(f"{name} is compressed and cut short ({error}); decompress it first.") from error
