"""NPZ: several named arrays in one file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tumble.files import opened
from tumble.recording.formats.damage import foreign
from tumble.recording.formats.table import RawTable
from tumble.recording.formats.variables import numbers_of, table_from_variables

NAME = "NPZ"
ENDINGS = (".npz",)


def recognises(head: bytes) -> bool:
    """Say whether a file that begins so is a zip archive whose first file is NPY, as NPZ is."""
    if not head.startswith(b"PK\x03\x04") or len(head) < 30:
        return False
    length = int.from_bytes(head[26:28], "little")
    return head[30 : 30 + length].endswith(b".npy")


def read_table(path: Path) -> RawTable:
    """Read an NPZ file.

    Raises
    ------
    RecordingError
        If the file is another kind of zip archive or holds no table of samples.
    OSError
        If the file cannot be read.
    """
    # Opened here: numpy leaves a damaged archive open.
    with foreign(path, "NPZ file"), opened(path) as file, np.load(file, allow_pickle=False) as archive:
        arrays = {name: numbers_of(archive[name]) for name in archive.files}
    return table_from_variables(path, {n: a for n, a in arrays.items() if a is not None})
