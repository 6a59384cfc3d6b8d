"""Xsens' XBus: MTData2 messages, as MTi units send them in measurement mode.

References
----------
Xsens, *MT Low-Level Communication Protocol*: message structure (preamble FA, bus FF, checksum: all bytes after the
preamble sum to zero), MTData2 (36), data identifiers and their formats.
"""

from __future__ import annotations

import struct

from tumble.capture.frames import Frame, Frames, Measured
from tumble.capture.link import Format
from tumble.capture.source import SourceOptions
from tumble.units import COUNTS

PREAMBLE, MTDATA2 = b"\xfa\xff", 0x36
_TEMPERATURE, _FINE_TIME, _ACCELERATION, _ACCELERATION_HR = 0x0810, 0x1060, 0x4020, 0x4040
_RATE_OF_TURN, _RATE_OF_TURN_HR, _MAGNETIC_FIELD = 0x8020, 0x8040, 0xC020
# SampleTimeFine counts 10 kHz in 32 bits, and begins again after five days.
_TICK, _WRAP = 1e-4, 2.0**32


class XBus:
    """Says what a message measures, with its clock carried on over its wrap."""

    def __init__(self) -> None:
        self._last, self._added = 0.0, 0.0

    def take(self, data: bytes) -> Frame:
        """Look for a message at the start of some bytes.

        Parameters
        ----------
        data : as they came.
        """
        start = data.find(PREAMBLE)
        if start:
            # The last byte may be the first of a preamble.
            return (
                (start, None, False) if start > 0 else (len(data) - data.endswith(PREAMBLE[:1]), None, False)
            )
        if len(data) < 5:
            return 0, None, True
        extended = data[3] == 0xFF
        if extended and len(data) < 7:
            return 0, None, True
        length = int.from_bytes(data[4:6], "big") if extended else data[3]
        body = 6 if extended else 4
        if length > 2048:
            return 1, None, False
        if len(data) < body + length + 1:
            return 0, None, True
        whole = data[: body + length + 1]
        if sum(whole[1:]) & 0xFF:
            return 1, None, False
        measured = self._measured(whole[body:-1]) if data[2] == MTDATA2 else None
        return len(whole), measured, True

    def _measured(self, body: bytes) -> Measured | None:
        found = Measured()
        at = 0
        while at + 3 <= len(body):
            identifier, size = int.from_bytes(body[at : at + 2], "big"), body[at + 2]
            content = body[at + 3 : at + 3 + size]
            at += 3 + size
            kind, form = identifier & 0xFFF0, identifier & 0x3
            if kind == _FINE_TIME and size == 4:
                found.time = self._carried(float(int.from_bytes(content, "big")))
            elif kind in (_ACCELERATION, _ACCELERATION_HR):
                found.force = _three(content, form)
            elif kind in (_RATE_OF_TURN, _RATE_OF_TURN_HR):
                found.rate = _three(content, form)
            elif kind == _MAGNETIC_FIELD:
                found.field = _three(content, form)
            elif kind == _TEMPERATURE and form == 0 and size == 4:
                found.temperature = float(struct.unpack(">f", content)[0])
        return found if found.force is not None or found.rate is not None else None

    def _carried(self, ticks: float) -> float:
        if ticks < self._last - 0.5 * _WRAP:
            self._added += _WRAP
        self._last = ticks
        return (ticks + self._added) * _TICK


def _three(content: bytes, form: int) -> tuple[float, ...] | None:
    """Three numbers: single, fixed-point 12.20, fixed-point 16.32, double."""
    if form == 0 and len(content) == 12:
        return struct.unpack(">3f", content)
    if form == 1 and len(content) == 12:
        return tuple(value / 2.0**20 for value in struct.unpack(">3i", content))
    if form == 2 and len(content) == 18:
        # The fraction, 32 bits, comes before the whole part, 16 bits.
        parts = [struct.unpack(">Ih", content[k : k + 6]) for k in (0, 6, 12)]
        return tuple(whole + fraction / 2.0**32 for fraction, whole in parts)
    if form == 3 and len(content) == 24:
        return struct.unpack(">3d", content)
    return None


def _decoder(options: SourceOptions, name: str) -> Frames:
    # The field is in units of that at the place of Xsens' own calibration.
    return Frames(options, XBus().take, ("m/s^2", "rad/s", COUNTS))


FORMAT = Format("xbus", "Xsens MTData2", lambda head: PREAMBLE + bytes([MTDATA2]) in head, _decoder)
