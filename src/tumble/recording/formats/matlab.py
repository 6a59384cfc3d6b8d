"""MATLAB .mat of versions 5 to 7 by scipy; version 7.3 is HDF5, which is refused."""

from __future__ import annotations

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


def recognises(head: bytes) -> bool:
    """Say whether a file that begins so is MATLAB's."""
    return head.startswith(b"MATLAB ")


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
