"""What the user declares of units with `--units`, by name or by chip.

``chips.yaml`` has the sensitivities of common chips by their measuring range.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from tumble.errors import UsageError
from tumble.files import read_yaml
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


def _counts(sheet: dict[str, Any], triad: str) -> _Ranges:
    """Counts by unit; ST states thousandths of it by count."""
    milli: _Ranges = sheet.get(f"{triad}_milli", {})
    return sheet.get(triad) or {full: 1000.0 / one for full, one in milli.items()}


@cache
def chips() -> dict[str, Chip]:
    """Return the known chips by name, in small letters without separators."""
    sheets = read_yaml(Path(__file__).with_name("chips.yaml"))
    return {name: Chip(s["title"], _counts(s, "force"), _counts(s, "rate")) for name, s in sheets.items()}


_KINDS = (
    "specific force",
    "angular rate",
    "magnetic field",
    "time",
    "velocity increment",
    "angle increment",
    "temperature",
)
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
    if not words or any(find_unit(kind, words[0]) for kind in _KINDS):
        return words  # without a look at the chips
    chip = chips().get(re.sub(r"[^a-z0-9]", "", words[0].lower()))
    if chip is None:
        return words
    given: dict[str, float] = {}
    others: list[str] = []
    for word in words[1:]:
        match = _RANGE.fullmatch(word.lower())
        if match is not None:
            given["g" if match[2] == "g" else "deg/s"] = float(match[1])
        elif word[:1] in "0123456789±+-":
            raise UsageError(f"--units {words[0]}: {word!r} is no range; give it as 2g or 250dps.")
        else:
            others.append(word)
    parts = [
        _sensitivity(chip, ranges, given.pop(unit, None), unit)
        for ranges, unit in ((chip.force, "g"), (chip.rate, "deg/s"))
        if ranges
    ]
    if given:
        lacking = "accelerometer" if "g" in given else "gyro"
        raise UsageError(f"--units {words[0]}: the {chip.title} has no {lacking}.")
    return [*parts, *others]


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
