"""Sensor Logger, an app for phones: what it pushes, a JSON document with samples of all sensors, a document a line.

References
----------
Sensor Logger, *Awesome Sensor Logger*: `payload`, a list of `name`, `time` in ns since 1970 and `values`; its *One-Page
Unit Reference*: an iPhone's uncalibrated accelerometer is in g, unless units are standardised.
"""

from __future__ import annotations

from typing import Any

from tumble.capture.apart import ApartSensors, SensorLines, three
from tumble.capture.link import Format
from tumble.capture.source import SourceOptions
from tumble.recording.formats.logs.phone import rank_sensor


def _decoder(options: SourceOptions, name: str) -> SensorLines:
    origin: list[int] = []

    def take(said: dict[str, Any], sensors: ApartSensors) -> bool:
        for one in said["payload"]:
            known = rank_sensor(one["name"])
            if known is None:
                continue
            stamp = int(one["time"])
            origin.extend([] if origin else [stamp])
            values = one["values"]
            sensors.add(*known, (stamp - origin[0]) / 1e9, three([values[axis] for axis in "xyz"]))
        return True

    return SensorLines(ApartSensors(options, name, force_unit=""), take)


FORMAT = Format(
    "sensorlogger", "JSON of the app Sensor Logger", lambda head: b'"payload"' in head[:4096], _decoder
)
