"""Parquet files as tumble writes them, by numpy alone: plain pages of float64, not compressed.

A library of data frames takes a quarter of a second to load, more than the reading of a minute's recording.
Whatever these lines do not know they leave to the library.

References
----------
Apache Parquet, *parquet.thrift*; Apache Thrift, *Thrift compact protocol*.
"""

from __future__ import annotations

import json
import mmap
import struct
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np

from tumble.arrays import Series, Table
from tumble.files import opened
from tumble.recording.formats.table import mapped
from tumble.records import dataclass

UNITS_KEY = "tumble.units"
"""Key of the file's metadata under which tumble notes the units, by column, that it has judged."""

_MAGIC = b"PAR1"
_LARGEST_FOOTER = 64 << 20
_LARGEST_RATIO = 1000  # of bytes unpacked to bytes packed
_DOUBLE, _PLAIN, _UNCOMPRESSED = 5, 0, 0
_STOP, _TRUE, _FALSE, _BYTE, _INTEGERS, _DOUBLE_KIND, _BINARY, _LISTS, _STRUCT = (
    0, 1, 2, 3, (4, 5, 6), 7, 8, (9, 10), 12,
)  # fmt: skip

Struct = dict[int, Any]


class Unfamiliar(Exception):
    """The file holds what this module does not read."""


class Damaged(Unfamiliar):
    """The file contradicts itself; a library that believes it may ask for more memory than there is."""


class _Compact:
    """Thrift's compact protocol from a buffer, structs as dictionaries by number of the field."""

    def __init__(self, buffer: bytes | mmap.mmap, position: int = 0) -> None:
        self.buffer, self.position = buffer, position

    def struct(self) -> Struct:
        """Read fields up to the stop byte."""
        fields: Struct = {}
        number = 0
        while (head := self._byte()) != _STOP:
            step, kind = head >> 4, head & 15
            number = number + step if step else self._integer()
            fields[number] = self._value(kind)
        return fields

    def _byte(self) -> int:
        octet = self.buffer[self.position]
        self.position += 1
        return octet

    def _varint(self) -> int:
        value, shift = 0, 0
        while True:
            octet = self._byte()
            value |= (octet & 127) << shift
            shift += 7
            if octet < 128:
                return value
            if shift > 63:
                raise Unfamiliar

    def _integer(self) -> int:
        raw = self._varint()
        return (raw >> 1) ^ -(raw & 1)

    def _value(self, kind: int) -> Any:
        if kind in (_TRUE, _FALSE):
            return kind == _TRUE
        if kind in _INTEGERS:
            return self._integer()
        if kind == _STRUCT:
            return self.struct()
        if kind in _LISTS:
            head = self._byte()
            count = head >> 4 if head >> 4 < 15 else self._varint()
            return [self._value(_BYTE if head & 15 in (_TRUE, _FALSE) else head & 15) for _ in range(count)]
        sizes: dict[int, Callable[[], int]] = {
            _BYTE: lambda: 1,
            _DOUBLE_KIND: lambda: 8,
            _BINARY: self._varint,
        }
        if kind not in sizes:
            raise Unfamiliar
        size = sizes[kind]()
        start, self.position = self.position, self.position + size
        if size < 0 or self.position > len(self.buffer):
            raise Damaged  # else a list of so many would be read from nothing
        return bytes(self.buffer[start : self.position])


@dataclass(frozen=True, slots=True)
class Footer:
    """What stands at the end of a file.

    Attributes
    ----------
    names : of the columns.
    units : by column, as tumble noted them; empty for files of others.
    rows : number of rows.
    groups : row groups, as the file describes them.
    """

    names: tuple[str, ...]
    units: dict[str, str]
    rows: int
    groups: list[Struct]


def read_footer(path: Path) -> Footer:
    """Read what stands at the end of a Parquet file.

    Raises
    ------
    Damaged
        If it is no Parquet file that is whole.
    OSError
        If the file cannot be read.
    """
    with opened(path) as file:
        size = file.seek(0, 2)
        file.seek(max(size - 8, 0))
        end = file.read(8)
        length = struct.unpack("<I", end[:4])[0] if len(end) == 8 else 0
        if end[4:] != _MAGIC or not 0 < length <= min(size - 12, _LARGEST_FOOTER):
            raise Damaged
        file.seek(size - 8 - length)
        raw = file.read(length)
    try:
        fields = _Compact(raw).struct()
        leaves = [element for element in fields[2][1:] if 5 not in element]
        names = tuple(element[4].decode() for element in leaves)
        noted = {pair[1]: pair.get(2, b"") for pair in fields.get(5, [])}
        units = _noted_units(noted.get(UNITS_KEY.encode(), b"{}"))
        rows, groups = int(fields[3]), cast("list[Struct]", fields[4])
        sound = sum(int(group[3]) for group in groups) == rows and all(
            0 < column[3][9] < size and 0 < column[3][7] < size and 0 <= column[3][6] < _LARGEST_RATIO * size
            for group in groups
            for column in group[1]
        )
    except (IndexError, KeyError, TypeError, ValueError, AttributeError, RecursionError, Unfamiliar) as error:
        raise Damaged from error
    if not sound:
        raise Damaged
    return Footer(names, units, rows, groups)


def _noted_units(note: bytes) -> dict[str, str]:
    """Return the units by column of a note, nothing of one that is none."""
    try:
        units: Any = json.loads(note)
    except (ValueError, RecursionError):
        return {}
    by_column = cast("dict[Any, Any]", units) if isinstance(units, dict) else {}
    return {str(column): str(unit) for column, unit in by_column.items()}


def _read_columns(path: Path, footer: Footer, groups: list[list[str]]) -> list[Table]:
    """Return columns as blocks of (rows, columns)."""
    data = mapped(path)
    if [n for group in groups for n in group] != list(footer.names):
        raise Unfamiliar
    try:
        pages = [_pages(data, footer, number) for number in range(len(footer.names))]
    except (
        IndexError,
        KeyError,
        TypeError,
        ValueError,
        AttributeError,
        RecursionError,
        struct.error,
    ) as error:
        raise Damaged from error
    firsts = np.cumsum([0, *(len(group) for group in groups)])[:-1]
    jobs = [pages[first : first + len(group)] for first, group in zip(firsts.tolist(), groups, strict=True)]
    with ThreadPoolExecutor(2) as pool:  # most of the time goes to memory that is touched first
        return list(pool.map(partial(_block, data, footer.rows), jobs))


def _pages(data: mmap.mmap, footer: Footer, number: int) -> list[tuple[int, int]]:
    """Return offset and count of the values of each page of a column."""
    found: list[tuple[int, int]] = []
    for group in footer.groups:
        column = cast("Struct", group[1][number][3])
        nulls = column.get(12, {}).get(3)
        if column[1] != _DOUBLE or column[4] != _UNCOMPRESSED or 11 in column or nulls != 0:
            raise Unfamiliar
        position, left = int(column[9]), int(column[5])
        while left > 0:
            reader = _Compact(data, position)
            head = reader.struct()
            page = cast("Struct", head.get(5) or head.get(8) or {})
            count, encoding = int(page.get(1, 0)), page.get(2 if 5 in head else 4)
            size = int(head[3])
            stop = reader.position + size
            # Levels come first, of no length that matters: nothing is missing.
            if not 0 < count <= left or 8 * count > size or stop > len(data):
                raise Damaged
            if encoding != _PLAIN:
                raise Unfamiliar
            found.append((stop - 8 * count, count))
            position, left = stop, left - count
    if sum(count for _, count in found) != footer.rows:
        raise Damaged
    return found


def _block(data: mmap.mmap, rows: int, pages: list[list[tuple[int, int]]]) -> Table:
    """Copy the pages of some columns side by side."""
    block = np.empty((rows, len(pages)))
    for number, column in enumerate(pages):
        at = 0
        for offset, count in column:
            block[at : at + count, number] = np.frombuffer(data, "<f8", count, offset)
            at += count
    return block


def column_groups(names: tuple[str, ...]) -> list[list[str]]:
    """Return the columns of a file of tumble's own, those of a triad together."""
    groups = [list(names[:1])]
    for name in names[1:]:
        if name[0] != groups[-1][-1][0] or len(groups[-1]) == len("xyz"):
            groups.append([])
        groups[-1].append(name)
    return groups


def read_plain(path: Path) -> tuple[Footer, list[Series]] | None:
    """Return footer and columns of a file that tumble saved; None of any other.

    Raises
    ------
    Damaged
        If the file is damaged.
    OSError
        If the file cannot be read.
    """
    try:
        footer = read_footer(path)
        if not footer.units or not footer.names:
            return None
        blocks = _read_columns(path, footer, column_groups(footer.names))
    except Damaged:
        raise
    except Unfamiliar:
        return None
    return footer, [block[:, i] for block in blocks for i in range(block.shape[1])]
