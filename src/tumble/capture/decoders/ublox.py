"""u-blox receivers with sensors of their own: ESF-MEAS and ESF-RAW in UBX frames.

References
----------
u-blox, *Interface description*: UBX frames with their checksum (RFC 1145), ESF-MEAS (10 02) and ESF-RAW (10 03): a
measurement is 24 bits with its sign, and a type: gyros in 2⁻¹² °/s, accelerometers in 2⁻¹⁰ m/s², temperature in
0.01 °C. The unit of the time tags is not stated there, so samples are stamped as they arrive.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator

from tumble.capture.frames import Frame, Frames, Measured
from tumble.capture.link import Format
from tumble.capture.source import Piece, SourceOptions

SYNC = b"\xb5\x62"
_MEAS, _RAW = b"\x10\x02", b"\x10\x03"
_RATES, _FORCES, _TEMPERATURE = {14: 0, 13: 1, 5: 2}, {16: 0, 17: 1, 18: 2}, 12
_RATE_UNIT, _FORCE_UNIT = 2.0**-12, 2.0**-10
_LONGEST = 4096


class Ublox:
    """Bytes in, samples out.

    Parameters
    ----------
    options, name : as for every decoder; with the rate where it is known.
    """

    def __init__(self, options: SourceOptions, name: str) -> None:
        self.good = self.damaged = 0
        self._measured: list[Measured] = []
        self._frames = Frames(options, self._take, ("m/s^2", "deg/s", "counts"))
        self._rate: dict[int, float] = {}
        self._force: dict[int, float] = {}
        self._temperature: float | None = None

    def feed(self, data: bytes, arrived: float) -> list[Piece]:
        """Return what is complete."""
        pieces = self._frames.feed(data, arrived)
        self.good, self.damaged = self._frames.good, self._frames.damaged
        found, self._measured = self._measured, []
        return pieces + self._frames.measured(found, arrived)

    def end(self) -> list[Piece]:
        """Return what is left."""
        return self._frames.end()

    def _take(self, data: bytes) -> Frame:
        start = data.find(SYNC)
        if start:
            used = start if start > 0 else len(data) - data.endswith(SYNC[:1])
            return used, None, False
        if len(data) < 8:
            return 0, None, True
        length = int.from_bytes(data[4:6], "little")
        if length > _LONGEST:
            return 1, None, False
        if len(data) < length + 8:
            return 0, None, True
        body = data[2 : 6 + length]
        if _checksum(body) != data[6 + length : 8 + length]:
            return 1, None, False
        for kind, value in _measurements(body[:2], body[4:]):
            self._put(kind, value)
        return length + 8, None, True

    def _put(self, kind: int, value: int) -> None:
        """Take one measurement; a sample is complete when all six axes have one."""
        if kind in _RATES:
            self._rate[_RATES[kind]] = value * _RATE_UNIT
        elif kind in _FORCES:
            self._force[_FORCES[kind]] = value * _FORCE_UNIT
        elif kind == _TEMPERATURE:
            self._temperature = 0.01 * value
        if len(self._rate) == len(self._force) == 3:
            triads = [tuple(triad[axis] for axis in range(3)) for triad in (self._force, self._rate)]
            self._measured.append(Measured(triads[0], triads[1], temperature=self._temperature))
            self._rate, self._force = {}, {}


def _checksum(body: bytes) -> bytes:
    first = second = 0
    for one in body:
        first = (first + one) & 0xFF
        second = (second + first) & 0xFF
    return bytes((first, second))


def _measurements(kind: bytes, body: bytes) -> Iterator[tuple[int, int]]:
    """Yield the type and the value of each measurement."""
    if kind == _MEAS and len(body) >= 8:
        flags = int.from_bytes(body[4:6], "little")
        words = [body[8 + 4 * k : 12 + 4 * k] for k in range(flags >> 11)]
    elif kind == _RAW:
        words = [body[at : at + 4] for at in range(4, len(body) - 7, 8)]
    else:
        return
    for word in words:
        if len(word) == 4:
            (number,) = struct.unpack("<i", word)
            code = (number >> 24) & (0x3F if kind == _MEAS else 0xFF)
            value = number & 0xFFFFFF
            yield code, value - (1 << 24) if value & 0x800000 else value


def _recognises(head: bytes) -> bool:
    return SYNC + _MEAS in head or SYNC + _RAW in head


FORMAT = Format("ublox", "u-blox ESF-MEAS and ESF-RAW", _recognises, Ublox)
