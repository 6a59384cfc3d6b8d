"""Sensors that Linux itself drives (Industrial I/O): read from their files under /sys.

References
----------
Linux kernel, *ABI/testing/sysfs-bus-iio*: (raw + offset) · scale is m/s², rad/s, gauss, and of a temperature m°C.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

from tumble.capture.link import Link, pieces_of_link
from tumble.capture.source import Piece, Source, SourceOptions
from tumble.errors import UsageError

ROOT = Path("/sys/bus/iio/devices")
# Hz at most: each number is a file that is read.
FASTEST = 200.0
_KINDS = {"accel": ("a", "m/s^2"), "anglvel": ("g", "rad/s"), "magn": ("m", "gauss")}


class _Channel:
    """A number of a device: its file, and how it becomes SI."""

    def __init__(self, device: Path, kind: str, axis: str) -> None:
        stem = f"in_{kind}_{axis}" if axis else f"in_{kind}"
        self._raw = device / f"{stem}_raw"
        # What holds for all axes stands once.
        self._scale, self._offset = (
            _number(device / f"{stem}_{what}", _number(device / f"in_{kind}_{what}", usual))
            for what, usual in (("scale", 1.0), ("offset", 0.0))
        )

    @property
    def there(self) -> bool:
        """Whether the device has it."""
        return self._raw.is_file()

    def read(self) -> float:
        """Return it in SI."""
        try:
            return (float(self._raw.read_text()) + self._offset) * self._scale
        except ValueError as error:
            raise OSError(f"{self._raw} holds no number") from error


def _number(file: Path, usual: float) -> float:
    try:
        return float(file.read_text())
    except (OSError, ValueError):
        return usual


class _Sensors:
    """The channels of one device or several, read one after another as lines of text."""

    def __init__(self, devices: list[Path], rate: float | None) -> None:
        self._columns: list[tuple[str, _Channel]] = []
        for device in devices:
            for kind, (letter, unit) in _KINDS.items():
                found = [(f"{letter}{axis} [{unit}]", _Channel(device, kind, axis)) for axis in "xyz"]
                if all(channel.there for _, channel in found) and not self._has(letter):
                    self._columns += found
        names = " ".join(device.name for device in devices)
        if not self._has("a") and not self._has("g"):
            raise UsageError(
                f"{names} has neither accelerometer nor gyro (in_accel_x_raw, in_anglvel_x_raw)."
            )
        temperature = next((c for d in devices if (c := _Channel(d, "temp", "")).there), None)
        self._temperature = temperature
        said = [_number(d / f, 0.0) for d in devices for f in _FREQUENCIES if (d / f).is_file()]
        self._step = 1.0 / (rate or min([FASTEST, *(one for one in said if one > 0.0)]))
        self._head = ",".join(["t [s]", *(name for name, _ in self._columns)])
        self._head += "\n" if temperature is None else ",temperature\n"
        self._next = time.monotonic()

    def _has(self, letter: str) -> bool:
        return any(name.startswith(letter) for name, _ in self._columns)

    def read(self, seconds: float) -> bytes:
        """Return the lines of some time."""
        end = time.monotonic() + seconds
        lines, self._head = [self._head], ""
        while self._next < end:
            time.sleep(max(0.0, self._next - time.monotonic()))
            begun = time.monotonic()
            values = [channel.read() for _, channel in self._columns]
            stamp = 0.5 * (begun + time.monotonic())
            if self._temperature is not None:
                values.append(1e-3 * self._temperature.read())
            lines.append(",".join(map(repr, [stamp, *values])) + "\n")
            # What is late is not made good by reading twice at once; a device that is slow is read as fast as it goes.
            due = self._next + self._step
            self._next = due if due > begun else begun + self._step
        return "".join(lines).encode()

    def close(self) -> None:
        """Nothing is kept open."""


_FREQUENCIES = (
    "in_accel_sampling_frequency", "in_anglvel_sampling_frequency", "sampling_frequency",
)  # fmt: skip


def found_devices(root: Path = ROOT) -> list[tuple[str, str]]:
    """Return the devices that have an accelerometer or a gyro, each with its name.

    Parameters
    ----------
    root : folder of the devices.
    """
    found: list[tuple[str, str]] = []
    for device in sorted(root.glob("iio:device*")):
        kinds = [kind for kind in ("accel", "anglvel") if (device / f"in_{kind}_x_raw").is_file()]
        if kinds:
            name = (device / "name").read_text().strip() if (device / "name").is_file() else "a sensor"
            found.append((f"iio:{device.name.removeprefix('iio:')}", f"{name} ({', '.join(kinds)})"))
    return found


def _read_iio(address: str, options: SourceOptions) -> Iterator[Piece]:
    """Yield what Linux reads of a sensor."""
    devices = [Path(one) if "/" in one else ROOT / f"iio:{one}" for one in address.split("+")]
    missing = [device for device in devices if not device.is_dir()]
    if missing:
        there = ", ".join(name for name, _ in found_devices()) or "none is there"
        raise UsageError(f"There is no IIO device {missing[0].name or address}; {there}.")

    def connect() -> Link:
        return _Sensors(devices, options.rate)

    return pieces_of_link(connect, address, options, "text")


SOURCE = Source("iio", "a sensor that Linux drives (IIO)", "iio:device0", _read_iio, found=found_devices)
