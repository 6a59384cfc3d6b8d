"""What the user declares of units with `--units`, by name or by chip.

Sensitivities of common chips by their measuring range: what one count is, from each maker's data sheet.

They are nominal values. A unit differs from them by per cent, which is what a calibration finds. The table was not read
anew from each sheet. Those of MPU-6000, 6050, 6500, ICM-20602, 20689, 20948, LSM9DS0, LSM9DS1 and ADIS16448 are also
what the Linux kernel's drivers have (drivers/iio: inv_mpu6050, st_sensors, st_lsm6dsx, adis16400). Gravity checks every
number in use: at rest the accelerometer's, while the unit turns the gyro's.

References
----------
TDK InvenSense: MPU-6000/6050 PS-MPU-6000A-00, MPU-6500 PS-MPU-6500A-01, MPU-9150 PS-MPU-9150A-00, MPU-9250
PS-MPU-9250A-01, MPU-9255 PS-MPU-9255, ICM-20602 DS-000176, ICM-20608-G PS-ICM-20608-G, ICM-20649 DS-000192, ICM-20689
DS-000143, ICM-20948 DS-000189, ICM-42605 DS-000292, ICM-42688-P DS-000347, IAM-20680 DS-000196, ITG-3200 PS-ITG-3200A.
STMicroelectronics: LSM6DS3 DocID026899, LSM6DSL DocID028475, LSM6DSO DS12140, LSM6DSOX DS12814, ISM330DHCX DS13012,
LSM9DS0 DocID024763, LSM9DS1 DocID025715, L3GD20 DocID022116. Bosch Sensortec: BMI055 BST-BMI055-DS000, BMI088
BST-BMI088-DS001, BMI160 BST-BMI160-DS000, BMI270 BST-BMI270-DS000. Analog Devices: ADIS16448, ADIS16470.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from tumble.errors import UsageError
from tumble.records import dataclass
from tumble.units import find_unit, known_units

_Ranges = dict[float, float]


@dataclass(frozen=True, slots=True)
class Chip:
    """A chip's counts by range.

    Attributes
    ----------
    title : as its maker writes it.
    force : LSB/g by range in g; empty without an accelerometer.
    rate : LSB/(°/s) by range in °/s; empty without a gyro.
    """

    title: str
    force: _Ranges
    rate: _Ranges


def _of_mg(ranges: _Ranges) -> _Ranges:
    """Counts by unit from thousandths of it by count, as ST states them."""
    return {full: 1000.0 / milli for full, milli in ranges.items()}


_16_BIT_G: _Ranges = {2: 16384, 4: 8192, 8: 4096, 16: 2048}
_MPU_DPS: _Ranges = {250: 131, 500: 65.5, 1000: 32.8, 2000: 16.4}
_ICM4_DPS: _Ranges = {15.625: 2097.2, 31.25: 1048.6, 62.5: 524.3, 125: 262, **_MPU_DPS}
_BOSCH_DPS: _Ranges = {125: 262.4, 250: 131.2, 500: 65.6, 1000: 32.8, 2000: 16.4}
_ST_G = _of_mg({2: 0.061, 4: 0.122, 8: 0.244, 16: 0.488})
_ST_DPS = _of_mg({125: 4.375, 250: 8.75, 500: 17.5, 1000: 35.0, 2000: 70.0})

CHIPS: dict[str, Chip] = {
    "mpu6000": Chip("MPU-6000", _16_BIT_G, _MPU_DPS),
    "mpu6050": Chip("MPU-6050", _16_BIT_G, _MPU_DPS),
    "mpu6500": Chip("MPU-6500", _16_BIT_G, _MPU_DPS),
    "mpu9150": Chip("MPU-9150", _16_BIT_G, _MPU_DPS),
    "mpu9250": Chip("MPU-9250", _16_BIT_G, _MPU_DPS),
    "mpu9255": Chip("MPU-9255", _16_BIT_G, _MPU_DPS),
    "icm20602": Chip("ICM-20602", _16_BIT_G, _MPU_DPS),
    "icm20608": Chip("ICM-20608-G", _16_BIT_G, _MPU_DPS),
    "icm20649": Chip(
        "ICM-20649", {4: 8192, 8: 4096, 16: 2048, 30: 1024}, {500: 65.5, 1000: 32.8, 2000: 16.4, 4000: 8.2}
    ),
    "icm20689": Chip("ICM-20689", _16_BIT_G, _MPU_DPS),
    "icm20948": Chip("ICM-20948", _16_BIT_G, _MPU_DPS),
    "icm42605": Chip("ICM-42605", _16_BIT_G, _ICM4_DPS),
    "icm42688p": Chip("ICM-42688-P", _16_BIT_G, _ICM4_DPS),
    "iam20680": Chip("IAM-20680", _16_BIT_G, _MPU_DPS),
    "itg3200": Chip("ITG-3200", {}, {2000: 14.375}),
    "lsm6ds3": Chip("LSM6DS3", _ST_G, _ST_DPS),
    "lsm6dsl": Chip("LSM6DSL", _ST_G, _ST_DPS),
    "lsm6dso": Chip("LSM6DSO", _ST_G, _ST_DPS),
    "lsm6dsox": Chip("LSM6DSOX", _ST_G, _ST_DPS),
    "ism330dhcx": Chip("ISM330DHCX", _ST_G, _ST_DPS | _of_mg({4000: 140.0})),
    "lsm9ds0": Chip(
        "LSM9DS0",
        _of_mg({2: 0.061, 4: 0.122, 6: 0.183, 8: 0.244, 16: 0.732}),
        _of_mg({245: 8.75, 500: 17.5, 2000: 70.0}),
    ),
    "lsm9ds1": Chip(
        "LSM9DS1",
        _of_mg({2: 0.061, 4: 0.122, 8: 0.244, 16: 0.732}),
        _of_mg({245: 8.75, 500: 17.5, 2000: 70.0}),
    ),
    "l3gd20": Chip("L3GD20", {}, _of_mg({250: 8.75, 500: 17.5, 2000: 70.0})),
    "bmi055": Chip("BMI055", {2: 1024, 4: 512, 8: 256, 16: 128}, _BOSCH_DPS),
    "bmi088": Chip(
        "BMI088",
        {3: 10920, 6: 5460, 12: 2730, 24: 1365},
        {125: 262.144, 250: 131.072, 500: 65.536, 1000: 32.768, 2000: 16.384},
    ),
    "bmi160": Chip("BMI160", _16_BIT_G, _BOSCH_DPS),
    "bmi270": Chip("BMI270", _16_BIT_G, _BOSCH_DPS),
    "adis16448": Chip("ADIS16448", {18: 1200}, {250: 100, 500: 50, 1000: 25}),
    "adis16470": Chip("ADIS16470", {40: 800}, {2000: 10}),
}
"""By name in small letters without separators."""

_RANGE = re.compile(r"[±+]?/?-?([0-9.]+)(g|dps|deg/s|°/s)")


def with_chip(words: list[str]) -> list[str]:
    """Return words of ``--units`` with a chip and its ranges, where they begin with one, as units.

    Parameters
    ----------
    words : as ``mpu6050``, ``2g``, ``250dps``, ``ms``.

    Raises
    ------
    UsageError
        If the chip has no such range, or a range is missing that it has several of.

    Examples
    --------
    >>> with_chip(["mpu6050", "4g", "500dps", "ms"])
    ['8192 LSB/g', '65.5 LSB/(deg/s)', 'ms']
    """
    if not words or re.sub(r"[^a-z0-9]", "", words[0].lower()) not in CHIPS:
        return words
    of_chip = [word for word in words[1:] if word[:1] in "0123456789±+-"]
    others = [word for word in words[1:] if word not in of_chip]
    return [*units_of_chip(",".join([words[0], *of_chip])).split(","), *others]


def units_of_chip(said: str) -> str:
    """Return the units, as for ``--units``, of a chip's raw counts in the ranges that it was set to.

    Parameters
    ----------
    said : name and ranges, as ``mpu6050,2g,250dps``.

    Raises
    ------
    UsageError
        If the chip is not known, has no such range, or a range is missing that it has several of.

    Examples
    --------
    >>> units_of_chip("mpu6050,4g,500dps")
    '8192 LSB/g,65.5 LSB/(deg/s)'
    """
    name, *words = (word.strip() for word in said.lower().split(","))
    chip = CHIPS.get(re.sub(r"[^a-z0-9]", "", name))
    if chip is None:
        raise UsageError(
            f"--units {name}: known are {', '.join(CHIPS)}. Of another one give its data sheet's sensitivities, as "
            '--units "16384 LSB/g,131 LSB/(deg/s)".'
        )
    given: dict[str, float] = {}
    for word in words:
        match = _RANGE.fullmatch(word)
        if match is None:
            raise UsageError(f"--units {said}: {word!r} is no range; give it as 2g or 250dps.")
        given["g" if match[2] == "g" else "deg/s"] = float(match[1])
    parts = [
        _sensitivity(chip, ranges, given.pop(unit, None), unit)
        for ranges, unit in ((chip.force, "g"), (chip.rate, "deg/s"))
        if ranges
    ]
    if given:
        raise UsageError(
            f"--units {said}: the {chip.title} has no {'accelerometer' if 'g' in given else 'gyro'}."
        )
    return ",".join(parts)


def _sensitivity(chip: Chip, ranges: _Ranges, full: float | None, unit: str) -> str:
    listed = ", ".join(f"{each:g}{'g' if unit == 'g' else 'dps'}" for each in ranges)
    if full is None and len(ranges) > 1:
        raise UsageError(
            f"--units {chip.title}: the range that it was set to is missing; give one of {listed}. The driver's "
            "initialisation states it."
        )
    full = next(iter(ranges)) if full is None else full
    if full not in ranges:
        raise UsageError(f"--units {chip.title}: it has no range of {full:g} {unit}; it has {listed}.")
    return f"{ranges[full]:.8g} LSB/{unit if unit == 'g' else f'({unit})'}"


_KINDS = (
    "specific force",
    "angular rate",
    "magnetic field",
    "time",
    "velocity increment",
    "angle increment",
    "temperature",
)


@dataclass(frozen=True, slots=True)
class DeclaredUnits:
    """Units by quantity, None where nothing was declared."""

    specific_force: str | None = None
    angular_rate: str | None = None
    magnetic_field: str | None = None
    time: str | None = None
    velocity_increment: str | None = None
    angle_increment: str | None = None
    temperature: str | None = None


def read_units_option(option: str | Sequence[str] | None) -> DeclaredUnits:
    """Return the units that an option such as ``g,deg/s,ms``, ``counts``, ``m/s,rad`` or ``degF`` declares.

    A chip and its ranges, as ``mpu6050,2g,250dps``, are the units of its counts.

    The words may stand in any order, for each says what it is a unit of; ``counts`` (or ``si``) alone stands for every
    triad, as the first word for the accelerometer, as the second for the gyro and as the third for the magnetometer.
    ``G`` and ``mG`` are the accelerometer's g too, and the magnetometer's gauss only after a unit of the accelerometer.

    Raises
    ------
    UsageError
        If a word is not a known unit, two words are units of the same quantity, or a chip has no such range.
    """
    if option is None:
        return DeclaredUnits()
    words = with_chip([w.strip() for w in (option.split(",") if isinstance(option, str) else option)])
    declared = DeclaredUnits()
    for position, word in enumerate(words):
        if not word:
            continue
        kinds = [k for k in _KINDS if find_unit(k, word)]
        if not kinds:
            known = "; ".join(f"{k}: {', '.join(known_units(k))}" for k in _KINDS)
            raise UsageError(
                f"--units: {word!r} is neither a known unit nor a known chip. The known units are {known}."
            )
        if len(kinds) > 1:
            kinds = _meant(word, kinds, position, declared, alone=len([w for w in words if w]) == 1)
        for kind in kinds:
            field = kind.replace(" ", "_")
            if getattr(declared, field) is not None:
                raise UsageError(f"--units gives two units of {kind}.")
            declared = replace(declared, **{field: find_unit(kind, word)})
    if declared.specific_force and declared.velocity_increment:
        raise UsageError(
            "--units declares the accelerometer both as specific force and as velocity increments."
        )
    if declared.angular_rate and declared.angle_increment:
        raise UsageError("--units declares the gyro both as angular rate and as angle increments.")
    return declared


def _meant(word: str, kinds: list[str], position: int, declared: DeclaredUnits, *, alone: bool) -> list[str]:
    """Return which of several quantities a word is the unit of: counts and si are of every triad, G is gauss too."""
    if find_unit("angular rate", word):
        return kinds if alone else [kinds[min(position, len(kinds) - 1)]]
    has_force = declared.specific_force is not None or declared.velocity_increment is not None
    return [kinds[-1] if has_force and word.endswith("G") else kinds[0]]
