"""VectorNav: ``$VNIMU`` lines, and binary messages with the common, time and IMU groups.

References
----------
VectorNav, *VN-100 Interface Control Document*: asynchronous ASCII messages (8-bit XOR or 16-bit CRC), user-configurable
binary output (sync FA, groups, fields, CRC-16 of the CCITT polynomial over all bytes after the sync).
"""

from __future__ import annotations

import math
import struct
from binascii import crc_hqx

from tumble.capture.frames import Frame, Frames, Measured
from tumble.capture.link import Format
from tumble.capture.source import SourceOptions

SYNC = 0xFA
# Bytes of each field by group, in the order of their bits.
_SIZES = (
    (8, 8, 8, 12, 16, 12, 24, 12, 12, 24, 20, 28, 2, 4, 8),
    (8, 8, 8, 2, 8, 8, 8, 4, 4, 1),
    (2, 12, 12, 12, 4, 4, 16, 12, 12, 12, 12, 2, 40),
    (8, 8, 2, 1, 1, 24, 24, 12, 12, 12, 4, 4, 32),
    (2, 12, 16, 36, 12, 12, 12, 12, 12, 12, 28, 24),
    (2, 24, 24, 36, 12, 12, 12, 12, 12, 12, 4, 4),
)
_COMMON, _TIME, _IMU = 0, 1, 2
_CORRECTED = (
    "These are rates and forces that the unit's own filter has corrected: send VNIMU, or the uncompensated fields "
    "of the IMU group."
)
_LINES = {b"$VNIMU": (0, 3, 6, 9), b"$VNYMR": (3, 6, 9, None)}  # where magnetometer, force, rate and °C begin


class VectorNav:
    """Says what a message measures."""

    def __init__(self) -> None:
        self.cautions: list[str] = []
        self._warned = False

    def take(self, data: bytes) -> Frame:
        """Look for a message at the start of some bytes.

        Parameters
        ----------
        data : as they came.
        """
        if data[0] == SYNC:
            return self._binary(data)
        if data[:1] == b"$":
            end = data.find(b"\n")
            if end < 0:
                return (0, None, True) if len(data) < 256 else (1, None, False)
            return end + 1, *self._line(data[:end].strip())
        starts = [at for at in (data.find(b"$"), data.find(SYNC)) if at > 0]
        # Line ends between messages are no garbage.
        skipped = data[: min(starts)] if starts else data
        return len(skipped), None, not skipped.strip(b"\r\n")

    def _line(self, line: bytes) -> tuple[Measured | None, bool]:
        body, star, check = line.partition(b"*")
        try:
            stated = int(check, 16) if star and check != b"XX" else None
        except ValueError:
            return None, False
        if stated is not None and stated != (_xor(body[1:]) if len(check) == 2 else crc_hqx(body[1:], 0)):
            return None, False
        name, *cells = body.split(b",")
        if name not in _LINES or stated is None:
            return None, stated is not None
        field, force, rate, warm = _LINES[name]
        try:
            values = tuple(map(float, cells))
        except ValueError:
            return None, False
        if len(values) < rate + 3 or not all(map(math.isfinite, values)):
            return None, False
        if name == b"$VNYMR":
            self._warn()
        temperature = values[warm] if warm is not None and len(values) > warm else None
        seen = values[field : field + 3]
        return Measured(values[force : force + 3], values[rate : rate + 3], None, temperature, seen), True

    def _binary(self, data: bytes) -> Frame:
        groups = [k for k in range(6) if len(data) > 1 and data[1] >> k & 1]
        head = 2 + 2 * len(groups)
        if len(data) < max(head, 3):
            return 0, None, True
        if not groups or data[1] & 0xC0:
            return 1, None, False
        fields = struct.unpack(f"<{len(groups)}H", data[2:head])
        at, places = head, dict[tuple[int, int], int]()
        for group, bits in zip(groups, fields, strict=True):
            if bits >> len(_SIZES[group]):
                return 1, None, False
            for field, size in enumerate(_SIZES[group]):
                if bits >> field & 1:
                    places[group, field] = at
                    at += size
        if len(data) < at + 2:
            return 0, None, True
        if crc_hqx(data[1 : at + 2], 0):
            return 1, None, False
        return at + 2, self._of_fields(data, places), True

    def _of_fields(self, data: bytes, places: dict[tuple[int, int], int]) -> Measured | None:
        def three(*fields: tuple[int, int, int]) -> tuple[float, ...] | None:
            found = next(((f, places[f[:2]]) for f in fields if f[:2] in places), None)
            return None if found is None else struct.unpack_from("<3f", data, found[1] + found[0][2])

        # What the filter has not touched comes first: uncompensated fields, and the common group's IMU field.
        force = three((_IMU, 2, 0), (_COMMON, 9, 0), (_IMU, 9, 0), (_COMMON, 8, 0))
        rate = three((_IMU, 3, 0), (_COMMON, 9, 12), (_IMU, 10, 0), (_COMMON, 5, 0))
        if force is None and rate is None:
            return None
        if not {(_IMU, 2), (_IMU, 3), (_COMMON, 9)} & set(places):
            self._warn()
        clock = next((places[f] for f in ((_COMMON, 0), (_TIME, 0)) if f in places), None)
        time = None if clock is None else struct.unpack_from("<Q", data, clock)[0] * 1e-9
        warm = places.get((_IMU, 4))
        celsius = None if warm is None else struct.unpack_from("<f", data, warm)[0]
        field = three((_IMU, 1, 0), (_COMMON, 10, 0), (_IMU, 8, 0))
        return Measured(force, rate, time, celsius, field)

    def _warn(self) -> None:
        if not self._warned:
            self._warned = True
            self.cautions.append(_CORRECTED)


def _xor(content: bytes) -> int:
    total = 0
    for one in content:
        total ^= one
    return total


def _recognises(head: bytes) -> bool:
    if b"$VN" in head:
        return True
    return any(VectorNav().take(head[at:])[1] is not None for at in range(len(head)) if head[at] == SYNC)


def _decoder(options: SourceOptions, name: str) -> Frames:
    unit = VectorNav()
    frames = Frames(options, unit.take)
    frames.cautions = unit.cautions
    return frames


FORMAT = Format("vectornav", "VectorNav $VNIMU or binary", _recognises, _decoder)
