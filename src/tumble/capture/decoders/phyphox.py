"""phyphox, an app for phones: answers of its remote access, a JSON document a line.

References
----------
phyphox wiki, *Remote-interface communication*: `/config` with the experiment's inputs, `/get` with its buffers.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tumble.capture.apart import ApartSensors, SensorLines
from tumble.capture.link import Format
from tumble.capture.source import SourceOptions

_KINDS = {"accelerometer": "force", "gyroscope": "rate", "magnetic_field": "field"}
USUAL: dict[str, tuple[str, str, str, str]] = {
    "force": ("acc_time", "accX", "accY", "accZ"),
    "rate": ("gyr_time", "gyrX", "gyrY", "gyrZ"),
    "field": ("mag_time", "magX", "magY", "magZ"),
}
"""The buffers of time, x, y and z of each kind of sensor in phyphox's own experiments."""


def buffers_of(config: Mapping[str, Any]) -> dict[str, tuple[str, str, str, str]]:
    """Return the buffers of time, x, y and z by kind of sensor, as an experiment's configuration names them.

    Parameters
    ----------
    config : what ``/config`` answers.

    Raises
    ------
    TypeError, LookupError, AttributeError, ValueError
        If it is none.
    """
    found: dict[str, tuple[str, str, str, str]] = {}
    for source in config["inputs"]:
        kind = _KINDS.get(source["source"])
        outputs: dict[str, str] = {}
        for one in source["outputs"]:
            outputs.update(one)
        if kind is not None and all(name in outputs for name in "txyz"):
            found[kind] = (outputs["t"], outputs["x"], outputs["y"], outputs["z"])
    return found


def _decoder(options: SourceOptions, name: str) -> SensorLines:
    buffers = dict(USUAL)

    def take(said: dict[str, Any], sensors: ApartSensors) -> bool:
        if "inputs" in said:
            named = buffers_of(said)
            buffers.clear()
            buffers.update(named)
            return True
        there = said["buffer"]
        for kind, names in buffers.items():
            if not all(one in there for one in names):
                continue
            # The axes of a sensor that is just being read may have unlike lengths.
            columns = [there[one]["buffer"] for one in names]
            for time, x, y, z in zip(*columns, strict=False):
                if None not in (time, x, y, z):
                    sensors.add(kind, 0, float(time), (float(x), float(y), float(z)))
        return True

    return SensorLines(ApartSensors(options, name), take)


FORMAT = Format("phyphox", "JSON of the app phyphox", lambda head: b'"updateMode"' in head, _decoder)
