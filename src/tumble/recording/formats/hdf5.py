"""HDF5 by h5py, and MATLAB 7.3 files, which are HDF5: data sets by name and shape, group by group."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Vectors
from tumble.errors import RecordingError, UsageError
from tumble.recording.columns import ColumnPlan, plan_from_names
from tumble.recording.formats.streams import Samples, Units, merge_streams, table_of_samples
from tumble.recording.formats.table import RawTable, hash_file
from tumble.recording.formats.variables import numbers_of, table_from_variables
from tumble.recording.recording import Remark
from tumble.recording.stamps import guess_time_unit
from tumble.units import time_factor

NAME = "HDF5"
ENDINGS = (".h5", ".hdf5", ".mat")
SUMMARY = "HDF5 and MATLAB 7.3: data sets by name and shape (with the extra `hdf5`)"
HAS_TOPICS = True

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_LISTED = 12
_Variables = dict[str, npt.NDArray[np.float64]]


def recognises(head: bytes) -> bool:
    """Say whether a file that begins so is HDF5, which begins at 0, 512, 1024, ... bytes."""
    begins = any(head[at : at + len(_SIGNATURE)] == _SIGNATURE for at in (0, 512, 1024, 2048))
    return begins or head.startswith(b"MATLAB 7.3")


def read_table(path: Path, topics: Sequence[str] = ()) -> RawTable:
    """Read an HDF5 file.

    Parameters
    ----------
    path : the file.
    topics : a group or a data set, or two with one triad each, as ``imu0`` or ``/sensors/acc``.

    Raises
    ------
    RecordingError
        If the file is damaged or holds no table of samples.
    UsageError
        If h5py is not installed, or a group is not there.
    OSError
        If the file cannot be read.
    """
    groups = _groups(path)
    remark = Remark("found", f"{path.name} holds {_listed(groups)}.")
    if topics:
        if len(topics) > 2:
            raise UsageError(f"--topic names {len(topics)} groups; give one, or one of each triad.")
        chosen = [_named(path, groups, name) for name in topics]
        tables = [_table(path, name, groups) for name in chosen]
        table = tables[0] if len(tables) == 1 else _merged(path, chosen, tables)
    else:
        table = _automatic(path, groups)
    table.remarks.insert(0, remark)
    return table


def _groups(path: Path) -> dict[str, _Variables]:
    """Return the arrays of numbers by the group that they are in; a table with named columns is a group."""
    try:
        h5py: Any = import_module("h5py")
    except ImportError as error:
        raise UsageError(
            f"{path.name} is HDF5 (MATLAB 7.3); reading it needs h5py: pip install 'tumble[hdf5]', "
            "or save it in MATLAB with the option '-v7'."
        ) from error
    groups: dict[str, _Variables] = {}

    def visit(name: str, node: Any) -> None:
        if not isinstance(node, h5py.Dataset) or name.startswith("#"):
            return
        group, _, leaf = name.rpartition("/")
        if node.dtype.names:
            rows: Any = node[()]
            fields = {n: numbers_of(rows[n]) for n in node.dtype.names}
            groups[name] = {n: a for n, a in fields.items() if a is not None}
        elif node.dtype.kind in "iufb" and (array := numbers_of(node[()])) is not None:
            groups.setdefault(group, {})[leaf] = array

    try:
        with h5py.File(path, "r") as file:
            file.visititems(visit)
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        raise RecordingError(f"{path.name} is a damaged HDF5 file ({error}).") from error
    return groups


def _listed(groups: dict[str, _Variables]) -> str:
    sets = [
        f"/{g}/{n}".replace("//", "/") + f" {a.shape}"
        for g, arrays in groups.items()
        for n, a in arrays.items()
    ]
    return (
        ", ".join(sets[:_LISTED]) + (f" and {len(sets) - _LISTED} more" if len(sets) > _LISTED else "")
        or "nothing"
    )


def _named(path: Path, groups: dict[str, _Variables], name: str) -> str:
    """Return the group that a name is of; a data set of its own becomes one."""
    plain = name.strip("/")
    if plain in groups:
        return plain
    group, _, leaf = plain.rpartition("/")
    if leaf in groups.get(group, {}):
        clocks = {n: a for n, a in groups[group].items() if _plan((n,)) is None and _is_clock(n)}
        groups[plain] = clocks | {leaf: groups[group][leaf]}
        return plain
    raise UsageError(
        f"--topic {name}: {path.name} has no such group or data set; it holds {_listed(groups)}."
    )


def _is_clock(name: str) -> bool:
    from tumble.recording.columns import role_of

    found = role_of(name)
    return found is not None and found[0] == "t"


def _plan(names: tuple[str, ...] | None) -> ColumnPlan | None:
    return None if names is None else plan_from_names(names)


def _table(path: Path, group: str, groups: dict[str, _Variables]) -> RawTable:
    """Return a group's arrays side by side; where their names say nothing, the group's name goes before."""
    table = table_from_variables(path, groups[group])
    leaf = group.rpartition("/")[2]
    if table.names is not None and leaf and _plan(table.names) is None:
        named = tuple(n if _is_clock(n) else f"{leaf}.{n}" for n in table.names)
        if _plan(named) is not None:
            table.names = named
    return table


def _automatic(path: Path, groups: dict[str, _Variables]) -> RawTable:
    """Return the one group with both triads, two groups with one each, or all arrays of one length."""
    tables: dict[str, RawTable] = {}
    for name in groups:
        try:
            tables[name] = _table(path, name, groups)
        except RecordingError:
            continue
    plans = {name: plan for name, table in tables.items() if (plan := _plan(table.names)) is not None}
    both = [n for n, p in plans.items() if p.specific_force and p.angular_rate]
    if len(both) > 1:
        raise RecordingError(
            f"{path.name} holds several sensors, in the groups {', '.join('/' + n for n in both[:_LISTED])}; "
            "name one with --topic."
        )
    if both:
        return tables[both[0]]
    forces = [n for n, p in plans.items() if p.specific_force]
    rates = [n for n, p in plans.items() if p.angular_rate]
    if len(forces) == len(rates) == 1 and all(plans[n].time is not None for n in (*forces, *rates)):
        return _merged(path, [forces[0], rates[0]], [tables[forces[0]], tables[rates[0]]])
    flat = {
        f"{g}.{n}".lstrip(".").replace("/", "."): a for g, arrays in groups.items() for n, a in arrays.items()
    }
    return table_from_variables(path, flat)


def _merged(path: Path, names: list[str], tables: list[RawTable]) -> RawTable:
    """Return two groups of one triad each as one table."""
    plans = [_plan(t.names) for t in tables]
    if plans[0] is not None and plans[0].specific_force is None:
        names, tables, plans = names[::-1], tables[::-1], plans[::-1]
    force, rates = plans
    if (
        force is None
        or rates is None
        or not force.specific_force
        or not rates.angular_rate
        or rates.specific_force
    ):
        raise RecordingError(
            f"{path.name}: /{names[0]} and /{names[1]} are not an accelerometer and a gyro apart."
        )
    if force.time is None or rates.time is None:
        raise RecordingError(
            f"{path.name}: /{names[0]} and /{names[1]} need stamps of their own to be put together."
        )
    clocks = [
        _seconds(t.columns[p.time or 0], p.time_unit) for t, p in ((tables[0], force), (tables[1], rates))
    ]
    samples, remarks = merge_streams(
        path.name,
        (f"/{names[0]}", Samples(clocks[0], _triad(tables[0], force.specific_force))),
        (f"/{names[1]}", Samples(clocks[1], None, _triad(tables[1], rates.angular_rate))),
    )
    units = Units(force.specific_force_unit, rates.angular_rate_unit)
    return table_of_samples(path, samples, units, hash_file(path), remarks)


def _triad(table: RawTable, triad: tuple[tuple[int, float], ...]) -> Vectors:
    return np.column_stack([table.columns[i] for i, _ in triad])


def _seconds(stamps: Series, unit: str | None) -> Series:
    return stamps * time_factor(unit or guess_time_unit(float(np.nanmedian(np.diff(stamps)))))
