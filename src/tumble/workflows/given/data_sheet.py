"""Data sheets: what a number says about noise in other units, and what `--data-sheet` names.

That is a grade, or a fleet's own mean and spread as `tumble registry fleet` writes them.
"""

from __future__ import annotations

import os
from math import isfinite, log, pi, sqrt
from pathlib import Path

import numpy as np

from tumble.calibration.prior import FleetSheet, TriadFleet
from tumble.document.result import Calibration, read_calibration
from tumble.errors import UsageError
from tumble.noise.units import ACCELEROMETER, GYRO, NoiseUnit, find_noise_unit, random_walk_of, sample_sigma
from tumble.records import dataclass
from tumble.simulation.grades import GRADES, Grade, find_grade


def find_sheet(name: str | os.PathLike[str]) -> Grade | FleetSheet:
    """Return a data sheet.

    Parameters
    ----------
    name : of a grade, or a file of `tumble registry fleet`.

    Raises
    ------
    UsageError
        If there is no such grade, or the file is no fleet's.
    CalibrationFileError
        If the file cannot be read.
    """
    text = os.fspath(name)
    if text in GRADES or not (Path(text).exists() or text.endswith(".json")):
        return find_grade(text)
    from tumble.fleet.fleet_document import PROCEDURE

    document = read_calibration(text)
    if document.procedure != PROCEDURE:
        raise UsageError(
            f"{text} is a unit's calibration and no fleet's: `tumble registry fleet -o fleet.json` writes one. What "
            "an earlier calibration of the same unit knows, --prior takes."
        )
    return FleetSheet(_triad(document, "accelerometer"), _triad(document, "gyroscope"))


def _triad(document: Calibration, kind: str) -> TriadFleet | None:
    triad = getattr(document.model, kind)
    names = {name: at for at, name in enumerate(document.covariance_parameters)}
    wanted = [f"{kind}.matrix[{i},{j}]" for i in range(3) for j in range(3)]
    wanted += [f"{kind}.bias[{i}]" for i in range(3)]
    if triad is None or not all(name in names for name in wanted):
        return None
    at = [names[name] for name in wanted]
    units = document.raw_units
    unit = units.specific_force if kind == "accelerometer" else units.angular_rate
    return TriadFleet.of(unit, triad.matrix, triad.bias, document.covariance_matrix[np.ix_(at, at)])


_FLOOR = sqrt(2.0 * log(2.0) / pi)

# Units in which a coefficient is usually written, SI first.
_USUAL: dict[tuple[str, str], tuple[str, ...]] = {
    (GYRO, "Q"): ("rad", "arcsec", "deg"),
    (GYRO, "N"): ("rad/s/√Hz", "deg/√h", "deg/s/√Hz", "mdeg/s/√Hz", "deg/h/√Hz"),
    (GYRO, "B"): ("rad/s", "deg/h", "deg/s"),
    (GYRO, "K"): ("rad/s/√s", "rad/s^2/√Hz", "deg/h/√h", "deg/s/√s"),
    (GYRO, "R"): ("rad/s/s", "deg/h/h", "deg/s/s"),
    (ACCELEROMETER, "Q"): ("m/s", "mm/s", "ug*s"),
    (ACCELEROMETER, "N"): ("m/s^2/√Hz", "m/s/√h", "ug/√Hz", "mg/√Hz"),
    (ACCELEROMETER, "B"): ("m/s^2", "mg", "ug", "mGal"),
    (ACCELEROMETER, "K"): ("m/s^2/√s", "m/s^3/√Hz", "ug/√h", "mg/√s"),
    (ACCELEROMETER, "R"): ("m/s^2/s", "mg/h", "ug/h"),
}
_NO_WALK = (
    "Neither K nor anything else follows from it. Run `tumble noise` on the recording that it was "
    "found from. That gives K with its interval, or the limit below which it lies."
)
_SENSOR = {GYRO: "gyro", ACCELEROMETER: "accelerometer"}
_NAMES = {
    "Q": "quantisation (Q): the root of the variance of what rounding leaves in the integral of the output",
    "N": "white noise (N): the root of its density, two-sided as in IEEE Std 952",
    "B": "bias instability (B): flicker of the two-sided density B²/(2πf), or the floor of an Allan curve",
    "K": "rate random walk (K): the root of the density of the white noise of which the bias is the integral",
    "R": "ramp (R): a steady slope",
}
_WALK = {GYRO: "angle random walk", ACCELEROMETER: "velocity random walk"}

# Keys of other programs' files: sensor, letter, unit of the file, and how the number is meant.
_KEYS: dict[str, tuple[str, str, str]] = {
    "kalibr:gyroscope_noise_density": (GYRO, "N", ""),
    "kalibr:gyroscope_random_walk": (GYRO, "K", ""),
    "kalibr:accelerometer_noise_density": (ACCELEROMETER, "N", ""),
    "kalibr:accelerometer_random_walk": (ACCELEROMETER, "K", ""),
    "allan_variance_ros:gyroscope_noise_density": (GYRO, "N", "worst"),
    "allan_variance_ros:gyroscope_random_walk": (GYRO, "K", "line"),
    "allan_variance_ros:accelerometer_noise_density": (ACCELEROMETER, "N", "worst"),
    "allan_variance_ros:accelerometer_random_walk": (ACCELEROMETER, "K", "line"),
    "imu_utils:gyr_n": (GYRO, "N", "sample"),
    "imu_utils:acc_n": (ACCELEROMETER, "N", "sample"),
    "imu_utils:gyr_w": (GYRO, "B", "floor"),
    "imu_utils:acc_w": (ACCELEROMETER, "B", "floor"),
    "imu_utils-mintar:gyr_n": (GYRO, "N", ""),
    "imu_utils-mintar:acc_n": (ACCELEROMETER, "N", ""),
    "imu_utils-mintar:gyr_w": (GYRO, "K", ""),
    "imu_utils-mintar:acc_w": (ACCELEROMETER, "K", ""),
}


@dataclass(frozen=True, slots=True)
class Equal:
    """One line of an answer: the same noise under another name or in another unit.

    Attributes
    ----------
    name : what it is.
    value, unit : of it.
    assumption : under which it is the same; empty for none.
    """

    name: str
    value: float
    unit: str
    assumption: str = ""


@dataclass(frozen=True, slots=True)
class UnitExplanation:
    """What a number says.

    Attributes
    ----------
    said : the number as it was given.
    meaning : what it is, a sentence.
    letter : of IEEE Std 952; empty for a number that is no coefficient.
    sensor : "gyro" or "accelerometer".
    si : the coefficient in SI, under the first of the assumptions where there are some; nan for no coefficient.
    equals : the same otherwise.
    not_convertible : what does not follow from it, one sentence each.
    """

    said: str
    meaning: str
    letter: str
    sensor: str
    si: float
    equals: tuple[Equal, ...]
    not_convertible: tuple[str, ...]


def explain_unit(value: float, unit: str, rate: float | None = None) -> UnitExplanation:
    """Say what a number of a data sheet or of another program's file is, and what else it is called.

    Parameters
    ----------
    value : in `unit`.
    unit : of a noise coefficient, as ``deg/√h`` or ``ug/sqrt(Hz)``, or a key of another program's file, as
        ``kalibr:gyroscope_noise_density`` or ``imu_utils:gyr_n``.
    rate : Hz of the samples, for what depends on it.

    Raises
    ------
    UsageError
        If the unit is not known, the number is none, or the key's number depends on a rate that is not given.
    """
    if not isfinite(value) or value < 0.0:
        raise UsageError(f"{value} is no amount of noise: give a number that is not negative.")
    if rate is not None and not (isfinite(rate) and rate > 0.0):
        raise UsageError(f"--sample-rate {rate:g}: a sampling rate is above 0 Hz.")
    if unit in _KEYS:
        return _of_key(value, unit, rate)
    found = find_noise_unit(unit)
    if found is None:
        raise UsageError(
            f"{unit!r} is neither a unit of noise (deg/√h, deg/h, deg/s/√Hz, mg, µg/√Hz, m/s/√h, rad/s/√s, ...) nor a "
            f"key of a file ({', '.join(list(_KEYS)[:2])}, imu_utils:gyr_n, ...)."
        )
    letter = found.letters
    said = f"{value:g} {unit}"
    sensor = _SENSOR[found.quantity]
    walk = f" or {_WALK[found.quantity]}" if letter == "N" else ""
    meaning = f"{said} is {_article(sensor)} {sensor}'s {_NAMES[letter].replace(' (N)', f'{walk} (N)')}."
    si = value * found.factor
    one_sided: list[Equal] = []
    if letter == "N" and found.name.endswith("/rtHz"):
        meaning = f"{meaning[:-1]}; or, as most data sheets state a noise density, one-sided, which is √2 N."
        name = _USUAL[found.quantity, "N"]
        one_sided = [
            Equal("N", si / sqrt(2.0) / _factor(each), each, "the number is one-sided: over √2")
            for each in name[:3]
        ]
    return UnitExplanation(
        said,
        meaning,
        letter,
        sensor,
        si,
        (*_equals(found.quantity, letter, si, rate), *one_sided),
        tuple(_refusals(letter, rate)),
    )


def _article(noun: str) -> str:
    return "an" if noun[0] in "aeiou" else "a"


def _of_key(value: float, key: str, rate: float | None) -> UnitExplanation:
    quantity, letter, how = _KEYS[key]
    unit, sensor = _USUAL[quantity, letter][0], _SENSOR[quantity]
    said = f"{value:g} {key}"
    if how == "line":
        return _of_whole_curve(said, quantity)
    if how == "sample":
        if rate is None:
            raise UsageError(
                f"{key} is √rate times the Allan deviation at 1 s, the standard deviation of a "
                "sample. N follows with --sample-rate HZ, the rate of the recording that it was "
                "found from."
            )
        si = random_walk_of(value, rate)
        meaning = (
            f"{said} is √rate times the Allan deviation at 1 s, which is N √rate: the standard deviation of a "
            f"sample at {rate:g} Hz, in {_USUAL[quantity, 'B'][0]}. N itself is {si:.6g} {unit}."
        )
    elif how == "floor":
        si = value / _FLOOR
        meaning = (
            f"{said} is the lowest point of the Allan curve, {_article(sensor)} {sensor}'s bias "
            f"instability, and no random walk although it is called one. B is {si:.6g} {unit} if the "
            "curve is flat there."
        )
    else:
        si = value
        worst = ", of the worst axis" if how == "worst" else ""
        meaning = f"{said} is {_article(sensor)} {sensor}'s {_NAMES[letter]}, in {unit}{worst}."
    return UnitExplanation(
        said,
        meaning,
        letter,
        sensor,
        si,
        # what a floor is, has been said: the other readings of a bare number are none of it
        tuple(line for line in _equals(quantity, letter, si, rate) if how != "floor" or not line.assumption),
        tuple(_refusals(letter, rate)),
    )


def _of_whole_curve(said: str, quantity: str) -> UnitExplanation:
    """A line through the whole Allan curve, which users take for a rate random walk."""
    sensor, unit = _SENSOR[quantity], _USUAL[quantity, "K"][0]
    return UnitExplanation(
        said,
        f"{said} is called {_article(sensor)} {sensor}'s rate random walk, and is none. It is the "
        f"height at 3 s of a line of slope +1/2 through the whole Allan curve, in {unit}, of the "
        "worst axis. Where the curve falls over most of its length, white noise lifts the line: even "
        "a unit without a random walk has such a number.",
        "",
        sensor,
        float("nan"),
        (),
        (_NO_WALK,),
    )


def _equals(quantity: str, letter: str, si: float, rate: float | None) -> list[Equal]:
    si_unit = _USUAL[quantity, letter][0]
    gyro = quantity == GYRO
    found = [Equal(letter, si / _factor(name), name) for name in _USUAL[quantity, letter]]
    if letter == "N":
        found.append(
            Equal(
                "a sheet's noise density",
                si * sqrt(2.0) / _factor(_USUAL[quantity, "N"][2]),
                _USUAL[quantity, "N"][2],
                "the sheet's density is one-sided (rms = density √bandwidth) and the number is not: √2 N",
            )
        )
        found.append(Equal(_kalibr(gyro, "noise_density"), si, si_unit, "continuous, as Kalibr has it"))
        if rate is not None:
            assumed = f"white up to half the rate, {rate:g} Hz"
            sample = sample_sigma(si, rate)
            base = _USUAL[quantity, "B"]
            found += [Equal("sigma of a sample", sample / _factor(name), name, assumed) for name in base[:2]]
            key = "imu_utils:gyr_n" if gyro else "imu_utils:acc_n"
            found.append(Equal(key, sample, base[0], assumed))
    elif letter == "K":
        found.append(Equal(_kalibr(gyro, "random_walk"), si, si_unit, "continuous, as Kalibr has it"))
        if rate is not None:
            found.append(
                Equal(
                    "sigma of the bias's step from sample to sample",
                    si / sqrt(rate),
                    _USUAL[quantity, "B"][0],
                    f"samples at {rate:g} Hz",
                )
            )
    elif letter == "B":
        found += _of_instability(quantity, si, rate)
    elif letter == "Q":
        found.append(Equal("the step of the integral", si * sqrt(12.0), si_unit, "uniform rounding: √12 Q"))
    return found


def _of_instability(quantity: str, si: float, rate: float | None) -> list[Equal]:
    name = _USUAL[quantity, "B"][1]
    factor = _factor(name)
    found = [
        Equal("floor of the Allan deviation", _FLOOR * si / factor, name, "the number is B itself: 0.664 B"),
        Equal(
            "B",
            si / _FLOOR / factor,
            name,
            "the number is the floor of an Allan curve, as sheets mostly have it",
        ),
    ]
    if rate is not None:
        unit = _USUAL[quantity, "N"][0]
        found.append(
            Equal(
                "N",
                random_walk_of(si, rate),
                unit,
                f"the number is the sigma of a sample, white, at {rate:g} Hz",
            )
        )
    return found


def _factor(name: str) -> float:
    unit = find_noise_unit(name)
    assert isinstance(unit, NoiseUnit), name
    return unit.factor


def _kalibr(gyro: bool, key: str) -> str:
    return f"kalibr:{'gyroscope' if gyro else 'accelerometer'}_{key}"


def _refusals(letter: str, rate: float | None) -> list[str]:
    refused: list[str] = []
    if letter == "B":
        refused.append(
            "A rate random walk K (Kalibr's random_walk) does not follow from a bias instability, "
            "because flicker is no random walk. What stands for it in a filter depends on the time "
            "over which it is to be right."
        )
    if letter == "N" and rate is None:
        refused.append(
            "The sigma of a sample does not follow without the sampling rate: give --sample-rate HZ."
        )
    if letter in "QNR":
        refused.append(f"Nothing about the bias's wander (B, K) follows from {letter}: it is another term.")
    return refused
