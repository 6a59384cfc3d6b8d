"""ULog, the log of PX4, by the library pyulog.

References
----------
PX4 user guide, *ULog File Format*; message definitions `SensorCombined`, `SensorAccel`, `SensorGyro`,
`SensorAccelFifo`, `SensorGyroFifo`, `VehicleImu`, `SensorMag` and `VehicleMagnetometer`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stdout
from dataclasses import replace
from importlib import import_module
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.errors import RecordingError, UsageError, install
from tumble.files import opened
from tumble.recording.formats.logs.own_parameters import Columns, OwnParameters, Px4
from tumble.recording.formats.streams import (
    Stream,
    automatic,
    merge_streams,
    of_increments,
    table_of_streams,
)
from tumble.recording.formats.table import RawTable, foreign, mapped
from tumble.recording.samples import Remark, Samples

_HEADER = 16  # bytes
_RAW = (("sensor_accel_fifo", "sensor_gyro_fifo"), ("sensor_accel", "sensor_gyro"))
_NO_STAMP = 2**31 - 1  # accelerometer_timestamp_relative of a message without an accelerometer's sample
_OWN_AXES = "is in the magnetometer's own axes, which may be turned against the autopilot's"
_CORRECTED = ("sensor_combined", "vehicle_imu", "vehicle_magnetometer")
_SELECTION, _THERMAL = "sensor_selection", "sensor_correction"
_DEVICES = {"ACC": "accel_device_id", "GYRO": "gyro_device_id", "MAG": "device_id"}


def read_tables(path: Path, topics: Sequence[str] = ()) -> Iterator[RawTable]:
    """Read a ULog file.

    Parameters
    ----------
    path : the file.
    topics : one message, or one of each triad, as ``sensor_combined`` or ``sensor_accel:1``.

    Raises
    ------
    RecordingError
        If the file is damaged or holds no inertial message.
    UsageError
        If a message is not there, or pyulog is not installed.
    OSError
        If the file cannot be read.
    """
    try:
        library: Any = import_module("pyulog")
    except ImportError as error:
        raise UsageError(f"{path.name} is a ULog; reading it needs pyulog: {install('px4')}.") from error
    # Opened here, for pyulog leaves a damaged file open; what it prints of damage is said by a remark.
    with foreign(path, "ULog"), opened(path) as file:
        with redirect_stdout(StringIO()):
            log = library.ULog(file, [*_MESSAGES, _SELECTION, _THERMAL], disable_str_exceptions=True)
        streams = _streams(log, path.name)
    if not streams:
        names = sorted({d.name for d in log.data_list} | set(log.message_formats))
        raise RecordingError(
            f"{path.name} holds none of the messages {', '.join(_MESSAGES)}; log sensor_combined at full rate. "
            f"It knows {', '.join(names[:12])}{' and more' if len(names) > 12 else ''}."
        )
    remarks = _damage(log, path)
    yield table_of_streams(path, streams, topics, automatic(streams, _RAW), remarks)


def _damage(log: Any, path: Path) -> list[Remark]:
    """Say what is missing of a log."""
    said: list[Remark] = []
    if _is_cut(path) or log.file_corruption:
        said.append(Remark("mended", f"{path.name} is damaged or cut short; what could be read is used."))
    if log.dropouts:
        lost = sum(d.duration for d in log.dropouts) / 1000.0
        text = f"{path.name}: the logger lost {lost:.3g} s in {len(log.dropouts)} dropout(s)."
        said.append(Remark("found", text))
    return said


def _is_cut(path: Path) -> bool:
    """Whether the last message does not end where the file ends."""
    data = mapped(path)
    position, stop = _HEADER, len(data)
    while position + 3 <= stop:
        position += 3 + data[position] + 256 * data[position + 1]
    return position != stop


def _streams(log: Any, name: str) -> list[Stream]:
    """Return the streams that the log's messages make, raw ones first."""
    streams: list[Stream] = []
    for kind, make in _MESSAGES.items():
        for data in sorted((d for d in log.data_list if d.name == kind), key=lambda d: d.multi_id):
            if len(data.data["timestamp"]) > 1:
                stream = make(f"{kind}:{data.multi_id}", data.data, name)
                streams.append(replace(stream, own=_own_parameters(log, data)))
    return streams


def _own_parameters(log: Any, data: Any) -> OwnParameters:
    """Return what the autopilot's parameters did to a message's numbers, and of which sensors they are."""
    beside: dict[str, Columns] = {d.name: d.data for d in log.data_list if d.name in (_SELECTION, _THERMAL)}
    told = beside.get(_SELECTION, {}) if data.name == "sensor_combined" else data.data
    known = {part: np.unique(told[field]) for part, field in _DEVICES.items() if field in told}
    devices = {part: [int(one) for one in found if one] for part, found in known.items()}
    changes = [(stamp / 1e6, name, float(value)) for stamp, name, value in log.changed_parameters]
    first = {name: float(value) for name, value in log.initial_parameters.items()}
    return OwnParameters(first, changes, Px4(devices, beside.get(_THERMAL)), data.name not in _CORRECTED)


def _seconds(columns: Columns) -> Series:
    """Return when the samples were taken, or where that is not said when they were published."""
    stamps = columns.get("timestamp_sample", columns["timestamp"])
    return np.asarray(stamps if np.any(stamps) else columns["timestamp"], dtype=np.float64) / 1e6


def _triad(columns: Columns, name: str) -> Vectors:
    names = [f"{name}[{i}]" for i in range(3)] if name else list("xyz")
    return np.column_stack([np.asarray(columns[n], dtype=np.float64) for n in names])


def _combined(name: str, columns: Columns, file: str) -> Stream:
    """The accelerometer's stamp is relative to the gyro's; rows without a sample of it have none."""
    time = np.asarray(columns["timestamp"], dtype=np.float64)
    relative = np.asarray(columns["accelerometer_timestamp_relative"], dtype=np.float64)
    force, rate = _triad(columns, "accelerometer_m_s2"), _triad(columns, "gyro_rad")
    if not np.any(relative):
        return Stream(name, Samples(time / 1e6, force, rate))
    there = relative != _NO_STAMP
    accelerometer = Samples((time + relative)[there] / 1e6, force[there])
    merged, _ = merge_streams(file, (name, accelerometer), (name, Samples(time / 1e6, None, rate)))
    return Stream(name, merged)


def _vehicle(name: str, columns: Columns, file: str) -> Stream:
    kinds = ("delta_velocity", "delta_angle")
    force, rate = (_triad(columns, kind) for kind in kinds)
    spans = [np.asarray(columns[f"{kind}_dt"], dtype=np.float64) / 1e6 for kind in kinds]
    return of_increments(name, _seconds(columns), force, rate, spans)


def _lone(name: str, columns: Columns, file: str) -> Stream:
    """One raw sensor, in the sensor's own axes."""
    values, temperature = _triad(columns, ""), columns.get("temperature")
    known = temperature is not None and bool(np.all(np.isfinite(temperature)) and np.any(temperature))
    celsius = np.asarray(temperature, dtype=np.float64) if known else None
    return _of_one_triad(name, _seconds(columns), values, celsius)


def _of_one_triad(name: str, time: Series, values: Vectors, celsius: Series | None = None) -> Stream:
    triads = (values, None) if "accel" in name else (None, values)
    return Stream(name, Samples(time, *triads, celsius))


def _fifo(name: str, columns: Columns, file: str) -> Stream:
    """Up to 32 samples a message, the last of them at the message's stamp."""
    counts = np.asarray(columns["samples"], dtype=np.intp)
    width = 1 + max(int(n[2:-1]) for n in columns if n.startswith("x["))
    behind = counts[:, None] - 1 - np.arange(width)
    there = behind >= 0
    step = np.asarray(columns["dt"], dtype=np.float64)[:, None]
    time = _seconds(columns)[:, None] - step * behind / 1e6
    scale = np.asarray(columns["scale"], dtype=np.float64)[:, None]
    axes = [np.column_stack([columns[f"{a}[{i}]"] for i in range(width)]) * scale for a in "xyz"]
    return _of_one_triad(name, time[there], np.column_stack([a[there] for a in axes]))


def _magnetometer(name: str, columns: Columns, file: str) -> Stream:
    """The raw sensor, or the one that the autopilot's calibration has corrected and turned; gauss."""
    values = _triad(columns, "magnetometer_ga" if "magnetometer_ga[0]" in columns else "")
    samples = Samples(_seconds(columns), magnetic_field=values)
    return Stream(name, samples, {"m": "gauss"}, _OWN_AXES * name.startswith("sensor_mag"))


_MESSAGES: dict[str, Callable[[str, Columns, str], Stream]] = {
    "sensor_accel_fifo": _fifo,
    "sensor_gyro_fifo": _fifo,
    "sensor_accel": _lone,
    "sensor_gyro": _lone,
    "sensor_combined": _combined,
    "vehicle_imu": _vehicle,
    "sensor_mag": _magnetometer,
    "vehicle_magnetometer": _magnetometer,
}
"""Messages that are read, and what makes streams of them."""
