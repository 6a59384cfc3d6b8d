"""SensorServer, an app for Android: a JSON object for each sample of a sensor.

References
----------
SensorServer, README: `type`, `timestamp` in ns of Android's elapsed clock, `values`; Android developer guide, *Motion
sensors*: of an uncalibrated sensor the first three values are what it measured, the others the bias that was found.
"""

from __future__ import annotations

from typing import Any

from tumble.capture.apart import ApartSensors, SensorLines, three
from tumble.capture.link import Format
from tumble.capture.source import SourceOptions

UNCALIBRATED = (
    "android.sensor.accelerometer_uncalibrated",
    "android.sensor.gyroscope_uncalibrated",
    "android.sensor.magnetic_field_uncalibrated",
)
CORRECTED = ("android.sensor.accelerometer", "android.sensor.gyroscope", "android.sensor.magnetic_field")
_KINDS = {
    name: (kind, rank)
    for rank, names in enumerate((UNCALIBRATED, CORRECTED))
    for kind, name in zip(("force", "rate", "field"), names, strict=True)
}


def _decoder(options: SourceOptions, name: str) -> SensorLines:
    origin: list[int] = []

    def take(said: dict[str, Any], sensors: ApartSensors) -> bool:
        known = _KINDS.get(said["type"])
        if known is None:
            return False
        stamp = int(said["timestamp"])
        origin.extend([] if origin else [stamp])
        sensors.add(*known, (stamp - origin[0]) / 1e9, three(said["values"]))
        return True

    return SensorLines(ApartSensors(options, name), take)


FORMAT = Format(
    "sensorserver", "JSON of the app SensorServer", lambda head: b'"android.sensor.' in head, _decoder
)
