"""Numbers as people say them: a value with its uncertainty, to matching digits, in the unit of data sheets.

Every table, sentence, page and certificate writes its numbers here. Two significant digits of the uncertainty are
given, and the value to the same decimal.

References
----------
JCGM 100:2008 (GUM), 7.2.6: a standard uncertainty is usually quoted to at most two significant digits
and the estimate to the same decimal.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from tumble.records import dataclass
from tumble.units import DEGREE, STANDARD_GRAVITY, magnetic_field_factor, unit_factor

_G = STANDARD_GRAVITY
_SAID: dict[str, tuple[tuple[float, float, str], ...]] = {
    "specific force": ((1e-3 * _G, 1e3 / _G, "mg"), (0.0, 1e6 / _G, "µg")),
    "angular rate": ((0.1 * DEGREE, 1.0 / DEGREE, "°/s"), (0.0, 3600.0 / DEGREE, "°/h")),
    "angle increment": ((1e-4, 1e3, "mrad"), (0.0, 1e6, "µrad")),
    "ratio": ((2e-3, 1e2, "%"), (0.0, 1e6, "ppm")),
    "magnetic field": ((0.0, 1e6, "µT"),),
    "time": ((1.0, 1.0, "s"), (0.0, 1e3, "ms")),
    "length": ((0.0, 1e3, "mm"),),
    "rate per force": (
        (1e-3 * DEGREE / _G, _G / DEGREE, "(°/s)/g"),
        (0.0, 3600.0 * _G / DEGREE, "(°/h)/g"),
    ),
    # Of a quadratic term, what it is off by at 1 g.
    "per force": ((1e-3 / _G, 1e3 * _G, "mg/g²"), (0.0, 1e6 * _G, "µg/g²")),
}
"""Of each kind of quantity, by the largest number of a family, SI: at least that, the factor to the unit, and the unit;
the last one takes what is left."""
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
# Beyond this many decimals, or with fewer than none, a power of ten reads better than zeros.
_MOST_DECIMALS = 6
_LARGEST_ROUNDED = 1e6
_POWERS = {f"^{n}": str(n).translate(_SUPERSCRIPTS) for n in range(2, 6)}
_SIGNS = _POWERS | {"deg": "°", "uT": "µT", "ugauss": "µgauss", "(local field)": "local field"}
_LENGTHS = {"m": 1.0, "mm": 1e-3}


@dataclass(frozen=True)
class Measure:
    """A value with its standard uncertainty in a unit; a value of nan gives the uncertainty alone."""

    value: float
    sigma: float
    unit: str

    @property
    def number(self) -> str:
        """Value and standard uncertainty, rounded by the uncertainty."""
        return with_uncertainty(self.value, self.sigma)

    @property
    def text(self) -> str:
        """Value, standard uncertainty and unit."""
        return f"{self.number}{spaced(self.unit)}"

    def interval(self, factor: float) -> str:
        """Return the interval of `factor` standard uncertainties, to the decimals of sigma, without the unit.

        Examples
        --------
        >>> Measure(1.0, 0.1, "mg").interval(2.0)
        '[0.80, 1.20]'
        """
        if not (math.isfinite(self.value) and math.isfinite(self.sigma) and self.sigma > 0):
            return ""
        exponent = _common_exponent(self.sigma)
        decimals = decimals_of(self.sigma / 10.0**exponent)
        ends = (fixed((self.value + k * self.sigma) / 10.0**exponent, decimals) for k in (-factor, factor))
        return f"[{', '.join(ends)}]{_power(exponent)}"

    def times(self, factor: float, unit: str) -> Measure:
        """Return the same in another unit."""
        return Measure(factor * self.value, abs(factor) * self.sigma, unit)


def said(measures: Sequence[Measure]) -> list[Measure]:
    """Return measures of one family in the unit in which people say them.

    Parameters
    ----------
    measures : in one unit.

    Examples
    --------
    >>> [one.text for one in said([Measure(0.0123, 4e-5, "rad/s"), Measure(0.0001, 3e-5, "rad/s")])]
    ['0.7047 ± 0.0023 °/s', '0.0057 ± 0.0017 °/s']
    """
    # Ten sigma stand for the value where there is none to show.
    sizes = (10.0 * m.sigma if math.isnan(m.value) else max(abs(m.value), m.sigma) for m in measures)
    factor, unit = said_unit(measures[0].unit, sizes)
    return [m.times(factor, unit) for m in measures]


def said_unit(unit: str, sizes: Iterable[float]) -> tuple[float, str]:
    """Return how many of the unit that people say a unit is, and that unit; 1 and the same where people say it.

    Parameters
    ----------
    unit : of numbers, as a calibration's parameters have it.
    sizes : of the numbers, without sign: the largest decides.

    Examples
    --------
    >>> said_unit("1", [0.0003, 0.0001])
    (1000000.0, 'ppm')
    """
    if unit.endswith("/(T)"):
        raw = unit.removesuffix("/(T)")
        factor = magnetic_field_factor(raw)
        return (1e-6, f"{plain_unit(raw)}/µT") if factor is None else (factor, "")
    kind, si = si_of(unit)
    largest = si * max((size for size in sizes if math.isfinite(size)), default=0.0)
    found = ((factor, word) for least, factor, word in _SAID.get(kind, ()) if largest >= least)
    factor, word = next(found, (1.0 / si, plain_unit(unit)))
    return si * factor, word


def amount(size: float, unit: str) -> str:
    """Return a size that is known roughly, to two digits in the unit that people say.

    Parameters
    ----------
    size, unit : not negative, and as a calibration's parameters have it.

    Examples
    --------
    >>> amount(0.0123, "m/s^2"), amount(2e-4, "1"), amount(3e-3, "rad")
    ('1.3 mg', '200 ppm', '3 mrad')
    """
    factor, word = said_unit(unit, [size])
    return f"{float(f'{factor * size:.2g}'):.10g}{spaced(word)}"


# Before and after a unit, of which quantity that is, what the whole is of, its power and a factor.
_COMPOUND = (
    ("", "/(m/s²)", "angular rate", "rate per force", 1, 1.0),
    ("", "/(m/s^2)", "angular rate", "rate per force", 1, 1.0),
    ("", "/g", "angular rate", "rate per force", 1, 1.0 / _G),
    ("1/(", ")", "specific force", "per force", -1, 1.0),
    ("", "/g²", "specific force", "per force", 1, 1.0 / _G**2),
)


def si_of(unit: str) -> tuple[str, float]:
    """Return the kind of a parameter's unit and its factor to SI; nothing and one of what nobody converts.

    Parameters
    ----------
    unit : as a calibration has it, or as people say it.

    Examples
    --------
    >>> si_of("1/(m/s^2)"), si_of("counts")
    (('per force', 1.0), ('', 1.0))
    """
    if unit in _LENGTHS:
        return "length", _LENGTHS[unit]
    for before, after, of, kind, power, factor in _COMPOUND:
        if unit.startswith(before) and unit.endswith(after):
            found = unit_factor(unit[len(before) : len(unit) - len(after)].strip("()"))
            if found is not None and found[0] == of:
                return kind, factor * found[1] ** power
    return unit_factor(unit) or ("", 1.0)


def plain_unit(unit: str) -> str:
    """Return a unit as people write it: m/s² for m/s^2, °/s for deg/s, µT for uT, nothing for 1."""
    for written, said in _SIGNS.items():
        unit = unit.replace(written, said)
    return "" if unit == "1" else unit


def spaced(unit: str) -> str:
    """Return a unit as it follows a number: degrees and seconds of arc without a space."""
    return unit if unit in "°″" else f" {unit}"


def decimals_of(sigma: float) -> int:
    """Return how many decimals `sigma` has when it is rounded to two significant digits.

    Negative for tens, hundreds and so on.

    Raises
    ------
    ValueError
        If sigma is not a positive finite number.

    Examples
    --------
    >>> decimals_of(0.0312), decimals_of(0.0996), decimals_of(678.0)
    (3, 2, -1)
    """
    if not (math.isfinite(sigma) and sigma > 0):
        raise ValueError(f"a standard uncertainty of {sigma} has no digits")
    decimals = 1 - math.floor(math.log10(sigma))
    # 0.0996 becomes 0.100, which has a digit more than it should: 0.10.
    return 1 - math.floor(math.log10(round(sigma, decimals)))


def fixed(value: float, decimals: int) -> str:
    """Return `value` with `decimals` decimals (negative: rounded to tens, hundreds), never "-0".

    Examples
    --------
    >>> fixed(-0.0004, 2), fixed(12345.0, -1)
    ('0.00', '12340')
    """
    text = f"{round(value, decimals):.{max(decimals, 0)}f}"
    return text[1:] if text.startswith("-") and not any(c in "123456789" for c in text) else text


def with_uncertainty(value: float, sigma: float) -> str:
    """Return "value ± sigma" with two significant digits of sigma.

    Small and large numbers get a common power of ten. Without an uncertainty the value is given to
    six digits and said to be without; without a value (nan) only the uncertainty is given.

    Examples
    --------
    >>> with_uncertainty(0.10252, 0.00097)
    '0.10252 ± 0.00097'
    >>> with_uncertainty(-1.2345e-7, 3.2e-9)
    '(-12.35 ± 0.32) × 10⁻⁸'
    """
    if not (math.isfinite(sigma) and sigma > 0):
        return f"{value:.6g} (no uncertainty)" if math.isfinite(value) else "not known"
    exponent = _common_exponent(sigma)
    scaled = sigma / 10.0**exponent
    decimals = decimals_of(scaled)
    spread = fixed(scaled, decimals)
    text = f"± {spread}" if math.isnan(value) else f"{fixed(value / 10.0**exponent, decimals)} ± {spread}"
    return f"({text}){_power(exponent)}" if exponent else text


def _power(exponent: int) -> str:
    return f" × 10{str(exponent).translate(_SUPERSCRIPTS)}" if exponent else ""


def _common_exponent(sigma: float) -> int:
    """Return the power of ten to factor out: 0 unless zeros would fill the number."""
    if decimals_of(sigma) <= _MOST_DECIMALS and sigma < _LARGEST_ROUNDED:
        return 0
    # The uncertainty's own: it then reads 0.10 to 0.99.
    return math.floor(math.log10(sigma)) + 1
