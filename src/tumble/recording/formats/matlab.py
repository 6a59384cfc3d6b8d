"""MATLAB .mat of versions 4 to 7 by scipy; version 7.3 is HDF5."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.recording.formats.compression import refuse_unmeasured
from tumble.recording.formats.damage import foreign
from tumble.recording.formats.table import RawTable, mapped
from tumble.recording.formats.variables import numbers_of, table_from_variables

NAME = "MATLAB"
ENDINGS = (".mat",)
SUMMARY = "MATLAB .mat of versions 4 to 7"

_FLAGS, _MATRIX, _COMPRESSED = (
    6,
    14,
    15,
)  # types of an array's flags, of an array, of one that zlib has packed
_PLAIN = frozenset({1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18})  # types of numbers and texts
_FIRST_NUMBERS, _LAST_NUMBERS = 4, 15  # classes of arrays: texts, sparse, floating and whole numbers
_DEEPEST = 64


def _is_version_4(head: bytes) -> bool:
    """A level 4 header: five 32-bit integers, of which the first is below 5000 (type MOPT)."""
    if len(head) < 20:
        return False
    for order in ("<", ">"):
        kind, rows, columns, imaginary, length = struct.unpack(order + "5i", head[:20])
        thousands, rest = divmod(kind, 1000)
        if thousands == (order == ">") and rest in (0, 10, 20, 30, 40, 50, 1, 11, 21, 31, 41, 51):
            return rows >= 0 and columns >= 0 and imaginary in (0, 1) and 1 < length < 64
    return False


def recognises(head: bytes) -> bool:
    """Say whether a file that begins so is MATLAB's; version 7.3 is HDF5."""
    if head.startswith(b"MATLAB "):
        return not head.startswith(b"MATLAB 7.3")
    return b"\0" in head[:4] and _is_version_4(head)


def read_table(path: Path) -> RawTable:
    """Read a MATLAB file.

    Raises
    ------
    RecordingError
        If the file is damaged or holds no table of samples.
    OSError
        If the file cannot be read.
    """
    from scipy.io import loadmat

    with foreign(path, "MATLAB file"):
        _check_elements(path)
        # Without scipy's stubs the type is not known, with them it is.
        loaded: dict[str, Any] = loadmat(path, struct_as_record=False, squeeze_me=True, mat_dtype=False)
        arrays = _flattened({k: v for k, v in loaded.items() if not k.startswith("__")})
    return table_from_variables(path, arrays)


def _check_elements(path: Path) -> None:
    """Refuse a file of version 5 to 7 with an element of a type that cannot be, and what unpacks beyond measure.

    scipy looks types up in a table without asking whether they are in it: a wrong bit there ends the program.
    """
    data = mapped(path)
    if data[:7] != b"MATLAB ":
        return
    order = ">" if data[126:128] == b"MI" else "<"
    unpacked = 0
    for kind, content in _elements(data[128:], order):
        if kind == _COMPRESSED:
            inflate, parts = zlib.decompressobj(), list[bytes]()
            while content and not inflate.eof:
                parts.append(inflate.decompress(content, 1 << 20))
                content = inflate.unconsumed_tail
                unpacked += len(parts[-1])
                refuse_unmeasured(unpacked, len(data), path.name)
            for inner, matrix in _elements(b"".join(parts), order):
                _check_matrix(inner, matrix, order, 0)
        else:
            _check_matrix(kind, content, order, 0)


def _elements(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Yield type and content of elements one after another; short ones stand in their own tag."""
    at = 0
    while at + 8 <= len(data):
        kind, size = struct.unpack_from(order + "II", data, at)
        if kind >> 16:
            kind, size, start, step = kind & 0xFFFF, kind >> 16, at + 4, 8
            if size > 4:
                raise ValueError("a short element is too long")
        else:
            start, step = at + 8, 8 + size + (0 if kind == _COMPRESSED else -size % 8)
        yield kind, data[start : start + size]
        at += step


def _check_matrix(kind: int, content: bytes, order: str, depth: int) -> None:
    """Check the elements of an array, those of its cells and fields too."""
    if kind != _MATRIX or depth > _DEEPEST:
        raise ValueError(f"an array is of type {kind}" if kind != _MATRIX else "it is nested too deeply")
    if not content:
        return
    parts = _elements(content, order)
    flags, flag_words = next(parts, (0, b""))
    if flags != _FLAGS or len(flag_words) != 8:
        raise ValueError("an array has no flags")
    (word,) = struct.unpack_from(order + "I", flag_words)
    holds_numbers = _FIRST_NUMBERS <= word & 0xFF <= _LAST_NUMBERS
    for number, (inner, part) in enumerate(parts):
        if inner == _MATRIX and not (holds_numbers or number < 2):
            _check_matrix(inner, part, order, depth + 1)
        elif inner not in _PLAIN:
            raise ValueError(f"an element is of type {inner}, which there is not")


def _flattened(values: Mapping[str, Any], prefix: str = "") -> dict[str, npt.NDArray[np.float64]]:
    """Return the arrays of numbers of variables and of the fields of structs."""
    found: dict[str, npt.NDArray[np.float64]] = {}
    for name, value in values.items():
        fields = getattr(value, "_fieldnames", None)
        if fields is not None:
            found |= _flattened({f: getattr(value, f) for f in fields}, prefix + name + ".")
        elif (array := numbers_of(value)) is not None:
            found[prefix + name] = array
    return found
