"""HDF5 by h5py, and MATLAB 7.3 files, which are HDF5: data sets by name and shape, group by group."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import Vectors
from tumble.errors import RecordingError, UsageError, install
from tumble.files import opened
from tumble.recording.columns import ColumnPlan, plan_from_names
from tumble.recording.formats.damage import foreign
from tumble.recording.formats.streams import Units, merge_streams, table_of_samples
from tumble.recording.formats.table import FieldStream, RawTable, hash_file
from tumble.recording.formats.variables import is_rate_name, numbers_of, table_from_variables
from tumble.recording.recording import Remark
from tumble.recording.samples import Samples
from tumble.recording.stamps import seconds_of
from tumble.records import dataclass

NAME = "HDF5"
ENDINGS = (".h5", ".hdf5", ".mat")
SUMMARY = "HDF5 and MATLAB 7.3: data sets by name and shape (with the extra `hdf5`)"
HAS_TOPICS = True

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_LISTED = 12
_Variables = dict[str, npt.NDArray[np.float64]]


@dataclass(slots=True)
class _Content:
    """The arrays of numbers of a file by group, with what their attributes say.

    `units` are by group and array, `rates` in Hz by group, "" for the whole file.
    """

    groups: dict[str, _Variables] = field(default_factory=dict[str, _Variables])
    units: dict[tuple[str, str], str] = field(default_factory=dict[tuple[str, str], str])
    rates: dict[str, float] = field(default_factory=dict[str, float])

    def rate_of(self, group: str) -> float | None:
        """Return the rate that stands at a group, at its arrays, or above it."""
        own = {r for n, r in self.rates.items() if n.rpartition("/")[0] == group and n}
        while group and group not in self.rates:
            group = group.rpartition("/")[0]
        return self.rates.get(group) if len(own) != 1 else own.pop()


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
    content = _content(path)
    remark = Remark("found", f"{path.name} holds {_listed(content.groups)}.")
    if topics:
        named = {name: _table(path, name, content) for name in (_named(path, content, one) for one in topics)}
        fields = [name for name, table in named.items() if _is_field(_plan(table.names)) and len(named) > 1]
        chosen = [name for name in named if name not in fields]
        if len(chosen) > 2 or len(fields) > 1:
            raise UsageError(f"--topic names {len(topics)} groups; give one, or one of each triad.")
        tables = [named[name] for name in chosen]
        table = tables[0] if len(tables) == 1 else _merged(path, chosen, tables)
        table.field = table.field or _field(fields, named)
    else:
        table = _automatic(path, content)
    table.remarks.insert(0, remark)
    return table


def _content(path: Path) -> _Content:
    """Return the arrays of numbers by the group that they are in; a table with named columns is a group."""
    try:
        h5py: Any = import_module("h5py")
    except ImportError as error:
        raise UsageError(
            f"{path.name} is HDF5 (MATLAB 7.3); reading it needs h5py: {install('hdf5')}, "
            "or save it in MATLAB with the option '-v7'."
        ) from error
    content = _Content()

    def visit(name: str, node: Any) -> None:
        if name.startswith("#"):
            return
        _take_rate(content, name, node.attrs)
        if not isinstance(node, h5py.Dataset):
            return
        if node.external or node.is_virtual:
            raise RecordingError(
                f"{path.name}: the numbers of /{name} stand in another file, which is not read; write them into this "
                "one."
            )
        group, _, leaf = name.rpartition("/")
        if node.dtype.names:
            rows: Any = node[()]
            fields = {n: numbers_of(rows[n]) for n in node.dtype.names}
            content.groups[name] = {n: a for n, a in fields.items() if a is not None}
        elif node.dtype.kind in "iufb" and (array := numbers_of(node[()])) is not None:
            content.groups.setdefault(group, {})[leaf] = array
            if (unit := _unit_said(node.attrs)) is not None:
                content.units[group, leaf] = unit

    with foreign(path, "HDF5 file"), opened(path) as whole:
        try:
            with h5py.File(whole, "r") as file:
                _take_rate(content, "", file.attrs)
                file.visititems(visit)
        except OSError as error:  # h5py's word for damage, too
            raise RecordingError(f"{path.name} is a damaged HDF5 file ({str(error)[:120]}).") from error
    return content


def corrections(path: Path) -> tuple[str, ...]:
    """Return the identities of the calibrations that a file of an earlier tumble was corrected by; else none.

    Parameters
    ----------
    path : of an HDF5 file, or of any other.
    """
    try:
        with import_module("h5py").File(path, "r") as file:
            return tuple(str(file.attrs.get("corrected_by", "")).split())
    except (ImportError, OSError, RuntimeError, KeyError):
        return ()


def _take_rate(content: _Content, name: str, attributes: Mapping[str, Any]) -> None:
    """Note the sampling rate that stands among the attributes of a group or an array."""
    for key, value in attributes.items():
        said = np.asarray(value)
        if is_rate_name(key) and said.size == 1 and said.dtype.kind in "iuf" and float(said.ravel()[0]) > 0.0:
            content.rates[name] = float(said.ravel()[0])


def _unit_said(attributes: Mapping[str, Any]) -> str | None:
    """Return the unit that stands among the attributes of an array, one for all its columns."""
    for key, value in attributes.items():
        if key.lower() in ("unit", "units"):
            texts = {
                (t.decode("utf-8", "replace") if isinstance(t, bytes) else str(t)).strip()
                for t in np.asarray(value, dtype=object).ravel()
            }
            words = {w.strip(" []()") for text in texts for w in text.split(",")} - {""}
            return words.pop() if len(words) == 1 else None
    return None


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


def _named(path: Path, content: _Content, name: str) -> str:
    """Return the group that a name is of; a data set of its own becomes one."""
    groups = content.groups
    plain = name.strip("/")
    if plain in groups:
        return plain
    group, _, leaf = plain.rpartition("/")
    if leaf in groups.get(group, {}):
        clocks = {n: a for n, a in groups[group].items() if _plan((n,)) is None and _is_clock(n)}
        groups[plain] = clocks | {leaf: groups[group][leaf]}
        content.units |= {(plain, n): u for (g, n), u in content.units.items() if g == group}
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


def _table(path: Path, group: str, content: _Content) -> RawTable:
    """Return a group's arrays side by side; where their names say nothing, the group's name goes before."""
    units = {n: u for (g, n), u in content.units.items() if g == group}
    table = table_from_variables(path, content.groups[group], units, content.rate_of(group))
    leaf = group.rpartition("/")[2]
    if table.names is not None and leaf and _plan(table.names) is None:
        named = tuple(n if _is_clock(n) else f"{leaf}.{n}" for n in table.names)
        if _plan(named) is not None:
            table.names = named
    return table


def _automatic(path: Path, content: _Content) -> RawTable:
    """Return the one group with both triads, two groups with one each, or all arrays of one length."""
    groups = content.groups
    tables: dict[str, RawTable] = {}
    for name in groups:
        try:
            tables[name] = _table(path, name, content)
        except RecordingError:
            continue
    plans = {name: plan for name, table in tables.items() if (plan := _plan(table.names)) is not None}
    both = [n for n, p in plans.items() if p.specific_force and p.angular_rate]
    if len(both) > 1:
        raise RecordingError(
            f"{path.name} holds several sensors, in the groups {', '.join('/' + n for n in both[:_LISTED])}; "
            "name one with --topic."
        )
    fields = [n for n, p in plans.items() if _is_field(p) and p.time is not None]
    if both:
        tables[both[0]].field = tables[both[0]].field or _field(fields, tables)
        return tables[both[0]]
    forces = [n for n, p in plans.items() if p.specific_force]
    rates = [n for n, p in plans.items() if p.angular_rate]
    if len(forces) == len(rates) == 1 and all(plans[n].time is not None for n in (*forces, *rates)):
        table = _merged(path, [forces[0], rates[0]], [tables[forces[0]], tables[rates[0]]])
        table.field = _field(fields, tables)
        return table
    flat = {_flat(g, n): a for g, arrays in groups.items() for n, a in arrays.items()}
    units = {_flat(g, n): u for (g, n), u in content.units.items()}
    rates = set(content.rates.values())
    return table_from_variables(path, flat, units, rates.pop() if len(rates) == 1 else None)


def _is_field(plan: ColumnPlan | None) -> bool:
    """Whether a group holds a magnetometer and neither of the other triads."""
    return (
        plan is not None
        and plan.magnetic_field is not None
        and not (plan.specific_force or plan.angular_rate)
    )


def _field(names: list[str], tables: Mapping[str, RawTable]) -> FieldStream | None:
    """Return the magnetometer of the first of some groups that has stamps."""
    for name in names:
        table = tables[name]
        plan = _plan(table.names)
        if plan is None or plan.magnetic_field is None or plan.time is None:
            continue
        values, stamps = _triad(table, plan.magnetic_field), table.columns[plan.time]
        seconds = seconds_of(stamps, plan.time_unit)
        return FieldStream.finite(f"/{name}", seconds, values, plan.magnetic_field_unit)
    return None


def _flat(group: str, name: str) -> str:
    return f"{group}.{name}".lstrip(".").replace("/", ".")


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
        seconds_of(t.columns[p.time or 0], p.time_unit) for t, p in ((tables[0], force), (tables[1], rates))
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
