"""A serial port: an Arduino, a Teensy, an ESP."""

from __future__ import annotations

import os
from functools import partial
from typing import Any

from tumble.capture.link import Line, source_of_lines
from tumble.errors import UsageError, install

BAUD = 115_200


class _Port:
    """An open serial port; pyserial's errors are the system's."""

    def __init__(self, device: str, baud: int) -> None:
        serial = _library()
        try:
            self._port: Any = serial.Serial(device, baud, timeout=0.1, exclusive=True)
        except (serial.SerialException, ValueError, OSError) as error:
            words = _refusal(device, error)
            raise UsageError(f"{device} cannot be opened: {words}") from error
        self._lost: type[Exception] = serial.SerialException

    def read(self, seconds: float) -> bytes:
        """Return what came."""
        try:
            self._port.timeout = seconds
            first = self._port.read(1)
            return first + self._port.read(self._port.in_waiting or 0) if first else b""
        except (self._lost, TypeError) as error:
            raise OSError(str(error)) from error

    def close(self) -> None:
        """Let go of the port."""
        self._port.close()


def _library() -> Any:
    try:
        import serial
    except ImportError:
        raise UsageError(
            f"A serial port needs pyserial: {install('serial')}, or pipe the port's lines into "
            "`tumble capture -`."
        ) from None
    return serial


def _refusal(device: str, error: Exception) -> str:
    if "exclusive" in str(error).lower() or getattr(error, "errno", None) in (11, 16):
        return "another program has it; end that one, such as a serial monitor."
    if getattr(error, "errno", None) == 13:
        return "you may not read it; on Linux join the group dialout (sudo usermod -aG dialout $USER) and log in again."
    there = [name for name, _ in found_ports()]
    listed = (
        f"there is {', '.join(name.removeprefix('serial:') for name in there)}"
        if there
        else "no port is connected"
    )
    return f"{os.strerror(error.errno) if isinstance(error, OSError) and error.errno else error}; {listed}."


def found_ports() -> list[tuple[str, str]]:
    """Return the serial ports that are connected, each with what it calls itself; empty without pyserial."""
    try:
        from serial.tools import list_ports
    except ImportError:
        return []
    return [
        (f"serial:{port.device}", str(port.description))
        for port in list_ports.comports()
        if port.hwid != "n/a"
    ]


def _port(address: str) -> Line:
    device, _, baud = address.partition("@")
    if not device:
        there = ", ".join(name for name, _ in found_ports()) or "none is connected"
        raise UsageError(f"Name the port, as serial:/dev/ttyACM0; {there}.")
    if baud and not (baud.isdigit() and 0 < int(baud) <= 20_000_000):
        raise UsageError(f"{baud} is no baud rate: give one as serial:{device}@921600.")

    return partial(_Port, device, int(baud or BAUD)), device


SOURCE = source_of_lines(
    "serial",
    "a serial port (USB), @BAUD behind it if not 115200",
    "serial:/dev/ttyACM0",
    _port,
)
