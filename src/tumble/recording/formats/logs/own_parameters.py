"""An autopilot's own calibration parameters, as its log states them: were they active, and which device are they of.

What ULog's `sensor_combined` and `vehicle_imu`, and all of DataFlash's inertial messages hold, is what these
parameters left of the sensors' output. A calibration of such numbers holds for these parameters alone.

References
----------
PX4 user guide, *ULog File Format* (message `P`); ArduPilot developer documentation, *Logging* (message PARM).
"""

from __future__ import annotations

import hashlib
import re
import struct
from pathlib import Path

from tumble.files import opened
from tumble.recording.formats.table import mapped
from tumble.recording.recording import Remark

ULOG, DATAFLASH = b"ULog\x01\x12\x35", b"\xa3\x95\x80"
_OFFSET = re.compile(r"CAL_(ACC|GYRO)\d_[XYZ]OFF|INS_(ACC|GYR)\d?OFFS_[XYZ]|INS_GYROFFS_[XYZ]")
_SCALE = re.compile(r"CAL_ACC\d_[XYZ]SCALE|INS_ACC\d?SCAL_[XYZ]")
_SWITCH = re.compile(r"TC_[AG]_ENABLE|INS_TCAL\d_ENABLE")
_CURVE = re.compile(r"TC_[AG]\d_\w+|INS_TCAL\d_\w+")
_DEVICE = re.compile(r"CAL_(ACC|GYRO|MAG)\d_ID|INS_(ACC|GYR)\d?_ID|COMPASS_DEV_ID\d?")
_FIELD_OFFSET = re.compile(r"CAL_MAG\d_[XYZ](OFF|ODIAG)|COMPASS_(OFS|ODI|MOT)\d?_[XYZ]")
_FIELD_SCALE = re.compile(r"CAL_MAG\d_[XYZ]SCALE|COMPASS_DIA\d?_[XYZ]|COMPASS_SCALE\d?")
_HEADER = 16  # bytes of a ULog
_SHOWN = 6
UNSTATED = "the log does not state the autopilot's own parameters, so that these may have corrected its numbers already"
"""Said of a log whose numbers come after an autopilot's parameters, and that lacks them."""
_FAR = 16 << 20  # bytes behind the last parameter of a DataFlash log, which begins with them


def parameters_of(path: Path) -> dict[str, float]:
    """Return the calibration parameters that a log begins with, by name; none of what is no log.

    Parameters
    ----------
    path : of a file.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    with opened(path) as file:
        head = file.read(8)
    if head.startswith(ULOG):
        found = _of_ulog(path)
    elif head.startswith(DATAFLASH):
        found = _of_dataflash(path)
    else:
        return {}
    kinds = (_OFFSET, _SCALE, _SWITCH, _CURVE, _DEVICE, _FIELD_OFFSET, _FIELD_SCALE)
    return {name: value for name, value in found.items() if any(k.fullmatch(name) for k in kinds)}


def _of_ulog(path: Path) -> dict[str, float]:
    """Return the parameters that stand before the first data message."""
    data = mapped(path)
    found: dict[str, float] = {}
    position, stop = _HEADER, len(data)
    while position + 3 <= stop:
        size, kind = (
            int.from_bytes(data[position : position + 2], "little"),
            data[position + 2 : position + 3],
        )
        body = data[position + 3 : position + 3 + size]
        position += 3 + size
        if kind == b"A":
            break
        if kind != b"P" or not body:
            continue
        words, value = body[1 : 1 + body[0]].decode("ascii", "replace").split(" "), body[1 + body[0] :]
        if len(words) == 2 and len(value) >= 4:
            form = {"float": "<f", "int32_t": "<i"}.get(words[0])
            if form is not None:
                found[words[1]] = float(struct.unpack_from(form, value)[0])
    return found


def _of_dataflash(path: Path) -> dict[str, float]:
    """Return the first value of each parameter that a message PARM states."""
    data = mapped(path)
    layout: tuple[int, int, int, int] | None = None  # kind, length, places of name and value
    lengths = {128: 89}
    found: dict[str, float] = {}
    position, stop, last = 0, len(data), 0
    while position + 3 <= stop and position < last + _FAR:
        length = lengths.get(data[position + 2], 0) if data[position : position + 2] == b"\xa3\x95" else 0
        if not length or position + length > stop:
            position = data.find(b"\xa3\x95", position + 1)
            if position < 0:
                break
            continue
        kind = data[position + 2]
        if kind == 128:
            message = data[position : position + length]
            lengths[message[3]] = message[4]
            if message[5:9] == b"PARM":
                form = message[9:25].split(b"\0")[0].decode("ascii", "replace")
                layout = _layout(message[3], message[4], form) or layout
        elif layout is not None and kind == layout[0]:
            name = data[position + layout[2] : position + layout[2] + 16].split(b"\0")[0]
            (value,) = struct.unpack_from("<f", data, position + layout[3])
            last = position
            found.setdefault(name.decode("ascii", "replace"), float(value))
        position += length
    return found


def _layout(kind: int, length: int, form: str) -> tuple[int, int, int, int] | None:
    """Return where name and value of a message PARM stand, from its format characters."""
    sizes = {"Q": 8, "I": 4, "N": 16, "f": 4}
    if "Nf" not in form or any(c not in sizes for c in form):
        return None
    place = 3 + sum(sizes[c] for c in form[: form.index("N")])
    return (kind, length, place, place + 16) if place + 20 <= length else None


def active(parameters: dict[str, float]) -> dict[str, float]:
    """Return the parameters that change numbers: offsets that are not 0, scale factors that are not 1, curves in use.

    Parameters
    ----------
    parameters : as `parameters_of` gives them.
    """
    found = {n: v for n, v in parameters.items() if _OFFSET.fullmatch(n) and v != 0.0}
    # A scale factor of exactly 0 is ArduPilot's for a sensor that is not there.
    found |= {n: v for n, v in parameters.items() if _SCALE.fullmatch(n) and v not in (0.0, 1.0)}
    switches = {n: v for n, v in parameters.items() if _SWITCH.fullmatch(n) and v != 0.0}
    for switch in switches:
        family = switch.removesuffix("_ENABLE")
        found |= {n: v for n, v in parameters.items() if n.startswith(family) and _CURVE.fullmatch(n)}
    return found | switches


def active_on_field(parameters: dict[str, float]) -> dict[str, float]:
    """Return the parameters that change a magnetometer's numbers.

    Parameters
    ----------
    parameters : as `parameters_of` gives them.
    """
    found = {n: v for n, v in parameters.items() if _FIELD_OFFSET.fullmatch(n) and v != 0.0}
    return found | {n: v for n, v in parameters.items() if _FIELD_SCALE.fullmatch(n) and v not in (0.0, 1.0)}


def identity_of(path: Path) -> tuple[str, ...]:
    """Return what distinguishes a log's active parameters from others: twelve hexadecimal digits; none without any.

    Parameters
    ----------
    path : of a log whose messages these parameters have corrected.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    return _identity(active(parameters_of(path)))


def field_identity_of(path: Path) -> tuple[str, ...]:
    """Return the same of the parameters that have corrected the magnetometer that is read of a log.

    ArduPilot logs its magnetometer corrected; PX4 does in `vehicle_magnetometer`, and not in `sensor_mag`.

    Parameters
    ----------
    path : of a file; what is no log has none.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    found = active_on_field(parameters_of(path))
    if found and any(name.startswith("CAL_") for name in found) and mapped(path).find(b"sensor_mag:") >= 0:
        return ()
    return _identity(found)


def _identity(found: dict[str, float]) -> tuple[str, ...]:
    text = "\n".join(f"{name}={found[name]:.9g}" for name in sorted(found))
    return (hashlib.sha256(text.encode()).hexdigest()[:12],) if found else ()


def about_parameters(path: Path) -> list[Remark]:
    """Say which own parameters have corrected a log's numbers, and which devices they are of.

    Parameters
    ----------
    path : of a log whose numbers are what its autopilot's parameters left.
    """
    known = parameters_of(path)
    stated = any(_OFFSET.fullmatch(name) for name in known)
    text = f"{path.name}: {UNSTATED}. Set them to their defaults before recording."
    remarks = [] if stated else [Remark("corrected", text)]
    found = active(known) | active_on_field(known)
    if not found:
        return remarks
    told = [f"{name} = {value:.6g}" for name, value in found.items()]
    more = f" and {len(told) - _SHOWN} more" if len(told) > _SHOWN else ""
    devices = [f"{n} = {v:.0f}" for n, v in known.items() if _DEVICE.fullmatch(n) and v != 0.0]
    remarks.append(
        Remark(
            "corrected",
            f"{path.name}: the autopilot's own parameters were active ({', '.join(told[:_SHOWN])}{more}). A "
            "calibration of these numbers holds on top of them, and not in their place. For numbers to load into the "
            "autopilot set them to their defaults and record again.",
        )
    )
    if devices:
        remarks.append(Remark("found", f"{path.name}: devices {', '.join(devices[:_SHOWN])}."))
    return remarks
