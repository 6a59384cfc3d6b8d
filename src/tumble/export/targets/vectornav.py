"""VectorNav: registers 25 (accelerometers) and 84 (gyros), as commands with checksums.

Read in the VN-100 manual UM001: ``x = C (u - B)``, C by rows, applied after the factory's own calibration;
the checksum is the XOR of the bytes between $ and *.
"""

from __future__ import annotations

import re
from functools import reduce
from pathlib import Path

from tumble.errors import CalibrationFileError
from tumble.export.reading import invertible, text_of, vector_of
from tumble.export.subject import Subject
from tumble.export.target import BIAS, MATRIX, SCALE, Imported, Target
from tumble.export.words import commented, head
from tumble.sensor import ImuModel, Triad
from tumble.sensor.gauge import inverse

_HOLDS = frozenset({MATRIX, SCALE, BIAS})


def write(subject: Subject) -> dict[str, str]:
    """Return the commands that write registers 25 (accelerometers) and 84 (gyros), with checksums."""
    formula = (
        "x = C (u - B), after the factory's own calibration: record with these registers at their defaults",
        "register 25: accelerometers, m/s^2; register 84: gyros, rad/s; C by rows, then B",
    )
    lines: list[str] = []
    for register, triad in ((25, subject.accelerometer), (84, subject.gyroscope)):
        numbers = [*inverse(triad.matrix).ravel(), *triad.bias]
        body = f"VNWRG,{register}," + ",".join(f"{v + 0.0:.9g}" for v in numbers)
        lines.append(f"${body}*{checksum(body):02X}")
    return {"vectornav.txt": commented(head(subject, TARGET.title, formula)) + "\n".join(lines) + "\n"}


def checksum(body: str) -> int:
    """Return the XOR of the bytes between $ and *."""
    return reduce(lambda total, byte: total ^ byte, body.encode("utf-8"), 0)


def read(path: Path) -> Imported:
    """Read ``$VNWRG`` or ``$VNRRG`` lines of registers 25 and 84.

    Raises
    ------
    CalibrationFileError
        If a checksum is wrong, or there is no such line.
    """
    triads: dict[str, Triad] = {}
    for line_number, line in enumerate(text_of(path).splitlines(), 1):
        match = re.fullmatch(r"\$(VN[WR]RG,(25|84),([^*]*))\*([0-9A-Fa-fX]{2,4})", line.strip())
        if match is None:
            continue
        if len(match[4]) == 2 and match[4] != "XX" and int(match[4], 16) != checksum(match[1]):
            raise CalibrationFileError(f"{path}, line {line_number}: the checksum {match[4]} is wrong.")
        numbers = vector_of(match[3].split(","), f"register {match[2]}", path, 12)
        matrix = invertible(numbers[:9], f"register {match[2]}", path)
        triads[match[2]] = Triad(inverse(matrix), numbers[9:])
    if not triads:
        raise CalibrationFileError(f"{path} has no $VNWRG line of register 25 or 84.")
    return Imported(
        ImuModel(triads.get("25"), triads.get("84")),
        ("m/s^2", "rad/s"),
        "output of VectorNav",
        "the axes of the unit's corrected output",
        (path,),
        ("it corrects what the factory's calibration gives",),
    )


TARGET = Target("vectornav", "VectorNav registers 25 and 84", _HOLDS, "vectornav.txt", write, read)
