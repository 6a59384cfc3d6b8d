"""Sensors that come apart, each with stamps of its own, as phones send them: put onto one time base.

References
----------
Sensor Logger, *Awesome Sensor Logger*: `payload`, a list of `name`, `time` in ns since 1970 and `values`; its *One-Page
Unit Reference*: an iPhone's uncalibrated accelerometer is in g, unless units are standardised. SensorServer, README:
`type`, `timestamp` in ns of Android's elapsed clock, `values`; Android developer guide, *Motion sensors*: of an
uncalibrated sensor the first three values are what it measured, the others the bias that was found.
"""

from __future__ import annotations

import json
from dataclasses import field
from typing import Any

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.capture.source import Channels, Piece, SourceOptions
from tumble.recording import Merging, Samples, joined, rank_sensor, read_units_option
from tumble.records import dataclass

# s of stamps after which it is known which sensors come, and a step back that is a new clock.
LONG_ENOUGH, NEW_CLOCK = 1.0, 1.0
# s that a sample waits for the magnetometer's that belongs to it.
FIELD_WAITS = 0.3
# Bytes of a line that has no end.
LONGEST_LINE = 1 << 24
# An accelerometer whose numbers are smaller on the average is in g.
_LARGEST_IN_G = 4.0


_NO_FIELD = Samples(np.zeros(0), magnetic_field=np.zeros((0, 3)))


@dataclass
class _Kept:
    """One sensor: what came since it was last taken, and its newest stamp."""

    time: list[float] = field(default_factory=list[float])
    values: list[tuple[float, float, float]] = field(default_factory=list[tuple[float, float, float]])
    last: float = -np.inf

    def taken(self) -> tuple[Series, Vectors]:
        """Return what came, and forget it."""
        time, values = np.array(self.time), np.array(self.values).reshape(-1, 3)
        self.time, self.values = [], []
        return time, values


class ApartSensors:
    """Samples of single sensors in, whole samples out.

    The gyro's stamps are the time base, and the specific force is interpolated there, as for recordings whose sensors
    come apart. A magnetometer's sample goes to the next stamp.

    Parameters
    ----------
    options : with units that nobody else says.
    name : of the stream, for messages.
    """

    def __init__(self, options: SourceOptions, name: str) -> None:
        self._options, self._name = options, name
        self._sensors: dict[tuple[str, int], _Kept] = {}
        self._chosen: dict[str, tuple[str, int]] | None = None
        self._merging = Merging(name, "the accelerometer", "the gyro")
        self._whole: list[Samples] = []
        self._field: Samples = _NO_FIELD

    def add(self, kind: str, rank: int, time: float, values: tuple[float, float, float]) -> None:
        """Take a sample of a sensor.

        Parameters
        ----------
        kind : "force", "rate" or "field".
        rank : which sensor of that kind: the least that measures is used.
        time : s on the clock that the sensors have in common.
        values : three numbers.
        """
        if not np.isfinite([time, *values]).all():
            return
        sensor = self._sensors.setdefault((kind, rank), _Kept())
        if sensor.last - NEW_CLOCK < time <= sensor.last:
            return
        if time <= sensor.last:
            self._begin_anew()
        sensor.last = time
        sensor.time.append(time)
        sensor.values.append(values)

    def _begin_anew(self) -> None:
        """The app was started again, or its clock was set: what waits for a partner has none any more."""
        self._merging = Merging(self._name, "the accelerometer", "the gyro")
        self._field = _NO_FIELD
        self._whole.clear()
        for one in self._sensors.values():
            one.last = -np.inf
            one.taken()

    def pieces(self, *, last: bool = False) -> list[Piece]:
        """Return what is complete.

        Parameters
        ----------
        last : whether nothing follows.
        """
        made: list[Piece] = []
        if self._chosen is None:
            times = [t for one in self._sensors.values() if one.time for t in (one.time[0], one.time[-1])]
            if not times or (not last and max(times) - min(times) < LONG_ENOUGH):
                return []
            channels = self._decide()
            if channels is None:
                return []
            made.append(channels)
        samples = self._taken(last=last)
        return [*made, samples] if samples is not None and len(samples) else made

    def _decide(self) -> Channels | None:
        """Choose of each kind the best sensor that shows anything but zeros."""
        chosen: dict[str, tuple[str, int]] = {}
        for key in sorted(self._sensors):
            if key[0] not in chosen and np.array(self._sensors[key].values).any():
                chosen[key[0]] = key
        base = self._sensors.get(chosen.get("rate") or chosen.get("force") or ("", 0))
        if base is None or len(base.time) < 2:
            return None
        self._chosen = chosen
        said = read_units_option(self._options.units)
        force = said.specific_force
        if not force and "force" in chosen:
            sizes = np.linalg.norm(np.array(self._sensors[chosen["force"]].values), axis=1)
            force = "g" if float(np.median(sizes)) < _LARGEST_IN_G else "m/s^2"
        step = float(np.median(np.diff(base.time)))
        return Channels(
            force if "force" in chosen else None,
            (said.angular_rate or "rad/s") if "rate" in chosen else None,
            self._options.rate or 1.0 / max(step, 1e-5),
            magnetic_field_unit=(said.magnetic_field or "uT") if "field" in chosen else None,
        )

    def _taken(self, *, last: bool) -> Samples | None:
        assert self._chosen is not None
        taken: dict[str, tuple[Series, Vectors]] = {
            kind: self._sensors[key].taken() for kind, key in self._chosen.items()
        }
        for key, other in self._sensors.items():
            if key not in self._chosen.values():
                other.taken()
        force, rate = taken.get("force"), taken.get("rate")
        if force is None or rate is None:
            time = taken["rate" if force is None else "force"][0]
            whole = Samples(time, None if force is None else force[1], None if rate is None else rate[1])
        else:
            self._merging.add(Samples(force[0], force[1]), Samples(rate[0], None, rate[1]))
            whole = self._merging.take(last=last)
        if "field" in taken:
            stamps, values = taken["field"]
            self._field = joined([self._field, Samples(stamps, magnetic_field=values)])
        if whole is not None and len(whole):
            self._whole.append(whole)
        return self._with_field(joined(self._whole), last=last) if self._whole else None

    def _with_field(self, whole: Samples, *, last: bool) -> Samples | None:
        """The samples whose magnetometer's are known by now, each at the next stamp."""
        assert self._chosen is not None
        if "field" not in self._chosen:
            self._whole.clear()
            return Samples(whole.time, whole.specific_force, whole.angular_rate)
        stamps, values = self._field.time, self._field.magnetic_field
        assert values is not None
        until = max([*stamps[-1:].tolist(), float(whole.time[-1]) - FIELD_WAITS])
        stop = len(whole) if last else int(np.searchsorted(whole.time, until, side="right"))
        whole, rest = whole.cut(slice(0, stop)), whole.cut(slice(stop, None))
        self._whole = [rest] if len(rest) else []
        if not stop:
            return None
        ready = int(np.count_nonzero(stamps <= whole.time[-1]))
        placed = np.full((stop, 3), np.nan)
        placed[np.searchsorted(whole.time, stamps[:ready])] = values[:ready]
        self._field = self._field.cut(slice(ready, None))
        return Samples(whole.time, whole.specific_force, whole.angular_rate, magnetic_field=placed)


# What an app calls the list of its samples (empty: a line is one sample), and of a sample the name of the sensor, the
# stamp in ns and the three values: Sensor Logger, SensorServer. The sensors' own names are those of `rank_sensor`.
_APPS = (("payload", "name", "time", "values"), ("", "type", "timestamp", "values"))


def is_of_sensors(head: bytes) -> bool:
    """Say whether lines of JSON hold samples of single sensors, as phones' apps send them.

    Parameters
    ----------
    head : what came first.
    """
    needed = [app[:1] if app[0] else app[1:] for app in _APPS]
    return any(all(f'"{name}"'.encode() in head for name in names) for names in needed)


class SensorLines:
    """A decoder of lines of JSON, each of which holds samples of single sensors.

    Parameters
    ----------
    options, name : as for every decoder.
    """

    def __init__(self, options: SourceOptions, name: str) -> None:
        self.good = self.damaged = 0
        self._sensors = ApartSensors(options, name)
        self._origin: int | None = None
        self._rest = b""

    def feed(self, data: bytes, arrived: float) -> list[Piece]:
        """Return what is complete."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > LONGEST_LINE:
            self._rest = b""
            self.damaged += 1
        for line in filter(None, map(bytes.strip, lines)):
            try:
                self._take(json.loads(line))
                self.good += 1
            except (ValueError, TypeError, LookupError, AttributeError, OverflowError, RecursionError):
                self.damaged += 1
        return self._sensors.pieces()

    def _take(self, said: dict[str, Any]) -> None:
        samples, sensor, stamp, values = next((app for app in _APPS if (app[0] or app[2]) in said), ("",) * 4)
        for one in said[samples] if samples else [said]:
            named = one[sensor].removeprefix("android.sensor.").replace("magnetic_field", "magnetometer")
            known = rank_sensor(named)
            if known is None:
                continue
            time = int(one[stamp])
            found: dict[str, Any] | list[Any] = one[values]
            self._origin = time if self._origin is None else self._origin
            x, y, z = [found[axis] for axis in "xyz"] if isinstance(found, dict) else found[:3]
            self._sensors.add(*known, (time - self._origin) / 1e9, (float(x), float(y), float(z)))

    def end(self) -> list[Piece]:
        """Return what is left."""
        return self.feed(b"\n", 0.0) + self._sensors.pieces(last=True)
