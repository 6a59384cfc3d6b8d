"""ArduPilot parameters ``INS_ACC*``, ``INS_GYR*`` and, of a calibration with temperature, ``INS_TCAL*``.

Read in its source (AP_InertialSensor_Backend.cpp, AP_InertialSensor_tempcal.cpp): backward, ``x = R ((u -
ACCOFFS) * ACCSCAL)`` for accelerometers, ``x = R (u - GYROFFS)`` for gyros. Temperature: ``u - P(T - 35) +
P(T_cal - 35)`` before that, ``P(d) = (c1 + (c2 + c3 d) d) d 1e-6``, both temperatures held in TMIN to TMAX.
An offset of exactly zero with a scale of exactly one counts as not calibrated there.
"""

from __future__ import annotations

import re
from math import comb
from pathlib import Path

import numpy as np

from tumble.arrays import AnyArray
from tumble.errors import CalibrationFileError, UsageError
from tumble.export.autopilots import Found, diagonal, from_parameters
from tumble.export.polynomials import Polynomials, polynomials_of
from tumble.export.reading import text_of
from tumble.export.subject import Subject
from tumble.export.target import BIAS, SCALE, TEMPERATURE, Imported, Target
from tumble.export.words import commented, example_lines, head

REFERENCE = 35.0
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
    said = head(reduced, TARGET.title, FORMULA, example_lines(reduced))
    if any(thermal.used):
        said.append(f"the offsets hold at {thermal.reference:g} degrees Celsius, which the CALTEMP say")
    said.append("gyro offsets are found anew at each start unless INS_GYR_CAL is 0")
    text = "".join(f"{name},{float(np.float32(value)):.9g}\n" for name, value in rows)
    return {"ardupilot.parm": commented(said) + text}


def about(coefficients: AnyArray, reference: float, other: float) -> AnyArray:
    """Return the coefficients (powers from 1) of the same polynomials about another temperature, constant left out.

    Parameters
    ----------
    coefficients : (order + 1, 3), powers from 0.
    reference, other : °C.
    """
    order = coefficients.shape[0] - 1
    moved = np.zeros((order, coefficients.shape[1]))
    for j in range(1, order + 1):
        for k in range(j, order + 1):
            moved[j - 1] += coefficients[k] * comb(k, j) * (other - reference) ** (k - j)
    return moved


def _thermal_rows(thermal: Polynomials, n: int) -> list[tuple[str, float]]:
    if not any(thermal.used):
        return []
    rows: list[tuple[str, float]] = [
        (f"INS_TCAL{n}_ENABLE", 1.0),
        (f"INS_TCAL{n}_TMIN", thermal.span[0]),
        (f"INS_TCAL{n}_TMAX", thermal.span[1]),
    ]
    for kind, coefficients in zip(("ACC", "GYR"), thermal.coefficients, strict=True):
        moved = 1e6 * about(coefficients, thermal.reference, REFERENCE)
        rows += [
            (f"INS_TCAL{n}_{kind}{power + 1}_{axis}", float(moved[power, i]))
            for power in range(3)
            for i, axis in enumerate("XYZ")
        ]
    rows += [(f"INS_ACC{n}_CALTEMP", thermal.reference), (f"INS_GYR{n}_CALTEMP", thermal.reference)]
    return rows


def read(path: Path) -> Imported:
    """Read the first accelerometer and gyro of a parameter file.

    Raises
    ------
    CalibrationFileError
        If it is no parameter file, or has no calibration in it.
    """
    found: Found = {"accelerometer": {}, "gyroscope": {}}
    thermal: list[str] = []
    for line_number, line in enumerate(text_of(path).splitlines(), 1):
        line = line.partition("#")[0].strip()
        if not line:
            continue
        words = line.replace(",", " ").split()
        try:
            name, value = words[0], float(words[1])
        except (IndexError, ValueError):
            raise CalibrationFileError(
                f"{path}, line {line_number}: a line of ArduPilot's is NAME,VALUE, not {line[:40]!r}."
            ) from None
        if match := re.fullmatch(r"INS_(ACC|GYR)(\d?)(OFFS|SCAL)_([XYZ])", name):
            kind = "accelerometer" if match[1] == "ACC" else "gyroscope"
            found[kind][match[2] or "1", match[4], "offset" if match[3] == "OFFS" else "scale"] = value
        elif re.fullmatch(r"INS_TCAL\d_ENABLE", name) and value:
            thermal.append(name)
    return from_parameters(found, path, "ArduPilot", thermal)


TARGET = Target(
    "ardupilot",
    "ArduPilot parameters",
    frozenset({SCALE, BIAS, TEMPERATURE}),
    "ardupilot.parm",
    write,
    read,
)
