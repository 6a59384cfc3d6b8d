"""MotionCal: hard iron and soft iron as its packet to a board has them, and the packet itself.

Read in its source (rawdata.c, magcal.c, and the 68 bytes that later versions and Adafruit's sensor lab send):
``x = invW (0.1 u - V)`` in µT with u in counts of 0.1 µT, invW symmetric; signature 117, 84, sixteen floats (three
zeros for accelerometers, three for gyros, V, the field's norm, invW as 00, 11, 22, 01, 02, 12), CRC-16 of Modbus.
"""

from __future__ import annotations

import struct

import numpy as np

from tumble.errors import UsageError
from tumble.export.magnetometer import FieldCorrection, field_lines, without_rotation
from tumble.export.subject import Subject, with_losses
from tumble.export.target import MAGNETOMETER, Target
from tumble.export.words import commented

SIGNATURE = bytes((117, 84))
FORMULA = "x = invW (u - V), u and V in uT (a count of MotionCal is 0.1 uT)"


def write(subject: Subject) -> dict[str, str]:
    """Return the numbers as text, with the packet in hexadecimal digits.

    Raises
    ------
    UsageError
        If the magnetometer takes counts, nobody knows the field's norm, or more is lost than the wishes allow.
    """
    assert subject.magnetometer is not None
    field = subject.magnetometer.in_units("uT", "uT")
    if field is None:
        raise UsageError(
            "MotionCal works in µT, and the magnetometer's calibration takes counts or does not know the field's norm: "
            "say the unit with --units when you calibrate."
        )
    field, lost = without_rotation(field, "MotionCal")
    subject = with_losses(subject, subject.model, lost, TARGET.title)
    said = [
        f"{TARGET.title}",
        *field_lines(field, FORMULA),
        *(f"loss: {loss.text}" for loss in subject.losses),
    ]
    lines = ["V " + " ".join(f"{v:.9g}" for v in field.hard_iron), f"B {field.norm:.9g}"]
    lines += ["invW " + " ".join(f"{v:.9g}" for v in row) for row in field.soft_iron]
    lines.append("packet " + packet(field).hex(" "))
    return {"motioncal.txt": commented(said) + "\n".join(lines) + "\n"}


def packet(field: FieldCorrection) -> bytes:
    """Return the 68 bytes that MotionCal sends to a board.

    Parameters
    ----------
    field : symmetric, in µT.
    """
    S = field.soft_iron
    numbers = [*np.zeros(6), *field.hard_iron, field.norm]
    numbers += [S[0, 0], S[1, 1], S[2, 2], S[0, 1], S[0, 2], S[1, 2]]
    body = SIGNATURE + struct.pack("<16f", *numbers)
    return body + struct.pack("<H", _checksum(body))


def _checksum(body: bytes) -> int:
    """CRC-16 with the reflected polynomial 0xA001, begun with 0xFFFF."""
    check = 0xFFFF
    for byte in body:
        check ^= byte
        for _ in range(8):
            check = (check >> 1) ^ 0xA001 if check & 1 else check >> 1
    return check


TARGET = Target(
    "motioncal",
    "MotionCal (magnetometer alone)",
    frozenset({MAGNETOMETER}),
    "motioncal.txt",
    write,
    units=None,
    needs_magnetometer=True,
)
