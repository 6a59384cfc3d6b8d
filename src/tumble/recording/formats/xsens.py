"""Text exports of Xsens and Movella: MT Manager, MTw and DOT.

The names of the columns are theirs; what they do not say is the unit of the clock and of the gyro, and
that increments of orientation are quaternions.

References
----------
Xsens, *MT Low-Level Communication Protocol Documentation* (SampleTimeFine: ticks of 0.1 ms);
Movella, *DOT User Manual* (SampleTimeFine in µs, angular velocity in degrees a second).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from tumble.arrays import Series
from tumble.files import opened
from tumble.recording.formats import text
from tumble.recording.formats.table import RawTable
from tumble.recording.samples import Remark
from tumble.sample_rates import CRYSTAL, sample_rate

_TICK = 100.0  # µs
_MOST_HERTZ_OF_TICKS = 4000.0
_RATE = re.compile(rb"(?:Update Rate|Sample rate|OutputRate)\s*[:,]+\s*(\d+(?:\.\d+)?)\s*Hz", re.IGNORECASE)
_HEAD = 8192


def read_tables(path: Path) -> Iterator[RawTable]:
    """Read an export piece by piece.

    Raises
    ------
    RecordingError
        If the file holds no rows of numbers.
    OSError
        If the file cannot be read.
    """
    with opened(path) as file:
        head = file.read(_HEAD)
    for table in text.read_tables(path):
        yield _interpreted(table, head)


def _interpreted(table: RawTable, head: bytes) -> RawTable:
    """Return the table with the columns of the clock and the triads named with their units."""
    if table.names is None:
        return table
    columns = dict(zip(table.names, table.columns, strict=True))
    found = _clock(columns) | _triads(columns, is_dot=b"DeviceTag" in head or b"OutputRate" in head)
    if (temperature := columns.get("Temperature")) is not None:
        found["temperature"] = temperature
    rate = table.rate
    if "t [us]" not in found and (match := _RATE.search(head)):
        rate = sample_rate(f"{float(match.group(1))}±{1e6 * CRYSTAL}ppm")
        text_ = f"{table.path.name} has no stamps; its header says {rate:g} Hz."
        table.remarks.append(Remark("found", text_))
    return replace(table, names=tuple(found), columns=list(found.values()), rate=rate, clock=CRYSTAL)


def _clock(columns: dict[str, Series]) -> dict[str, Series]:
    """Return the stamps in µs: ticks of 0.1 ms with MT units, µs with DOT."""
    stamps = columns.get("SampleTimeFine")
    if stamps is None or not np.all(np.isfinite(stamps)) or stamps.size < 2 or not np.ptp(stamps):
        return {}
    step = float(np.median(np.abs(np.diff(stamps))))
    are_ticks = 1e6 / (_TICK * max(step, 1.0)) >= 1.0 and 1e6 / max(step, 1.0) > _MOST_HERTZ_OF_TICKS
    return {"t [us]": stamps * _TICK if are_ticks else stamps}


def _triads(columns: dict[str, Series], *, is_dot: bool) -> dict[str, Series]:
    """Return the triads: rates where there are any, else increments; and the magnetometer."""
    found: dict[str, Series] = {}
    if {"Acc_X", "Acc_Y", "Acc_Z"} <= set(columns):
        found |= {f"a{a.lower()} [m/s^2]": columns[f"Acc_{a}"] for a in "XYZ"}
    elif names := _present(columns, ("VelInc_X", "VelInc_Y", "VelInc_Z"), ("dV[1]", "dV[2]", "dV[3]")):
        found |= {f"a{a} [m/s]": columns[n] for a, n in zip("xyz", names, strict=True)}
    if {"Gyr_X", "Gyr_Y", "Gyr_Z"} <= set(columns):
        unit = "deg/s" if is_dot else "rad/s"
        found |= {f"g{a.lower()} [{unit}]": columns[f"Gyr_{a}"] for a in "XYZ"}
    elif names := _present(
        columns,
        tuple(f"OriInc_q{i}" for i in range(4)),
        ("dQ_W", "dQ_X", "dQ_Y", "dQ_Z"),
        ("dq_W", "dq_X", "dq_Y", "dq_Z"),
    ):
        turned = _rotation_vectors([columns[n] for n in names])
        found |= {f"g{a} [rad]": v for a, v in zip("xyz", turned, strict=True)}
    if {"Mag_X", "Mag_Y", "Mag_Z"} <= set(columns):
        # In units of the field at the place of Xsens' own calibration: no unit of a field, so counts.
        found |= {f"m{a.lower()} [counts]": columns[f"Mag_{a}"] for a in "XYZ"}
    return found


def _present(columns: dict[str, Series], *choices: tuple[str, ...]) -> tuple[str, ...]:
    """Return the first group of names that are all there, or none."""
    return next((names for names in choices if set(names) <= set(columns)), ())


def _rotation_vectors(quaternion: list[Series]) -> list[Series]:
    """Return the rotation vectors of quaternions, scalar first as the file has them."""
    scalar, vector = quaternion[0], np.stack(quaternion[1:])
    length = np.sqrt(np.sum(vector**2, axis=0))
    angle = 2.0 * np.arctan2(length, np.abs(scalar))
    scale = np.where(length > 0.0, angle / np.where(length > 0.0, length, 1.0), 2.0) * np.where(
        scalar < 0.0, -1.0, 1.0
    )
    return [scale * v for v in vector]
