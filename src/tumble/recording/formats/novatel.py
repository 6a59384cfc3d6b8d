"""NovAtel ASCII logs: the raw increments of an IMU in counts, each line with its checksum.

References
----------
NovAtel, *OEM7 Commands and Logs Reference Manual*: RAWIMU, RAWIMUS, RAWIMUX, RAWIMUSX; 32-bit CRC.
"""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import field
from pathlib import Path

import numpy as np

from tumble.errors import RecordingError
from tumble.files import opened
from tumble.recording.formats.table import RawTable, hash_file
from tumble.recording.recording import Remark, Source
from tumble.records import dataclass

NAME = "NovAtel ASCII"
ENDINGS = (".asc", ".gps", ".txt", ".log")
SUMMARY = "NovAtel ASCII: RAWIMUA, RAWIMUSA, RAWIMUXA, RAWIMUSXA, in counts"

# Fields before the week: those with X begin with the IMU's condition and type.
_SKIPPED = {b"RAWIMUA": 0, b"RAWIMUSA": 0, b"RAWIMUXA": 2, b"RAWIMUSXA": 2}
_WEEK = 604_800.0  # s
_BLOCK = 500_000


def recognises(head: bytes) -> bool:
    """Say whether a file that begins so holds NovAtel's ASCII logs."""
    lines = [line for line in head.split(b"\n") if line.strip()]
    return b"\0" not in head and bool(lines) and any(_message(line) is not None for line in lines[:20])


def _message(line: bytes) -> bytes | None:
    """Return the name of a line's message, or None if the line is none."""
    if line[:1] not in (b"%", b"#"):
        return None
    name = line[1 : line.find(b",")]
    is_log = 3 < len(name) < 32 and name.endswith(b"A") and name.isalnum() and name.isupper()
    return name if is_log and (b";" in line or len(line) > 200) else None


def read_table(path: Path) -> RawTable:
    """Read a log whole.

    Raises
    ------
    RecordingError
        If the file holds no raw IMU message that is whole.
    OSError
        If the file cannot be read.
    """
    blocks = list(_blocks(path))
    names, columns = _columns(np.concatenate([b.rows for b in blocks]))
    return RawTable(path, names, columns, hash_file(path), [*blocks[0].found, *blocks[-1].mended()])


def read_table_blocks(path: Path) -> Iterator[RawTable]:
    """Read a log in blocks of half a million rows (without SHA-256).

    Raises
    ------
    RecordingError
        If the file holds no raw IMU message that is whole.
    OSError
        If the file cannot be read.
    """
    for number, block in enumerate(_blocks(path)):
        names, columns = _columns(block.rows)
        remarks = ([] if number else block.found) + (block.mended() if block.last else [])
        yield RawTable(path, names, columns, Source(path.name, ""), remarks)


@dataclass(slots=True)
class _Block:
    rows: np.ndarray
    name: str
    last: bool
    wrong: int
    found: list[Remark] = field(default_factory=list[Remark])

    def mended(self) -> list[Remark]:
        """Say how many lines were left out, up to this block."""
        if not self.wrong:
            return []
        return [
            Remark(
                "mended",
                f"{self.name}: {self.wrong} line(s) cut short or with a wrong checksum are left out.",
            )
        ]


def _blocks(path: Path) -> Iterator[_Block]:
    """Yield the lines of the IMU's messages as numbers."""
    seen: Counter[bytes] = Counter()
    rows: list[list[float]] = []
    wrong, given = 0, 0
    with opened(path) as file:
        for line in file:
            name = _message(line)
            if name is None:
                continue
            seen[name] += 1
            if name in _SKIPPED:
                row = _row(line, _SKIPPED[name])
                if row is None:
                    wrong += 1
                    continue
                rows.append(row)
                if len(rows) > _BLOCK:  # the last row stays, so that there is one for the last block
                    yield _Block(np.array(rows[:-1]), path.name, False, wrong, _found(path))
                    given, rows = given + len(rows) - 1, rows[-1:]
    if not rows:
        said = f"; {wrong} are cut short or have a wrong checksum" if wrong else ""
        listed = ", ".join(f"{n.decode()} ({c})" for n, c in seen.most_common(8))
        raise RecordingError(
            f"{path.name} holds no RAWIMUA, RAWIMUSA, RAWIMUXA or RAWIMUSXA that is whole{said}; it holds {listed}. "
            "Log RAWIMUSXA ONNEW: solutions such as INSPVAA are no recording of an IMU."
        )
    yield _Block(np.array(rows), path.name, True, wrong, _found(path))


def _found(path: Path) -> list[Remark]:
    text = (
        "the increments of velocity and angle are in the IMU's counts; the log has -y, which is turned round"
    )
    return [Remark("found", f"{path.name}: {text}.")]


def _row(line: bytes, skipped: int) -> list[float] | None:
    """Return time and the six counts of a line in the order z, -y, x; None if it is not whole."""
    body, star, checksum = line.strip().rpartition(b"*")
    try:
        if not star or _crc(body[1:]) != int(checksum, 16):
            return None
        fields = body.partition(b";")[2].split(b",")[skipped:]
        week, seconds = float(fields[0]), float(fields[1])
        return [week * _WEEK + seconds, *map(float, fields[3:9])] if len(fields) == 9 else None
    except (ValueError, IndexError):
        return None


def _crc(data: bytes) -> int:
    """NovAtel's CRC has the polynomial of zlib's, begins with 0 and is not inverted at the end."""
    return zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF


def _columns(rows: np.ndarray) -> tuple[tuple[str, ...], list[np.ndarray]]:
    time, az, ay, ax, gz, gy, gx = rows.T
    names = ("t [s]", *(f"{kind}{axis} [counts]" for kind in "ag" for axis in "xyz"))
    return names, [time, ax, -ay, az, gx, -gy, gz]
