"""ArduPilot parameters ``INS_ACC*``, ``INS_GYR*`` and, of a calibration with temperature, ``INS_TCAL*``.

Read in its source (AP_InertialSensor_Backend.cpp, AP_InertialSensor_tempcal.cpp): backward, ``x = R ((u -
ACCOFFS) * ACCSCAL)`` for accelerometers, ``x = R (u - GYROFFS)`` for gyros. Temperature: ``u - P(T - 35) +
P(T_cal - 35)`` before that, ``P(d) = (c1 + (c2 + c3 d) d) d 1e-6``, both temperatures held in TMIN to TMAX.
An offset of exactly zero with a scale of exactly one counts as not calibrated there. Compasses
(AP_Compass_Backend.cpp, correct_field): ``x = S (u + OFS)`` in milligauss, S symmetric of DIA and ODI.
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
from tumble.files import number_of
from tumble.sensor import Triad

REFERENCE = 35.0
_ABSOLUTE_ZERO = 273.15  # below it CALTEMP is not set
FORMULA = (
    "accelerometers: x = (u - ACCOFFS) * ACCSCAL, axis by axis; gyros: x = u - GYROFFS; then AHRS_ORIENTATION",
    "with INS_TCAL: first u - P(T - 35) + P(T_cal - 35), P(d) = (c1 + (c2 + c3 d) d) d 1e-6; T_cal is INS_ACCn_CALTEMP",
)


def write(subject: Subject) -> dict[str, str]:
    """Return a parameter file of lines ``NAME,VALUE``.

    Raises
    ------
    UsageError
        If more is lost than the wishes allow, or the instance is not 0 to 2.
    """
    n = subject.wishes.instance
    if not 0 <= n <= 2:
        raise UsageError(f"ArduPilot has IMUs 0 to 2 here (its own numbers 1 to 3), not {n} (--instance).")
    unit = "" if n == 0 else f"{n + 1}"
    thermal = polynomials_of(subject, 3, TARGET.title)
    reduced = diagonal(thermal.subject, TARGET.title)
    rows: list[tuple[str, float]] = []
    for i, axis in enumerate("XYZ"):
        rows.append((f"INS_ACC{unit}OFFS_{axis}", float(reduced.accelerometer.bias[i])))
        rows.append((f"INS_ACC{unit}SCAL_{axis}", float(1.0 / reduced.accelerometer.matrix[i, i])))
    rows += [(f"INS_GYR{unit}OFFS_{axis}", float(reduced.gyroscope.bias[i])) for i, axis in enumerate("XYZ")]
    rows += _thermal_rows(thermal, n + 1)
    of_field, told, lost = _field_rows(subject, unit)
    rows += of_field
    reduced = with_losses(reduced, reduced.model, lost, TARGET.title)
    said = head(reduced, TARGET.title, FORMULA, example_lines(reduced))
    if any(thermal.used):
        said.append(f"the offsets hold at {thermal.reference:g} degrees Celsius, which the CALTEMP say")
    said += told
    said.append("gyro offsets are found anew at each start unless INS_GYR_CAL is 0")
    text = "".join(f"{name},{float(np.float32(value)):.9g}\n" for name, value in rows)
    return {"ardupilot.parm": commented(said) + text}


def _field_rows(subject: Subject, unit: str) -> tuple[list[tuple[str, float]], list[str], list[Loss]]:
    """Rows of COMPASS, what the comments say of them, and what they lose."""
    field, lost = for_autopilot(subject.magnetometer, "mgauss", "ArduPilot", subject.wishes.largest_loss)
    if field is None:
        return [], [], lost
    S = field.soft_iron
    # The offset is added there.
    rows = [(f"COMPASS_OFS{unit}_{axis}", -float(field.hard_iron[i])) for i, axis in enumerate("XYZ")]
    rows += [(f"COMPASS_DIA{unit}_{axis}", float(S[i, i])) for i, axis in enumerate("XYZ")]
    pairs = zip("XYZ", ((0, 1), (0, 2), (1, 2)), strict=True)
    rows += [(f"COMPASS_ODI{unit}_{axis}", float(S[i, j])) for axis, (i, j) in pairs]
    # The scale is in the diagonal: a factor of its own would count it twice.
    rows.append((f"COMPASS_SCALE{unit}", 1.0))
    formula = "x = S (u + OFS), S = [DIA_X ODI_X ODI_Y; ODI_X DIA_Y ODI_Z; ODI_Y ODI_Z DIA_Z]"
    return rows, field_lines(field, f"{formula}, u after COMPASS_ORIENT"), lost


def _thermal_rows(thermal: Polynomials, n: int) -> list[tuple[str, float]]:
    if not any(thermal.used):
        return []
    rows: list[tuple[str, float]] = [
        (f"INS_TCAL{n}_ENABLE", 1.0),
        (f"INS_TCAL{n}_TMIN", thermal.span[0]),
        (f"INS_TCAL{n}_TMAX", thermal.span[1]),
    ]
    for kind, coefficients in zip(("ACC", "GYR"), thermal.coefficients, strict=True):
        moved = 1e6 * Curve(coefficients, thermal.reference, thermal.span).about(REFERENCE)[1:]
        rows += [
            (f"INS_TCAL{n}_{kind}{power + 1}_{axis}", float(moved[power, i]))
            for power in range(3)
            for i, axis in enumerate("XYZ")
        ]
    rows += [(f"INS_ACC{n}_CALTEMP", thermal.reference), (f"INS_GYR{n}_CALTEMP", thermal.reference)]
    return rows


def read(path: Path) -> Imported:
    """Read the first accelerometer and gyro of a parameter file, with their temperature compensation.

    Raises
    ------
    CalibrationFileError
        If it is no parameter file, or has no calibration in it.
    """
    found: Found = {"accelerometer": {}, "gyroscope": {}}
    others: dict[str, float] = {}
    for line_number, line in enumerate(text_of(path).splitlines(), 1):
        line = line.partition("#")[0].strip()
        if not line:
            continue
        words = line.replace(",", " ").split()
        try:
            name, value = words[0], number_of(words[1])
        except (IndexError, ValueError):
            raise CalibrationFileError(
                f"{path}, line {line_number}: a line of ArduPilot's is NAME,VALUE, not {line[:40]!r}."
            ) from None
        if match := re.fullmatch(r"INS_(ACC|GYR)(\d?)(OFFS|SCAL)_([XYZ])", name):
            kind = "accelerometer" if match[1] == "ACC" else "gyroscope"
            found[kind][match[2] or "1", match[4], "offset" if match[3] == "OFFS" else "scale"] = value
        else:
            others[name] = value

    def curve_of(kind: str, number: str, triad: Triad, remarks: list[str]) -> Curve | None:
        return _curve(others, kind, number, triad, remarks, path)

    return from_parameters(found, path, "ArduPilot", curve_of)


def _curve(
    values: dict[str, float], kind: str, number: str, triad: Triad, remarks: list[str], path: Path
) -> Curve | None:
    """Return a sensor's bias over temperature: the offset at CALTEMP, and how P differs from what it is there."""
    what = f"INS_TCAL{number}_ENABLE"
    if not values.get(what):
        return None
    short = "ACC" if kind == "accelerometer" else "GYR"
    begin = f"INS_TCAL{number}_"
    low, high = entries_of(values, [begin + "TMIN", begin + "TMAX"], what, path)
    names = [f"{begin}{short}{power}_{axis}" for power in (1, 2, 3) for axis in "XYZ"]
    coefficients = np.zeros((4, 3))
    coefficients[1:] = 1e-6 * entries_of(values, names, what, path).reshape(3, 3)
    calibrated = values.get(f"INS_{short}{number}_CALTEMP")
    if calibrated is None or calibrated < -_ABSOLUTE_ZERO:
        remarks.append(f"INS_{short}{number}_CALTEMP is not there: the offsets were taken as those at 35 °C")
        calibrated = REFERENCE
    curve = Curve(coefficients, REFERENCE, (float(low), float(high)))
    moved = curve.about(float(np.clip(calibrated, low, high)))
    moved[0] = triad.bias
    return Curve(moved, float(np.clip(calibrated, low, high)), curve.span)


TARGET = Target(
    "ardupilot",
    "ArduPilot parameters",
    frozenset({SCALE, BIAS, TEMPERATURE, MAGNETOMETER}),
    "ardupilot.parm",
    write,
    read,
    replaces=True,
)
