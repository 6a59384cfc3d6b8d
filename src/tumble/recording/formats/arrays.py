"""Arrays: one in an NPY file, mapped from the disk; several with names in NPZ and in MATLAB's .mat.

MATLAB's versions 5 to 7 are read by scipy; version 7.3 is HDF5, which is refused.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Vectors
from tumble.errors import RecordingError
from tumble.files import opened, shown
from tumble.recording.columns import is_time_like, kind_of_file, role_of
from tumble.recording.formats.streams import merge_streams
from tumble.recording.formats.table import BLOCK_ROWS, RawTable, as_columns, foreign, row_words
from tumble.recording.samples import MagneticField, Remark, Samples
from tumble.recording.stamps import seconds_of
from tumble.units import find_unit

_LISTED = 12
_RATE_NAMES = {"fs", "f_s", "rate", "samplerate", "sample_rate", "sampling_rate", "samplingrate", "frequency"}


def _tall(
    name: str, array: npt.NDArray[np.float64], rows: int, remarks: list[Remark]
) -> npt.NDArray[np.float64]:
    """Return an array as (rows, columns), turned round where the samples run along its columns."""
    if array.ndim == 1:
        return array[:, None]
    if array.shape[0] != rows and array.shape[1] == rows:
        if array.shape[0] > 1:
            remarks.append(Remark("found", f"{name!r} holds one sample a column and is turned round."))
        return array.T
    return array


def table_from_variables(path: Path, variables: Mapping[str, npt.NDArray[np.float64]]) -> RawTable:
    """Put the arrays of one file side by side as the columns of a table.

    The number of samples is the longest side that occurs most often; arrays of another length are
    left out with a remark. Two arrays of a stamp and a triad each, whose names say which is which, are put onto the
    gyro's stamps. A lone matrix keeps its columns without names; (samples, 3) arrays called
    ``name`` become ``name_x``, ``name_y``, ``name_z``. A single number called ``fs`` or ``rate`` is
    the sampling rate.

    Parameters
    ----------
    path : the file, for messages.
    variables : arrays by name.

    Raises
    ------
    RecordingError
        If no array has more than three samples.
    OSError
        If the file cannot be read.
    """
    remarks: list[Remark] = []
    said = (float(a.ravel()[0]) for n, a in variables.items() if a.size == 1 and n.lower() in _RATE_NAMES)
    rate = next(said, None)
    arrays = {n: a for n, a in variables.items() if a.ndim in (1, 2) and a.size > 3}
    lengths = Counter(max(a.shape) for a in arrays.values())
    if not lengths:
        raise RecordingError(
            f"{path.name} holds no table of samples (variables: {_listed(variables)}); "
            "give a matrix with one row a sample, or arrays such as t, acc and gyr."
        )
    pair = _stamped_pair(path, arrays)
    if pair is not None:
        return pair
    rows = max(lengths, key=lambda n: (lengths[n], n))
    used = {n: _tall(n, a, rows, remarks) for n, a in arrays.items() if rows in a.shape}
    magnetic = _field_of_another_length({n: a for n, a in arrays.items() if n not in used})
    left = sorted(set(arrays) - set(used) - (set(magnetic[1]) if magnetic else set()))
    if left:
        remarks.append(
            Remark("found", f"{path.name}: arrays of another length are not used: {', '.join(left)}.")
        )
    columns: list[Series] = []
    names: list[str] = []
    for name, array in used.items():
        columns += as_columns(np.asarray(array, dtype=np.float64))
        names += [name] if array.shape[1] == 1 else _part_names(name, array.shape[1])
    lone = len(used) == 1 and len(columns) not in (1, 3)
    if rate is not None:
        remarks.append(Remark("found", f"{path.name} states a sampling rate of {rate:g} Hz."))
    field = None if magnetic is None else magnetic[0]
    return RawTable(path, None if lone else tuple(names), columns, remarks, rate=rate, field=field)


def _field_of_another_length(
    arrays: Mapping[str, npt.NDArray[np.float64]],
) -> tuple[MagneticField, tuple[str, ...]] | None:
    """A magnetometer's (n, 3) array with n stamps beside it, both named; None without the two."""

    def role(name: str) -> tuple[str, str | None]:
        return role_of(name) or ("", None)

    fields = [n for n, a in arrays.items() if a.ndim == 2 and 3 in a.shape and role(f"{n}_x")[0] == "mx"]
    if len(fields) != 1:
        return None
    name = fields[0]
    values = arrays[name] if arrays[name].shape[1] == 3 else arrays[name].T
    stamps = [n for n, a in arrays.items() if a.ndim == 1 and len(a) == len(values) and is_time_like(a)]
    if len(stamps) != 1:
        return None
    time = arrays[stamps[0]]
    said = role(stamps[0])[1]
    seconds = seconds_of(time, find_unit("time", said) if said else None)
    return MagneticField.finite(seconds, values, None, name), (name, stamps[0])


def _stamped_pair(path: Path, arrays: Mapping[str, npt.NDArray[np.float64]]) -> RawTable | None:
    """Two arrays of four columns, stamps first or last, as one table on the gyro's stamps; None if there are none."""
    found: dict[str, tuple[str, Series, Vectors]] = {}
    for name, array in arrays.items():
        columns = array if array.shape[-1] == 4 else array.T
        kind = kind_of_file(name)
        stamps = [
            i for i in (0, 3) if columns.ndim == 2 and columns.shape[1] == 4 and is_time_like(columns[:, i])
        ]
        if not stamps or kind is None or kind in found:
            continue
        found[kind] = name, columns[:, stamps[0]], np.delete(columns, stamps[0], axis=1)
    if not {"a", "g"} <= set(found):
        return None
    (force_name, force_time, force), (rate_name, rate_time, rates) = found["a"], found["g"]
    samples, remarks = merge_streams(
        path.name, (force_name, Samples(force_time, force)), (rate_name, Samples(rate_time, None, rates))
    )
    names = ("t", *(f"{letter}{axis}" for letter in "ag" for axis in "xyz"))
    assert samples.specific_force is not None
    assert samples.angular_rate is not None
    columns = [samples.time, *as_columns(samples.specific_force), *as_columns(samples.angular_rate)]
    field = MagneticField.finite(*found["m"][1:], None, found["m"][0]) if "m" in found else None
    return RawTable(path, names, columns, remarks, field=field)


def _listed(names: Mapping[str, object]) -> str:
    """Return the first names, shortened: a damaged file may have very long ones."""
    first = [shown(name[:40]) for name in list(names)[:_LISTED]]
    return ", ".join(first) + (f" and {len(names) - _LISTED} more" if len(names) > _LISTED else "") or "none"


def _part_names(name: str, count: int) -> list[str]:
    letters = "xyz" if count == 3 else [str(i) for i in range(count)]
    return [f"{name}_{letter}" for letter in letters]


def numbers_of(value: object) -> npt.NDArray[np.float64] | None:
    """Return a value as an array of float64, or None if it is not one of numbers."""
    array = np.asarray(value)
    if array.dtype.kind not in "iufb" or array.ndim > 2:
        return None
    return (
        np.squeeze(array).astype(np.float64)
        if array.ndim == 2 and 1 in array.shape
        else array.astype(np.float64)
    )


def _mapped(path: Path) -> tuple[tuple[str, ...] | None, npt.NDArray[Any]]:
    with foreign(path, "NPY file"):
        array: npt.NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
    if array.dtype.names:
        return array.dtype.names, array
    if array.ndim != 2 or array.dtype.kind not in "iufb":
        raise RecordingError(
            f"{path.name} holds an array of shape {array.shape} and type {array.dtype}; "
            "give numbers with one row a sample and one column a channel."
        )
    return None, array.T if array.shape[0] < 12 < array.shape[1] else array


def read_npy(path: Path, rows: int = BLOCK_ROWS) -> Iterator[RawTable]:
    """Read an NPY file `rows` rows at a time from its memory map.

    Raises
    ------
    RecordingError
        If the array is not a table of numbers.
    OSError
        If the file cannot be read.
    """
    names, array = _mapped(path)
    for start in range(0, len(array), rows):
        part = array[start : start + rows]
        if names is None:
            columns = as_columns(np.asarray(part, dtype=np.float64))
        else:
            with foreign(path, "NPY file"):
                columns = [np.asarray(part[n], dtype=np.float64).reshape(len(part)) for n in names]
        yield RawTable(path, names, columns, place=partial(row_words, start=start))


def read_npz(path: Path) -> Iterator[RawTable]:
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
    yield table_from_variables(path, {n: a for n, a in arrays.items() if a is not None})


def read_matlab(path: Path) -> Iterator[RawTable]:
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
    yield table_from_variables(path, arrays)


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
