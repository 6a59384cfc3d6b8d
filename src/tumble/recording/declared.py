"""What the user declares of units: the option ``--units``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from tumble.errors import UsageError
from tumble.recording.chips import with_chip
from tumble.units import find_unit, known_units

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
