"""Names of units and their factors to SI: the only place that knows units other than SI.

A factor multiplies a number in the unit to give SI: ``x_si = factor * x``. The unit "counts" (raw
converter output) is known and has no factor. Names are compared without regard to case, spaces,
``²`` against ``^2``, ``°`` against ``deg`` or ``µ`` against ``u``. A converter's sensitivity is a unit, too:
``16384 LSB/g`` is the 16384th part of g, and ``131 LSB/(deg/s)`` the 131st part of a degree per second.

References
----------
BIPM, *The International System of Units (SI Brochure)*, 9th edition, 2019. Standard acceleration of
gravity: 3rd CGPM (1901), exact. Degree, minute and hour: table 8. Gal: section 4 of the 8th edition.
"""

from __future__ import annotations

import re
from math import isfinite, pi

from tumble.errors import UsageError

STANDARD_GRAVITY = 9.80665
"""Standard acceleration of gravity g_n, m/s², exact by definition (3rd CGPM, 1901)."""

COUNTS = "counts"
"""Name of the unit of raw converter output, which has no factor."""
LSB = " LSB/"
"""In the name of a sensitivity, such as ``16384 LSB/g``."""

_HOUR = 3600.0  # SI Brochure, table 8
DEGREE = pi / 180.0  # SI Brochure, table 8
ARCSECOND = DEGREE_PER_HOUR = DEGREE / _HOUR
DEGREE_PER_ROOT_HOUR = DEGREE / 60.0
MILLI_G, MICRO_G, MICROTESLA = 1e-3 * STANDARD_GRAVITY, 1e-6 * STANDARD_GRAVITY, 1e-6
_TURN = 2.0 * pi

# name -> (factor to SI, other spellings, with neither capitals nor spaces)
_Table = dict[str, tuple[float | None, str]]

_COUNTS: tuple[float | None, str] = (None, "count raw lsb adc digits ticks")

_SPECIFIC_FORCE: _Table = {
    "m/s^2": (1.0, "m/s2 m/s/s ms^-2 ms-2 m*s^-2 m.s^-2 mps2 m_s2 m_s^2 si"),
    "g": (STANDARD_GRAVITY, "g_n gn g0 gee gees gs g-force"),
    "mg": (STANDARD_GRAVITY * 1e-3, "milli-g millig m-g mgee"),
    "ug": (STANDARD_GRAVITY * 1e-6, "micro-g microg"),
    # 1 Gal = 1 cm/s² exactly.
    "cm/s^2": (1e-2, "cm/s2 gal gals cms^-2 cm/s/s"),
    "mm/s^2": (1e-3, "mm/s2 mms^-2 mm/s/s"),
    "ft/s^2": (0.3048, "ft/s2 ft/s/s"),  # international foot, exact
    COUNTS: _COUNTS,
}

_ANGULAR_RATE: _Table = {
    "rad/s": (1.0, "rads rads^-1 rads-1 rad*s^-1 rad.s^-1 rad/sec rps rad_s radps si"),
    "mrad/s": (1e-3, "mrads^-1 mrad/sec millirad/s mrad_s"),
    "deg/s": (DEGREE, "dps deg/sec degs degs^-1 degs-1 deg.s^-1 deg_s degps degree/s degrees/s"),
    "mdeg/s": (DEGREE * 1e-3, "mdps milli-deg/s mdeg/sec mdegs^-1 mdeg_s"),
    "deg/h": (DEGREE / _HOUR, "dph deg/hr deg/hour deg_h degree/h degrees/h"),
    "rpm": (_TURN / 60.0, "rev/min r/min 1/min"),
    COUNTS: _COUNTS,
}

# Gauss is no unit of the SI: 1 G = 1e-4 T (SI Brochure, 8th edition, table 9). "g" and "mg" are read so only where
# it is known that the number is a magnetic field: capitals are not told from small letters here.
_MAGNETIC_FIELD: _Table = {
    "T": (1.0, "tesla teslas"),
    "mT": (1e-3, "millitesla"),
    "uT": (1e-6, "microtesla microteslas"),
    "nT": (1e-9, "nanotesla nanoteslas gamma"),
    "gauss": (1e-4, "g gs ga"),
    "mgauss": (1e-7, "mg milligauss mgs mga"),
    "ugauss": (1e-10, "ug microgauss"),
    COUNTS: _COUNTS,
}

_TIME: _Table = {
    "s": (1.0, "sec secs second seconds"),
    "ms": (1e-3, "msec msecs millis millisecond milliseconds"),
    "us": (1e-6, "usec usecs micros microsecond microseconds"),
    "ns": (1e-9, "nsec nsecs nanos nanosecond nanoseconds"),
    "min": (60.0, "minute minutes"),
    "h": (_HOUR, "hr hour hours"),
}

# Increments over one sampling interval: velocity (of the accelerometers) and angle (of the gyros).
_VELOCITY: _Table = {
    "m/s": (1.0, "mps ms^-1 ms-1 m*s^-1"),
    "g*s": (STANDARD_GRAVITY, "g-s"),
    "cm/s": (1e-2, "cms^-1"),
    "mm/s": (1e-3, "mms^-1"),
}

_ANGLE: _Table = {
    "rad": (1.0, "radian radians"),
    "mrad": (1e-3, "millirad milliradian"),
    "urad": (1e-6, "microrad microradian"),
    "deg": (DEGREE, "degree degrees"),
    "arcmin": (DEGREE / 60.0, "arcminute arcminutes"),
    "arcsec": (DEGREE / 3600.0, 'as " arcsecond arcseconds'),
}

# Factor to K of a difference; where zero is, `_ZERO_CELSIUS` says.
_TEMPERATURE: _Table = {
    "degC": (1.0, "c celsius degc degreecelsius degreescelsius ℃"),
    "K": (1.0, "kelvin kelvins degk"),
    "degF": (5.0 / 9.0, "f fahrenheit degf degreefahrenheit degreesfahrenheit ℉"),
}
_ZERO_CELSIUS = {"degC": 0.0, "K": -273.15, "degF": -160.0 / 9.0}  # °C; SI Brochure, 2.3.1

_KINDS: dict[str, _Table] = {
    "specific force": _SPECIFIC_FORCE,
    "angular rate": _ANGULAR_RATE,
    "magnetic field": _MAGNETIC_FIELD,
    "time": _TIME,
    "velocity increment": _VELOCITY,
    "angle increment": _ANGLE,
    "temperature": _TEMPERATURE,
}


_ASCII = str.maketrans({"²": "^2", "⁻": "^-", "¹": "1", "°": "deg", "µ": "u", "μ": "u", "·": "*", "−": "-"})


def _plain(name: str) -> str:
    """Return the name as it is compared: lower case, no spaces, ASCII."""
    return "".join(name.lower().replace("**", "^").replace("⁻²", "^-2").translate(_ASCII).split())


_INDEX: dict[str, dict[str, str]] = {
    kind: {_plain(alias): name for name, (_, aliases) in table.items() for alias in (name, *aliases.split())}
    for kind, table in _KINDS.items()
}


def find_unit(kind: str, name: str) -> str | None:
    """Return tumble's name of a unit, or None if the name is not one of that kind.

    Parameters
    ----------
    kind : "specific force", "angular rate", "magnetic field", "time", "velocity increment", "angle increment" or
        "temperature".
    name : the unit as the user or a file's header spells it.
    """
    plain = _plain(name)
    return _INDEX[kind].get(plain) or _sensitivity(kind, plain)


# Counts by unit, as data sheets state a converter's sensitivity.
_SENSITIVITY = re.compile(r"([0-9]+(?:\.[0-9]+)?|\.[0-9]+)(?:lsbs?|counts?|digits?)(?:/|per)\(?([^()]+)\)?")
_PER = {"specific force": "g", "angular rate": "deg/s"}


def _sensitivity(kind: str, plain: str) -> str | None:
    """Return the name of a sensitivity such as ``16384 LSB/g`` or ``131 LSB/(deg/s)``; None of anything else."""
    match = _SENSITIVITY.fullmatch(plain) if kind in _PER else None
    if match is None:
        return None
    counts, unit = float(match[1]), _INDEX[kind].get(match[2])
    if unit != _PER[kind] or not (isfinite(counts) and 1e-3 < counts < 1e9):
        return None
    return f"{counts:.10g}{LSB}{'g' if kind == 'specific force' else '(deg/s)'}"


def known_units(kind: str) -> tuple[str, ...]:
    """Return tumble's names of the units of a kind (see `find_unit`)."""
    return tuple(_KINDS[kind])


def _factor(kind: str, name: str) -> float | None:
    found = find_unit(kind, name)
    if found is None:
        known = ", ".join(known_units(kind))
        raise UsageError(f"{name!r} is not a known unit of {kind}; known are {known}.")
    if found not in _KINDS[kind]:
        return (_KINDS[kind][_PER[kind]][0] or 1.0) / float(found.partition(" ")[0])
    return _KINDS[kind][found][0]


def specific_force_factor(unit: str) -> float | None:
    """Return the factor from a unit of specific force to m/s², or None for counts.

    Raises
    ------
    UsageError
        If the unit is not known; the message lists those that are.

    Examples
    --------
    >>> specific_force_factor("mg")
    0.00980665
    """
    return _factor("specific force", unit)


def angular_rate_factor(unit: str) -> float | None:
    """Return the factor from a unit of angular rate to rad/s, or None for counts.

    Raises
    ------
    UsageError
        If the unit is not known; the message lists those that are.
    """
    return _factor("angular rate", unit)


def magnetic_field_factor(unit: str) -> float | None:
    """Return the factor from a unit of magnetic field (flux density) to tesla, or None for counts.

    Raises
    ------
    UsageError
        If the unit is not known; the message lists those that are.

    Examples
    --------
    >>> magnetic_field_factor("µT"), magnetic_field_factor("Gauss")
    (1e-06, 0.0001)
    """
    return _factor("magnetic field", unit)


def time_factor(unit: str) -> float:
    """Return the factor from a unit of time to seconds.

    Raises
    ------
    UsageError
        If the unit is not known; the message lists those that are.
    """
    factor = _factor("time", unit)
    assert factor is not None  # every unit of time has one
    return factor


def velocity_increment_factor(unit: str) -> float:
    """Return the factor from a unit of velocity increment to m/s.

    Raises
    ------
    UsageError
        If the unit is not known; the message lists those that are.
    """
    factor = _factor("velocity increment", unit)
    assert factor is not None
    return factor


def angle_increment_factor(unit: str) -> float:
    """Return the factor from a unit of angle increment to rad.

    Raises
    ------
    UsageError
        If the unit is not known; the message lists those that are.
    """
    factor = _factor("angle increment", unit)
    assert factor is not None
    return factor


def celsius_from(unit: str) -> tuple[float, float]:
    """Return (factor, offset) with ``celsius = factor * number + offset`` for a unit of temperature.

    Raises
    ------
    UsageError
        If the unit is not known; the message lists those that are.
    """
    factor = _factor("temperature", unit)
    assert factor is not None  # no unit of temperature is counts
    return factor, _ZERO_CELSIUS[find_unit("temperature", unit) or "degC"]


_RATIOS = {"": 1.0, "1": 1.0, "%": 1e-2, "ppm": 1e-6}


def unit_factor(unit: str) -> tuple[str, float] | None:
    """Return the kind of a unit with its factor to SI; None for counts and what nobody knows.

    Parameters
    ----------
    unit : of any kind; what "g" and "mg" are of is specific force.

    Examples
    --------
    >>> unit_factor("ppm"), unit_factor("deg")
    (('ratio', 1e-06), ('angle increment', 0.017453292519943295))
    """
    if unit in _RATIOS:
        return "ratio", _RATIOS[unit]
    kind = next((kind for kind in _KINDS if find_unit(kind, unit) is not None), None)
    factor = None if kind is None else _factor(kind, unit)
    return None if kind is None or factor is None else (kind, factor)
