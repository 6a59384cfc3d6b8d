"""Units of noise coefficients as data sheets and configuration files write them, and what each means in SI.

A coefficient has a letter of IEEE Std 952, a quantity (of a gyro or an accelerometer) and a unit. Units
that say the same about the same coefficient are converted by a factor. All are taken as IEEE Std 952 has them,
densities two-sided: a sheet's noise density is often one-sided, √2 times as large.
"""

from __future__ import annotations

from math import sqrt

from tumble.errors import UsageError
from tumble.records import dataclass
from tumble.units import DEGREE, STANDARD_GRAVITY

_MILLI, _MICRO = STANDARD_GRAVITY * 1e-3, STANDARD_GRAVITY * 1e-6
_ROOT_HOUR = 60.0  # √s in √h

GYRO, ACCELEROMETER = "angular rate", "specific force"


@dataclass(frozen=True, slots=True)
class NoiseUnit:
    """A unit that some coefficients of noise are stated in.

    Attributes
    ----------
    name : as written by tumble.
    quantity : "angular rate" or "specific force".
    letters : of the coefficients that have such a unit, the likeliest first.
    factor : SI per unit.
    """

    name: str
    quantity: str
    letters: str
    factor: float

    @property
    def sign(self) -> str:
        """The unit as it is printed: ``deg/rth`` is °/√h."""
        text = {"arcsec": "″"}.get(self.name, self.name)
        for old, new in (("rt", "√"), ("deg", "°"), ("^2", "²"), ("^3", "³"), ("*", "·")):
            text = text.replace(old, new)
        return "µ" + text[1:] if text.startswith("u") else text


def _units() -> dict[str, NoiseUnit]:
    rates = {"rad/s": 1.0, "deg/s": DEGREE, "mdeg/s": 1e-3 * DEGREE, "deg/h": DEGREE / 3600.0}
    forces = {"m/s^2": 1.0, "g": STANDARD_GRAVITY, "mg": _MILLI, "ug": _MICRO, "mGal": 1e-5}
    angles = {"rad": 1.0, "urad": 1e-6, "deg": DEGREE, "arcsec": DEGREE / 3600.0}
    speeds = {"m/s": 1.0, "mm/s": 1e-3, "ug*s": _MICRO, "mg*s": _MILLI}
    found: list[NoiseUnit] = []
    for quantity, values, integrals in ((GYRO, rates, angles), (ACCELEROMETER, forces, speeds)):
        for name, factor in values.items():
            found.append(NoiseUnit(name, quantity, "B", factor))
            found.append(NoiseUnit(f"{name}/rtHz", quantity, "N", factor))
            found.append(NoiseUnit(f"{name}/rts", quantity, "K", factor))
            found.append(NoiseUnit(f"{name}*rtHz", quantity, "K", factor))
            found.append(NoiseUnit(f"{name}/rth", quantity, "K", factor / _ROOT_HOUR))
            found.append(NoiseUnit(f"{name}/s", quantity, "R", factor))
            found.append(NoiseUnit(f"{name}/h", quantity, "R", factor / 3600.0))
        for name, factor in integrals.items():
            found.append(NoiseUnit(name, quantity, "Q", factor))
            found.append(NoiseUnit(f"{name}/rts", quantity, "N", factor))
            found.append(NoiseUnit(f"{name}/rth", quantity, "N", factor / _ROOT_HOUR))
    # rad/s²/√Hz, as Kalibr writes K, and the same of a specific force
    found.append(NoiseUnit("rad/s^2/rtHz", GYRO, "K", 1.0))
    found.append(NoiseUnit("m/s^3/rtHz", ACCELEROMETER, "K", 1.0))
    return {_plain(unit.name): unit for unit in found}


def _plain(name: str) -> str:
    """The name as it is compared: one way to write roots, powers, degrees and products."""
    text = name.strip().lower()
    for old, new in (
        ("√", "rt"),
        ("sqrt", "rt"),
        ("root", "rt"),
        ("²", "^2"),
        ("³", "^3"),
        ("°", "deg"),
        ("µ", "u"),
        ("μ", "u"),
        ("micro", "u"),
        ("·", "*"),
        ("dps", "deg/s"),
        ("hour", "h"),
        ("hr", "h"),
        ("s2", "s^2"),
        ("s3", "s^3"),
        ("(", ""),
        (")", ""),
    ):
        text = text.replace(old, new)
    return "".join(text.split())


_INDEX = _units()


def find_noise_unit(name: str) -> NoiseUnit | None:
    """Return the unit of a noise coefficient by any of its spellings, or None.

    ``deg/√h``, ``deg/sqrt(h)``, ``deg/rtHr`` and ``°/√hr`` are one unit, so are ``µg/√Hz`` and ``ug/rtHz``.

    Parameters
    ----------
    name : of the unit.
    """
    return _INDEX.get(_plain(name))


_SI = {
    GYRO: {"Q": "rad", "N": "rad/s/rtHz", "B": "rad/s", "K": "rad/s/rts", "R": "rad/s/s"},
    ACCELEROMETER: {"Q": "m/s", "N": "m/s^2/rtHz", "B": "m/s^2", "K": "m/s^2/rts", "R": "m/s^2/s"},
}
# Per hour and per second both are known units of rate; a walk's root of time goes with them.
_PRACTICAL = {
    GYRO: {"Q": "arcsec", "N": "deg/rth", "B": "deg/h", "K": "deg/h/rth", "R": "deg/h/h"},
    ACCELEROMETER: {"Q": "mm/s", "N": "ug/rtHz", "B": "ug", "K": "ug/rth", "R": "ug/h"},
}


def si_noise_unit(quantity: str, letter: str) -> NoiseUnit:
    """Return the SI unit of a coefficient.

    Parameters
    ----------
    quantity : "angular rate" or "specific force".
    letter : of IEEE Std 952.
    """
    return _found(_SI[quantity][letter])


def practical_noise_unit(quantity: str, letter: str) -> NoiseUnit:
    """Return the unit in which people state a coefficient.

    Parameters
    ----------
    quantity : "angular rate" or "specific force".
    letter : of IEEE Std 952.
    """
    return _found(_PRACTICAL[quantity][letter])


def known_noise_units(quantity: str, letter: str) -> tuple[NoiseUnit, ...]:
    """Return the units that a coefficient may be stated in.

    Parameters
    ----------
    quantity : "angular rate" or "specific force".
    letter : of IEEE Std 952.
    """
    return tuple(u for u in _INDEX.values() if u.quantity == quantity and letter in u.letters)


def coefficient_in(value: float, unit: str, other: str) -> float:
    """Return a coefficient in another unit of the same coefficient.

    Parameters
    ----------
    value : in `unit`.
    unit, other : names of units.

    Raises
    ------
    UsageError
        If a unit is not known, or the two are of different coefficients.

    Examples
    --------
    >>> round(coefficient_in(0.15, "deg/√h", "deg/s/√Hz"), 12)
    0.0025
    """
    first, second = _found(unit), _found(other)
    if (first.quantity, first.letters) != (second.quantity, second.letters):
        raise UsageError(
            f"{first.name} is a unit of {_WORDS[first.letters]} of {first.quantity}, {second.name} of "
            f"{_WORDS[second.letters]} of {second.quantity}: one does not follow from the other."
        )
    return value * first.factor / second.factor


_WORDS = {
    "Q": "quantisation (Q)",
    "N": "white noise (N)",
    "B": "bias instability (B)",
    "K": "rate random walk (K)",
    "R": "ramp (R)",
}


def _found(name: str) -> NoiseUnit:
    unit = find_noise_unit(name)
    if unit is None:
        raise UsageError(
            f"{name!r} is not a unit of a noise coefficient: such are deg/√h, deg/h, deg/s/√Hz, mg, µg/√Hz, m/s/√h."
        )
    return unit


def sample_sigma(random_walk: float, rate: float) -> float:
    """Return the standard deviation of a sample, from N by white noise up to half the rate: N √rate."""
    return random_walk * sqrt(rate)


def random_walk_of(sigma: float, rate: float) -> float:
    """Return N from the standard deviation of a sample whose noise is white up to half the rate."""
    return sigma / sqrt(rate)


__all__ = [
    "ACCELEROMETER",
    "GYRO",
    "NoiseUnit",
    "coefficient_in",
    "find_noise_unit",
    "known_noise_units",
    "practical_noise_unit",
    "random_walk_of",
    "sample_sigma",
    "si_noise_unit",
]
