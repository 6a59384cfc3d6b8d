"""MATLAB .mat of versions 4 to 7 by scipy; version 7.3 is HDF5."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.recording.formats.damage import foreign
from tumble.recording.formats.table import RawTable
from tumble.recording.formats.variables import numbers_of, table_from_variables

NAME = "MATLAB"
ENDINGS = (".mat",)
SUMMARY = "MATLAB .mat of versions 4 to 7"


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
        # Without scipy's stubs the type is not known, with them it is.
        loaded: dict[str, Any] = loadmat(path, struct_as_record=False, squeeze_me=True, mat_dtype=False)
        arrays = _flattened({k: v for k, v in loaded.items() if not k.startswith("__")})
    return table_from_variables(path, arrays)


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
