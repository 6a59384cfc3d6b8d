"""Parameters of a calibration: what each is of, what it is called, and in which unit.

A name such as ``gyro bias x`` is made of its family's record here, and found by it again: nobody else takes a name
apart. Names and units are those of ``calibration.json``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from typing import TypeVar

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


def two_digits(value: float) -> str:
    """Return a positive number to two significant digits, without an exponent.

    Examples
    --------
    >>> two_digits(193.4), two_digits(99.7), two_digits(0.1)
    ('193', '100', '0.10')
    """
    return fixed(value, decimals_of(value)) if 0.0 < value < 99.5 else f"{value:.0f}"


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


T = TypeVar("T")

ACCELEROMETER, GYRO, BETWEEN, OPTIONAL = "Accelerometer", "Gyro", "Between the triads", "Optional terms"
TEMPERATURE = "Changes with temperature"
MAGNETOMETER = "Magnetometer"
GROUPS = (ACCELEROMETER, GYRO, BETWEEN, OPTIONAL, TEMPERATURE, MAGNETOMETER)
"""Headings of tables, in their order."""
ANGLES = ("non-orthogonality", "misalignment", "rotation")
"""Kinds of parameters that are angles."""
_LEANS = tuple(a + b for a in "xyz" for b in "xyz" if a != b)


@dataclass(frozen=True)
class Family:
    """Parameters that differ by their axes alone: limits, fleets and figures take them together.

    Attributes
    ----------
    name : "gyro bias"; a parameter's is this one with its axes behind, unless `form` says otherwise.
    triad : "accelerometer", "gyro", "magnetometer"; empty between them.
    kind : "bias", "scale factor error", "scale factor" (of counts), an angle of `ANGLES`, and so on.
    group, words : the heading of tables that it stands under, and what it is called there.
    short : on a figure's axis.
    axes : of its parameters.
    unit : with ``{raw}`` for the triad's raw unit.
    form : a parameter's name, with ``{}`` for its axes.
    """

    name: str
    triad: str
    kind: str
    group: str
    words: str
    short: str
    axes: tuple[str, ...]
    unit: str
    form: str = ""

    def named(self, axes: str) -> str:
        """Return the name of the parameter of some axes."""
        return self.form.format(axes) if self.form else f"{self.name} {axes}".rstrip()

    def labels(self, raw: str = "", axes: tuple[str, ...] = ()) -> list[tuple[str, str]]:
        """Return names and units of its parameters.

        Parameters
        ----------
        raw : the triad's raw unit.
        axes : of those that are wanted, in their order; all where none is named.
        """
        unit = self.unit.format(raw=raw)
        return [(self.named(one), unit) for one in axes or self.axes]


@dataclass(frozen=True)
class Parameter:
    """One parameter: its name, its family, and its axes, such as "x", "yz" or "x to force y"; empty for none."""

    name: str
    family: Family
    axes: str

    @property
    def axis(self) -> int:
        """The number of its first axis: of the sensor that it belongs to."""
        return "xyz".index(self.axes[0])

    @property
    def label(self) -> str:
        """What it is called under its group's heading."""
        return f"{self.family.words} {self.axes.replace(' to force', ', force')}".rstrip()

    @property
    def short(self) -> str:
        """What it is called on a figure's axis."""
        return f"{self.family.short} {self.axes.replace(' to force ', '←')}".rstrip()

    @property
    def within_triad(self) -> str:
        """Its name without the triad in front."""
        return self.name.removeprefix(f"{self.family.triad} ")


# Kind, on a figure's axis, axes, unit; of accelerometers and of gyros.
_OF_TRIADS = (
    ("bias", "bias", tuple("xyz"), "{raw}"),
    ("scale factor error", "scale", tuple("xyz"), "1"),
    ("scale factor", "scale", tuple("xyz"), "{raw}/(%s)"),
    ("non-orthogonality", "angle", _LEANS, "rad"),
    ("misalignment", "misalignment", _LEANS, "rad"),
    ("asymmetry", "asymmetry", tuple("xyz"), "1"),
    ("quadratic", "quadratic", tuple("xyz"), "1/({raw})"),
)


def _of_triad(triad: str, group: str, brief: str, si: str) -> list[Family]:
    """Families that accelerometers and gyros have alike: asymmetries and quadratic terms are optional."""
    made: list[Family] = []
    for kind, short, axes, unit in _OF_TRIADS:
        name, optional = f"{triad} {kind}", kind in ("asymmetry", "quadratic")
        heading, words = (OPTIONAL, name) if optional else (group, kind)
        made.append(
            Family(name, triad, kind, heading, words, f"{brief} {short}", axes, unit.replace("%s", si))
        )
    return made


def _of_magnetometer(kind: str, short: str, axes: tuple[str, ...], unit: str, form: str = "") -> Family:
    name = form.removesuffix(" {}") or f"magnetometer {kind}"
    return Family(name, "magnetometer", kind, MAGNETOMETER, kind, short, axes, unit, form)


def _of_places(name: str, axes: tuple[str, ...]) -> Family:
    short = name.replace("accelerometer", "acc")
    return Family(name, "accelerometer", "lever arm", OPTIONAL, name, short, axes, "m")


_LAG = "lag of the accelerometer behind the gyro"
_FORCES = tuple(f"{a} to force {b}" for a in "xyz" for b in "xyz")
_SUMS = tuple(f"{pair}{sign}{pair[::-1]}" for pair in ("xy", "xz", "yz") for sign in "+-")
_TRIADS, _TURNED = "rotation between the triads", "rotation of the magnetometer"
FAMILIES = {
    family.name: family
    for family in (
        *_of_triad("accelerometer", ACCELEROMETER, "acc", "m/s²"),
        *_of_triad("gyro", GYRO, "gyro", "rad/s"),
        Family(_TRIADS, "", "rotation", BETWEEN, "rotation", "rotation", tuple("xyz"), "rad"),
        Family(
            *("gyro g-sensitivity", "gyro", "g-sensitivity", OPTIONAL, "g-sens. gyro", "g-sens."),
            *(_FORCES, "{raw}/(m/s²)", "g-sensitivity of gyro {}"),
        ),
        Family(_LAG, "", "lag", OPTIONAL, _LAG, "time lag", ("",), "s"),
        _of_places("accelerometer lever arm", tuple(a + b for a in "xyz" for b in "xyz")),
        _of_places("accelerometer lever arms", _SUMS),
        _of_magnetometer("bias", "magnetometer bias", tuple("xyz"), "{raw}"),
        _of_magnetometer("scale factor", "magnetometer scale", tuple("xyz"), "{raw}"),
        _of_magnetometer("soft iron", "magnetometer soft iron", ("yz", "xz", "xy"), "{raw}"),
        _of_magnetometer("rotation", _TURNED, tuple("xyz"), "rad", f"{_TURNED} {{}}"),
    )
}
"""All families by name but those of coefficients of temperature, which differ by what the function is of."""
LAG = FAMILIES[_LAG]


def thermal_family(triad: str, words: str, unit: str = "") -> Family:
    """Return a family of coefficients of temperature.

    Parameters
    ----------
    triad : whose they are; empty for what is no triad's.
    words : what they are of, such as "bias by dT", without "thermal" and the triad.
    unit : of the coefficients.

    Examples
    --------
    >>> thermal_family("gyro", "bias by dT", "rad/s/K").labels(axes=("x",))
    [('thermal gyro bias by dT x', 'rad/s/K')]
    """
    said = f"{triad} {words}".lstrip()
    short = plain_unit(f"thermal {said}").replace("accelerometer", "acc")
    return Family(f"thermal {said}", triad, "thermal", TEMPERATURE, plain_unit(said), short, (), unit)


@cache
def _known() -> dict[str, Parameter]:
    return {
        family.named(axes): Parameter(family.named(axes), family, axes)
        for family in FAMILIES.values()
        for axes in family.axes
    }


def is_known(name: str) -> bool:
    """Return whether a name is one of a parameter that a calibration may have, temperature apart.

    Parameters
    ----------
    name : such as "gyro bias x".
    """
    return name in _known()


@cache
def parameter_of(name: str) -> Parameter:
    """Return the parameter of a name.

    A name that no version of tumble gives is a family of its own, among the optional terms.

    Parameters
    ----------
    name : as a calibration has it.

    Examples
    --------
    >>> parameter_of("gyro bias y").family.name, parameter_of("gyro bias y").axes
    ('gyro bias', 'y')
    """
    if found := _known().get(name):
        return found
    if not name.startswith("thermal "):
        return Parameter(name, Family(name, "", "", OPTIONAL, name, name, ("",), ""), "")
    said, axes = name.removeprefix("thermal "), ""
    head, _, last = said.rpartition(" ")
    if len(last) <= 2 and set(last) <= set("xyz"):
        said, axes = head, last
    triad = next((one for one in ("accelerometer", "gyro") if said.startswith(f"{one} ")), "")
    return Parameter(name, thermal_family(triad, said.removeprefix(f"{triad} ")), axes)


def in_families(names: Sequence[str]) -> dict[str, list[int]]:
    """Return the numbers of the parameters of each family, by its name.

    Parameters
    ----------
    names : of parameters.
    """
    families: dict[str, list[int]] = {}
    for number, name in enumerate(names):
        families.setdefault(parameter_of(name).family.name, []).append(number)
    return families


def under_headings(rows: Iterable[T], key: Callable[[T], str]) -> list[tuple[str, list[T]]]:
    """Return rows of parameters under their headings, in the headings' order.

    Parameters
    ----------
    rows : in any order.
    key : gives a row's parameter by its name.
    """
    groups: dict[str, list[T]] = {}
    for row in rows:
        groups.setdefault(parameter_of(key(row)).family.group, []).append(row)
    return [(group, groups[group]) for group in GROUPS if group in groups]


def triad_labels(
    triad: str, raw: str, angles: str, axes: tuple[str, ...], *, si: bool
) -> list[tuple[str, str]]:
    """Return names and units of a triad's biases, scale factors and angles.

    Parameters
    ----------
    triad, raw : "accelerometer" or "gyro", and its raw unit.
    angles, axes : "non-orthogonality" or "misalignment", and of which axes.
    si : whether the raw unit has a factor to SI: scale factors are then errors.
    """
    scale = "scale factor error" if si else "scale factor"
    kinds = (("bias", ()), (scale, ()), (angles, axes))
    return [label for kind, own in kinds for label in FAMILIES[f"{triad} {kind}"].labels(raw, own)]


def family_of(term: str) -> Family:
    """Return the family of a block of entries that has parameters of its own.

    Parameters
    ----------
    term : such as "gyroscope.bias" or "gyroscope.g_sensitivity".
    """
    triad, _, kind = term.partition(".")
    return FAMILIES[f"{triad.replace('gyroscope', 'gyro')} {kind.replace('_', '-')}"]
