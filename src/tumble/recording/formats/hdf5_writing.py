"""Writing recordings as HDF5, block by block: `t`, `acc`, `gyro` and `temperature`, each with its unit."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from tumble.errors import OutputError, UsageError, install
from tumble.files import written_beside
from tumble.recording.recording import Recording
from tumble.units import COUNTS

ENDINGS = (".h5", ".hdf5")
MARK = "corrected_by"
"""The attribute of the file that says by which calibrations it was corrected."""
_CHUNK = 16384  # rows


def write_hdf5(blocks: Iterable[Recording], target: Path, marks: Sequence[str] = ()) -> None:
    """Write consecutive blocks as one HDF5 file.

    Parameters
    ----------
    blocks, target : pieces of one recording in time order, and the file.
    marks : identities of the calibrations that the recording went through.

    Raises
    ------
    UsageError
        If h5py is not installed.
    OutputError
        If the file cannot be written; an earlier one is then intact.
    """
    try:
        h5py: Any = import_module("h5py")
    except ImportError as error:
        raise UsageError(f"{target.name}: writing HDF5 needs h5py: {install('hdf5')}.") from error
    if not target.parent.is_dir():
        raise OutputError(f"{target} could not be written: the folder {target.parent} does not exist.")
    with written_beside(target) as beside:
        with h5py.File(beside, "w") as file:
            if marks:
                file.attrs[MARK] = " ".join(marks)
            for block in blocks:
                for name, values, unit in _parts(block):
                    _append(file, name, values, unit)
        with beside.open("rb+") as written:
            os.fsync(written.fileno())


def _parts(block: Recording) -> list[tuple[str, np.ndarray, str]]:
    parts: list[tuple[str, np.ndarray | None, str]] = [
        ("t", block.time, "s"),
        ("acc", block.specific_force, block.specific_force_unit or COUNTS),
        ("gyro", block.angular_rate, block.angular_rate_unit or COUNTS),
        ("temperature", block.temperature, "degC"),
    ]
    return [(name, values, unit) for name, values, unit in parts if values is not None]


def _append(file: Any, name: str, values: np.ndarray, unit: str) -> None:
    """Add rows to a data set, made with the first ones."""
    if name not in file:
        wide = values.shape[1:]
        made = file.create_dataset(
            name, shape=(0, *wide), maxshape=(None, *wide), chunks=(_CHUNK, *wide), dtype="f8"
        )
        made.attrs["unit"] = unit
    data = file[name]
    rows = data.shape[0]
    data.resize(rows + values.shape[0], axis=0)
    data[rows:] = values


def corrections(path: Path) -> tuple[str, ...]:
    """Return the identities of the calibrations that a file was corrected by; none of one that cannot be read.

    Parameters
    ----------
    path : of an HDF5 file.
    """
    try:
        h5py: Any = import_module("h5py")
        with h5py.File(path, "r") as file:
            return tuple(str(file.attrs.get(MARK, "")).split())
    except (ImportError, OSError, RuntimeError, KeyError):
        return ()
