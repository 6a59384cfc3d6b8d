"""An autopilot's own calibration parameters, undone: what its log holds becomes the sensor's own output again.

PX4 corrects `sensor_combined`, `vehicle_imu` and `vehicle_magnetometer`, ArduPilot all that it logs. Both compute
``x = R S (u - o)`` with the parameters that the log states (its offsets, scale factors, thermal offsets, and how the
board is turned), so that u follows from x. Parameters that change within the log hold from then on.

References
----------
PX4, `sensor_calibration` (``Correct``, ``set_rotation``), `conversion/rotation.h`, ``SensorCorrection``; ArduPilot,
`AP_InertialSensor_Backend.cpp`, `AP_InertialSensor_tempcal.cpp`, `AP_Compass_Backend.cpp`, `rotations.h`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field as made, replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import Matrix, Series, Vector, Vectors, inverted
from tumble.attitude import matrix_from_angles
from tumble.errors import RecordingError
from tumble.recording.columns import NAMES
from tumble.recording.samples import Remark, Samples
from tumble.records import dataclass

UNSTATED = "the log does not state"
"""Said of an autopilot's parameters that a log lacks, and that may have corrected its numbers."""
_PARTS = {"specific_force": "ACC", "angular_rate": "GYR", "magnetic_field": "MAG"}
_TURNS = NAMES["roll,pitch,yaw of the enumerated rotations, degrees"]
_PX4_TURNS, _ARDUPILOT_TURNS = (f"{_TURNS['both']};{_TURNS[own]}".split(";") for own in ("PX4", "ArduPilot"))
_REFERENCE = 35.0  # °C of ArduPilot's polynomials
_LARGEST_SCALE = 1.5  # of a compass; ArduPilot leaves out what is larger, or smaller than its inverse

Columns = Mapping[str, npt.NDArray[Any]]


@dataclass
class Asked:
    """Parameters that hold at a time, which of those that were asked for change numbers, and which are missing."""

    stated: dict[str, float]
    active: dict[str, dict[str, None]] = made(default_factory=dict[str, dict[str, None]])
    missing: dict[str, None] = made(default_factory=dict[str, None])

    def number(self, name: str, default: float, *idle: float) -> float:
        """Return a parameter that not every firmware has; `idle` are other values of it that change nothing."""
        value = self.stated.get(name, default)
        if value not in (default, *idle):
            self.active.setdefault(name, {})[f"{value:.6g}"] = None
        return value

    def needed(self, name: str, default: float) -> float:
        """Return a parameter that every firmware has where it is asked for."""
        if name not in self.stated:
            self.missing[name] = None
        return self.number(name, default)

    def triad(self, name: str, default: float, *idle: float) -> Vector:
        """Return three parameters, whose axes stand in place of the braces; any of `idle` stands for the default."""
        names = [name.format(axis) for axis in "XYZ"]
        if not all(n in self.stated for n in names):
            self.missing[name.format("*")] = None
        found = np.array([self.number(n, default, *idle) for n in names])
        return np.where(np.isin(found, idle), default, found)


@dataclass(frozen=True)
class OwnParameters:
    """What an autopilot did to the numbers of a stream.

    Attributes
    ----------
    first : its parameters by name, as the log begins.
    changes : time in s, name and value of those that were changed later.
    formula : what it does with them.
    raw : whether it has not done it to these.
    """

    first: Mapping[str, float]
    changes: Sequence[tuple[float, str, float]]
    formula: Px4 | ArduPilot
    raw: bool = False

    def turn(self) -> Matrix | None:
        """Return the rotation from a magnetometer's raw axes to the accelerometers', None for none that is known."""
        stated = dict(self.first) | {name: value for _, name, value in self.changes}
        try:
            turn = self.formula.turn(Asked({n: v for n, v in stated.items() if np.isfinite(v)}))
        except RecordingError:
            return None
        return None if np.allclose(turn, np.eye(3)) else turn

    def undone(self, samples: Samples, name: str) -> tuple[Samples, list[Remark]]:
        """Return the samples as the sensor gave them, and what is said of that; `name` is of file and stream."""
        if self.raw:
            return samples, []
        asked = Asked(dict(self.first))
        raw = {part: self._undone(part, samples, asked) for part in _PARTS}
        said: list[Remark] = []
        if asked.active:
            told = ", ".join(f"{n} = {', then '.join(values)}" for n, values in asked.active.items())
            text = f"{name}: the autopilot's own parameters are undone ({told}). What `tumble convert` writes replaces "
            said.append(
                Remark("mended", f"{text}their offsets and scale factors; how the board is turned stays.")
            )
        if asked.missing:
            text = f"{name}: {UNSTATED} {', '.join(asked.missing)}, by which the autopilot may have corrected its "
            text += "numbers; they are read as they are. If it did, record with these in the log, or at their defaults."
            said.append(Remark("corrected", text))
        return replace(samples, **raw), said

    def _undone(self, part: str, samples: Samples, asked: Asked) -> Vectors | None:
        values, time = getattr(samples, part), samples.time
        if values is None:
            return None
        asked.stated = {name: value for name, value in self.first.items() if np.isfinite(value)}
        # Changes of one time stay in their order: the last holds.
        changes = sorted((c for c in self.changes if np.isfinite(c[2])), key=lambda change: change[0])
        raw, steps = np.empty_like(values), [(-np.inf, "", 0.0), *changes, (np.inf, "", 0.0)]
        for (since, name, value), (until, _, _) in pairwise(steps):
            asked.stated[name] = value
            inside = (time > since) & (time <= until)
            if inside.any():
                matrix, offset = self.formula(_PARTS[part], asked, time[inside])
                if not np.linalg.det(matrix):
                    raise RecordingError(
                        f"A scale factor of {_PARTS[part]} in the log is 0, and what it made 0 cannot be undone. "
                        "Set it to 1, and record again."
                    )
                raw[inside] = values[inside] @ inverted(matrix).T + offset
        return raw


def _turn(name: str, number: float, known: Sequence[str]) -> Matrix:
    if not 0 <= number < len(known):
        raise RecordingError(
            f"The log's {name} is {number:.0f}, a rotation of its own, which cannot be undone. Set it to one of the "
            "list, and record again."
        )
    return matrix_from_angles(np.radians([float(angle) for angle in known[int(number)].split(",")]))


def _symmetric(diagonal: Vector, beside: Vector) -> Matrix:
    x, y, z = beside
    return np.diag(diagonal) + np.array([[0.0, x, y], [x, 0.0, z], [y, z, 0.0]])


@dataclass(frozen=True)
class Px4:
    """PX4's formula.

    Attributes
    ----------
    devices : identities of the sensors of a stream: of ACC, GYRO and MAG those that the log tells.
    thermal : the messages `sensor_correction`, or None.
    """

    devices: Mapping[str, Sequence[int]]
    thermal: Columns | None

    def __call__(self, part: str, asked: Asked, time: Series) -> tuple[Matrix, Vectors]:
        """Return R S and o, of a part (ACC, GYR or MAG) at times: (3, 3) and (times, 3)."""
        kind = "GYRO" if part == "GYR" else part
        slot, device = self._slot(kind, asked)
        level = asked.triad("SENS_BOARD_{}_OFF", 0.0)
        matrix = matrix_from_angles(np.radians(level)) @ self._turn(kind, slot, asked)
        offset = np.zeros((time.size, 3))
        if part != "MAG" and asked.number(f"TC_{part[0]}_ENABLE", 0.0):
            offset += self._thermal("accel" if part == "ACC" else "gyro", device, time)
        if slot is None:
            return matrix, offset
        scale = np.ones(3) if part == "GYR" else asked.triad(f"CAL_{kind}{slot}_{{}}SCALE", 1.0)
        beside = np.zeros(3) if part != "MAG" else asked.triad(f"CAL_{kind}{slot}_{{}}ODIAG", 0.0)
        return matrix @ _symmetric(scale, beside), offset + asked.triad(f"CAL_{kind}{slot}_{{}}OFF", 0.0)

    def turn(self, asked: Asked) -> Matrix:
        """Return the rotation from a magnetometer's raw axes to the accelerometers': see `OwnParameters.turn`."""
        board = self._turn("ACC", None, asked)
        return board.T @ self._turn("MAG", self._slot("MAG", asked)[0], asked)

    def _turn(self, kind: str, slot: int | None, asked: Asked) -> Matrix:
        """Return the rotation of a sensor, before the level is adjusted."""
        named = f"CAL_{kind}{slot}_ROT"
        own = asked.number(named, -1.0, 0.0)
        if own < 0.0:
            named = "SENS_BOARD_ROT"
            own = asked.needed(named, 0.0)
        return _turn(named, own, _PX4_TURNS)

    def _slot(self, kind: str, asked: Asked) -> tuple[int | None, int]:
        """Return the number of a sensor's parameters, None without any, and its identity, 0 if it is not known."""
        stated = {n: asked.stated.get(f"CAL_{kind}{n}_ID") for n in range(4)}
        if not any(one is not None for one in stated.values()):
            asked.missing[f"CAL_{kind}*"] = None
        known = {int(one) % 2**32: n for n, one in stated.items() if one}
        devices = self.devices.get(kind) or list(known)
        if len(devices) > 1:
            raise RecordingError(
                f"The log does not state which of the sensors with CAL_{kind}n_ID {', '.join(map(str, devices))} its "
                "numbers are of. Read one by its own message (--topic vehicle_imu:0, --topic vehicle_magnetometer:0)."
            )
        device = devices[0] if devices else 0
        return known.get(device), device

    def _thermal(self, name: str, device: int, time: Series) -> Vectors:
        """Return the thermal offsets that were applied, each from its message on; none of a sensor without a curve."""
        said = self.thermal
        # Older firmware names no devices there.
        if said is None or not device or f"{name}_device_ids[0]" not in said:
            raise RecordingError(
                f"The log's numbers are corrected by temperature (TC_{name[0].upper()}_ENABLE), and it lacks "
                "sensor_correction with device_ids, which says by how much. Log it, or the raw sensors, or set "
                "TC_A_ENABLE and TC_G_ENABLE to 0, and record again."
            )
        for n in range(4):
            if device in said.get(f"{name}_device_ids[{n}]", ()):
                offsets = np.column_stack([said[f"{name}_offset_{n}[{i}]"] for i in range(3)])
                row = np.searchsorted(said["timestamp"] / 1e6, time, side="right") - 1
                return offsets[np.maximum(row, 0)].astype(np.float64)
        return np.zeros((1, 3))


@dataclass(frozen=True)
class ArduPilot:
    """ArduPilot's formula.

    Attributes
    ----------
    instance : of the sensor, from 0.
    celsius : time in s and temperature of the unit, or None.
    """

    instance: int
    celsius: tuple[Series, Series] | None

    def __call__(self, part: str, asked: Asked, time: Series) -> tuple[Matrix, Vectors]:
        """Return R S and o, as of PX4. A compass is turned before it is corrected."""
        unit = f"{self.instance + 1}" if self.instance else ""
        if part == "MAG":
            diagonal = asked.triad(f"COMPASS_DIA{unit}_{{}}", 1.0, 0.0)
            scale = asked.number(f"COMPASS_SCALE{unit}", 0.0, 1.0)
            scale = scale if 1.0 / _LARGEST_SCALE <= scale <= _LARGEST_SCALE else 1.0
            matrix = scale * _symmetric(diagonal, asked.triad(f"COMPASS_ODI{unit}_{{}}", 0.0))
            return matrix, -asked.triad(f"COMPASS_OFS{unit}_{{}}", 0.0)[None]
        matrix = self.turn(asked).T
        if part == "ACC":
            matrix = matrix * asked.triad(f"INS_ACC{unit}SCAL_{{}}", 1.0, 0.0)
        return matrix, asked.triad(f"INS_{part}{unit}OFFS_{{}}", 0.0) + self._thermal(part, asked, time)

    def turn(self, asked: Asked) -> Matrix:
        """Return the rotation from a magnetometer's raw axes, which are the vehicle's: see `OwnParameters.turn`."""
        name = "AHRS_ORIENTATION"
        return _turn(name, asked.needed(name, 0.0), _ARDUPILOT_TURNS).T

    def _thermal(self, part: str, asked: Asked, time: Series) -> Vectors:
        """Return P(T) - P(T of the calibration)."""
        begin = f"INS_TCAL{self.instance + 1}_"
        if asked.number(f"{begin}ENABLE", 0.0, 2.0) != 1.0:
            return np.zeros((1, 3))
        if self.celsius is None:
            raise RecordingError(
                f"The log's numbers are corrected by temperature ({begin}ENABLE), and it does not hold that of IMU:"
                f"{self.instance}. Log the message IMU, or set {begin}ENABLE to 0, and record again."
            )
        c = [asked.triad(f"{begin}{part}{k}_{{}}", 0.0) for k in (1, 2, 3)]
        low, high = asked.needed(f"{begin}TMIN", 0.0), asked.needed(f"{begin}TMAX", 70.0)
        own = asked.needed(f"INS_{part}{self.instance + 1}_CALTEMP", -300.0)
        celsius = np.append(np.interp(time, *self.celsius), own)
        d = np.clip(celsius, low, high)[:, None] - _REFERENCE
        effects = 1e-6 * (c[0] + (c[1] + c[2] * d) * d) * d
        return effects[:-1] - effects[-1]
