"""PX4 parameters ``CAL_ACC*``, ``CAL_GYRO*``, ``CAL_MAG*`` and, of one with temperature, ``TC_A*``, ``TC_G*``.

Read in its source (sensor_calibration/Accelerometer.hpp, Gyroscope.hpp and Magnetometer.hpp: ``Correct``;
TemperatureCompensation.h; module.yaml): backward, ``x = R ((u - o_T - OFF) * SCALE)`` for accelerometers,
without SCALE for gyros, R the board's rotation, which is left as it is. No off-diagonals, no gyro scale: what
that loses is said. Magnetometers: ``x = R S (u - OFF)`` in gauss, S symmetric of SCALE and ODIAG.
``o_T = x3 d^3 + x2 d^2 + x1 d + x0`` with ``d = clip(T, TMIN, TMAX) - TREF``. Values are single precision.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from tumble.errors import CalibrationFileError, UsageError
from tumble.export.autopilots import Found, diagonal, entries_of, from_parameters
from tumble.export.curves import Curve
from tumble.export.losses import Loss
from tumble.export.magnetometer import field_lines, for_autopilot
from tumble.export.polynomials import Polynomials, polynomials_of
from tumble.export.reading import text_of
from tumble.export.subject import Subject, with_losses
from tumble.export.target import BIAS, MAGNETOMETER, SCALE, TEMPERATURE, Imported, Target
from tumble.export.words import commented, example_lines, head
from tumble.files import number_of, shown
from tumble.sensor import Triad

INTEGER, REAL = 6, 9
FORMULA = (
    "accelerometers: x = (u - o_T - OFF) * SCALE, axis by axis; gyros: x = u - o_T - OFF; then the board's rotation",
    "u and x are along the sensor's own axes: PX4 turns them to the board's later (CAL_ACCn_ROT, SENS_BOARD_ROT)",
)


def write(subject: Subject) -> dict[str, str]:
    """Return a parameter file as QGroundControl loads it: vehicle, component, name, value, type, by tabs.

    Raises
    ------
    UsageError
        If more is lost than the wishes allow, or the instance is not 0 to 3.
    """
    n = subject.wishes.instance
    if not 0 <= n <= 3:
        raise UsageError(f"PX4 has IMUs 0 to 3, not {n} (--instance).")
    thermal = polynomials_of(subject, 3, TARGET.title)
    reduced = diagonal(thermal.subject, TARGET.title)
    offsets = np.where(thermal.used, 0.0, 1.0)
    rows: list[tuple[str, float, int]] = []
    for i, axis in enumerate("XYZ"):
        rows.append((f"CAL_ACC{n}_{axis}OFF", float(offsets[0] * reduced.accelerometer.bias[i]), REAL))
        rows.append((f"CAL_ACC{n}_{axis}SCALE", float(1.0 / reduced.accelerometer.matrix[i, i]), REAL))
    rows += [
        (f"CAL_GYRO{n}_{axis}OFF", float(offsets[1] * reduced.gyroscope.bias[i]), REAL)
        for i, axis in enumerate("XYZ")
    ]
    rows += _thermal_rows(thermal, n)
    of_field, told, lost = _field_rows(subject, n)
    rows += of_field
    reduced = with_losses(reduced, reduced.model, lost, TARGET.title)
    said = head(reduced, TARGET.title, FORMULA, _test(reduced, thermal))
    said.append(
        f"CAL_ACC{n}_ID and CAL_GYRO{n}_ID are for you to keep: PX4 takes these numbers for the "
        "sensor whose ID it has, so calibrate once on the vehicle, then load them"
    )
    said += told
    lines = [f"1\t1\t{name}\t{_value(value, kind)}\t{kind}" for name, value, kind in rows]
    return {"px4.params": commented(said) + "\n".join(lines) + "\n"}


def _field_rows(subject: Subject, n: int) -> tuple[list[tuple[str, float, int]], list[str], list[Loss]]:
    """Rows of CAL_MAG, what the comments say of them, and what they lose."""
    field, lost = for_autopilot(subject.magnetometer, "gauss", "PX4", subject.wishes.largest_loss)
    if field is None:
        return [], [], lost
    S = field.soft_iron
    rows = [(f"CAL_MAG{n}_{axis}OFF", float(field.hard_iron[i]), REAL) for i, axis in enumerate("XYZ")]
    rows += [(f"CAL_MAG{n}_{axis}SCALE", float(S[i, i]), REAL) for i, axis in enumerate("XYZ")]
    pairs = zip("XYZ", ((0, 1), (0, 2), (1, 2)), strict=True)
    rows += [(f"CAL_MAG{n}_{axis}ODIAG", float(S[i, j]), REAL) for axis, (i, j) in pairs]
    formula = "x = S (u - OFF), S = [XSCALE XODIAG YODIAG; XODIAG YSCALE ZODIAG; YODIAG ZODIAG ZSCALE]"
    return rows, field_lines(field, f"{formula}, then CAL_MAG{n}_ROT"), lost


def _value(value: float, kind: int) -> str:
    return f"{int(value)}" if kind == INTEGER else f"{float(np.float32(value)):.9g}"


def _test(subject: Subject, thermal: Polynomials) -> list[str]:
    at = f" at {thermal.reference:g} degrees Celsius" if any(thermal.used) else ""
    lines = example_lines(subject)
    return [lines[0] + at, *lines[1:]]


def _thermal_rows(thermal: Polynomials, n: int) -> list[tuple[str, float, int]]:
    """Rows of TC_A and TC_G with the whole bias in x0, so that the offsets beside them are zero."""
    rows: list[tuple[str, float, int]] = []
    for letter, number, used in zip("AG", (0, 1), thermal.used, strict=True):
        if not used:
            continue
        coefficients = thermal.coefficients[number]
        rows += [(f"TC_{letter}_ENABLE", 1, INTEGER)]
        rows += [
            (f"TC_{letter}{n}_TREF", thermal.reference, REAL),
            (f"TC_{letter}{n}_TMIN", thermal.span[0], REAL),
            (f"TC_{letter}{n}_TMAX", thermal.span[1], REAL),
        ]
        rows += [
            (f"TC_{letter}{n}_X{power}_{axis}", float(coefficients[power, axis]), REAL)
            for power in range(4)
            for axis in range(3)
        ]
    return rows


def read(path: Path) -> Imported:
    """Read the first calibrated accelerometer and gyro of a parameter file, with their temperature compensation.

    Raises
    ------
    CalibrationFileError
        If it is no parameter file, or has no calibration in it.
    """
    found: Found = {"accelerometer": {}, "gyroscope": {}}
    others: dict[str, float] = {}
    for line_number, line in enumerate(text_of(path).splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        words = line.split()
        if len(words) != 5:
            raise CalibrationFileError(
                f"{path}, line {line_number}, has {len(words)} words: a line of PX4's is vehicle, component, name, "
                "value, type."
            )
        try:
            value = number_of(words[3])
        except ValueError:
            raise CalibrationFileError(
                f"{path}, line {line_number}: {shown(words[3][:40])} is no number."
            ) from None
        if match := re.fullmatch(r"CAL_(ACC|GYRO)(\d)_([XYZ])(OFF|SCALE)", words[2]):
            kind = "accelerometer" if match[1] == "ACC" else "gyroscope"
            found[kind][match[2], match[3], "offset" if match[4] == "OFF" else "scale"] = value
        else:
            others[words[2]] = value

    def curve_of(kind: str, number: str, triad: Triad, remarks: list[str]) -> Curve | None:
        return _curve(others, kind, number, triad, remarks, path)

    return from_parameters(found, path, "PX4", curve_of)


def _curve(
    values: dict[str, float], kind: str, number: str, triad: Triad, remarks: list[str], path: Path
) -> Curve | None:
    """Return a sensor's bias over temperature: what TC holds about TREF, and the offset beside it."""
    letter, calibrated = (
        ("A", f"CAL_ACC{number}_ID") if kind == "accelerometer" else ("G", f"CAL_GYRO{number}_ID")
    )
    if not values.get(f"TC_{letter}_ENABLE"):
        return None
    own = values.get(calibrated)
    known = [n for n in "0123" if own and values.get(f"TC_{letter}{n}_ID") == own]
    n = known[0] if known else number
    if not known and own and values.get(f"TC_{letter}{n}_ID"):
        remarks.append(
            f"the temperature compensation of TC_{letter} is for other sensors than the {kind} that was read"
        )
        return None
    what = f"TC_{letter}_ENABLE"
    begin = f"TC_{letter}{n}_"
    reference, low, high = entries_of(values, [begin + name for name in ("TREF", "TMIN", "TMAX")], what, path)
    names = [f"{begin}X{power}_{axis}" for power in range(4) for axis in range(3)]
    coefficients = entries_of(values, names, what, path).reshape(4, 3)
    coefficients[0] += triad.bias
    return Curve(coefficients, float(reference), (float(low), float(high)))


TARGET = Target(
    "px4",
    "PX4 parameters",
    frozenset({SCALE, BIAS, TEMPERATURE, MAGNETOMETER}),
    "px4.params",
    write,
    read,
    replaces=True,
)
