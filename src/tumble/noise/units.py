"""Units in which coefficients of noise are stated: SI, and those of data sheets.

A coefficient has a letter of IEEE Std 952 and is of a gyro or an accelerometer. Densities are two-sided, as there: a
sheet's noise density is often one-sided, √2 times as large.
"""

from __future__ import annotations

from tumble.records import dataclass
from tumble.units import DEGREE, STANDARD_GRAVITY

_MICRO = STANDARD_GRAVITY * 1e-6
_ROOT_HOUR = 60.0  # √s in √h

GYRO, ACCELEROMETER = "angular rate", "specific force"


@dataclass(frozen=True)
class NoiseUnit:
    """A unit that a coefficient of noise is stated in.

    Attributes
    ----------
    sign : as it is printed.
    factor : SI per unit.
    """

    sign: str
    factor: float = 1.0


_SI = {
    GYRO: {"Q": "rad", "N": "rad/s/√Hz", "B": "rad/s", "K": "rad/s/√s", "R": "rad/s/s"},
    ACCELEROMETER: {"Q": "m/s", "N": "m/s²/√Hz", "B": "m/s²", "K": "m/s²/√s", "R": "m/s²/s"},
}
_HOURLY = DEGREE / 3600.0
# Per hour and per second both are known units of rate; a walk's root of time goes with them.
_PRACTICAL = {
    GYRO: {
        "Q": NoiseUnit("″", _HOURLY),
        "N": NoiseUnit("°/√h", DEGREE / _ROOT_HOUR),
        "B": NoiseUnit("°/h", _HOURLY),
        "K": NoiseUnit("°/h/√h", _HOURLY / _ROOT_HOUR),
        "R": NoiseUnit("°/h/h", _HOURLY / 3600.0),
    },
    ACCELEROMETER: {
        "Q": NoiseUnit("mm/s", 1e-3),
        "N": NoiseUnit("µg/√Hz", _MICRO),
        "B": NoiseUnit("µg", _MICRO),
        "K": NoiseUnit("µg/√h", _MICRO / _ROOT_HOUR),
        "R": NoiseUnit("µg/h", _MICRO / 3600.0),
    },
}


def si_noise_unit(quantity: str, letter: str) -> NoiseUnit:
    """Return the SI unit of a coefficient.

    Parameters
    ----------
    quantity : "angular rate" or "specific force".
    letter : of IEEE Std 952.
    """
    return NoiseUnit(_SI[quantity][letter])


def practical_noise_unit(quantity: str, letter: str) -> NoiseUnit:
    """Return the unit in which people state a coefficient.

    Parameters
    ----------
    quantity : "angular rate" or "specific force".
    letter : of IEEE Std 952.
    """
    return _PRACTICAL[quantity][letter]


__all__ = ["ACCELEROMETER", "GYRO", "NoiseUnit", "practical_noise_unit", "si_noise_unit"]
