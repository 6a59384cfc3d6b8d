"""The keys of a protocol file: what each means, its unit, what holds without it, as ``keys.yaml`` has them.

The reader takes from here which keys there are and what they may be, the writer which it writes, the schema and the
documentation what they are.

Numbers stand there as text in a field's unit, without loss: what is written in degrees comes back in radians to the
bit. A text of up to 17 significant digits means the 64-bit number nearest to it, times the factor of its unit: what
``0.5 * pi / 180`` is in a program, ``0.5`` is in a file. One value in eleven has no such text, because the product
skips it; then the text has more digits, and the product is rounded once, at its end.
"""

from __future__ import annotations

import math
import re
from dataclasses import field, replace
from decimal import Context, Decimal
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

from tumble.files import read_yaml
from tumble.protocol.steps import ASSUMED_RATE, HoldStep, RampStep, SoakStep, SpinStep, TurnStep
from tumble.records import dataclass
from tumble.units import DEGREE

FORMAT, VERSION = "tumble protocol", 1
REVOLUTION = 2.0 * math.pi
PPM = 1e-6
_FACTORS = {"°": DEGREE, "°/s": DEGREE, "turns": REVOLUTION, "″": DEGREE / 3600.0, "ppm of it": PPM}

# Enough for any 64-bit number; more digits are meant.
_FLOAT_DIGITS = 17
# A longer text is no number that anyone meant digit by digit, and exact arithmetic would take its time.
_LONGEST = 60

STEPS: dict[str, type[Any]] = {
    "hold": HoldStep,
    "turn": TurnStep,
    "spin": SpinStep,
    "soak": SoakStep,
    "ramp": RampStep,
}
"""The kinds of steps, by the key that has a step's name."""


@dataclass(frozen=True)
class Key:
    """One key of a protocol file.

    Attributes
    ----------
    words : what it says, for people.
    unit : of its number; empty where it has none.
    default : what holds without it, in words; empty where it has to be there.
    schema : JSON schema of its value, which has the limits of a number.
    attribute : of the step, where the key's number alone says it.
    instead : what to write instead of a number beyond the limits.
    """

    words: str
    unit: str = ""
    default: str = ""
    schema: dict[str, Any] = field(default_factory=lambda: {"type": "string"})
    attribute: str = ""
    instead: str = ""

    @property
    def factor(self) -> float:
        """SI value of its unit."""
        return _FACTORS.get(self.unit, 1.0)


@cache
def _tables() -> dict[str, dict[str, Any]]:
    return read_yaml(Path(__file__).with_name("keys.yaml"))


@cache
def known_keys(of: str) -> dict[str, Key]:
    """Return the keys of the `protocol`, of its `site`, or of a kind of step."""
    keys = {name: Key(**said) for name, said in _tables()[of]["keys"].items()}
    assumed = ASSUMED_RATE / PPM
    return {name: replace(key, default=key.default.format(assumed=assumed)) for name, key in keys.items()}


def schema_of(of: str) -> dict[str, Any]:
    """Return the JSON schema of a mapping with those keys; what each says is its description."""
    properties: dict[str, Any] = {}
    for name, key in known_keys(of).items():
        unit = f" [{key.unit}]" if key.unit else ""
        default = f"; without it: {key.default}" if key.default else ""
        properties[name] = {**key.schema, "description": f"{key.words}{unit}{default}"}
    return {
        "type": "object",
        "properties": properties,
        "required": [],
        "additionalProperties": False,
        **_tables()[of]["rules"],
    }


def value_of(numeral: str, factor: float = 1.0) -> float:
    """Return the number that a text means, times the factor of its unit.

    Parameters
    ----------
    numeral : a decimal number, such as ``-0.5`` or ``1.5e-3``.
    factor : SI value of the text's unit; π/180 for degrees.

    Raises
    ------
    ValueError
        If the text is no number.

    Examples
    --------
    >>> value_of("250", 1e-6)
    0.00025
    """
    nearest = float(numeral)
    if _digits(numeral) <= _FLOAT_DIGITS or len(numeral) > _LONGEST or not 0.0 < abs(nearest) < float("inf"):
        return nearest * factor
    return float(Fraction(Decimal(numeral)) * Fraction(factor))


def numeral_of(value: float, factor: float = 1.0) -> str:
    """Return the shortest of the texts that mean `value`, which YAML takes for a number too.

    Parameters
    ----------
    value : SI. One that is not finite becomes a text that no reader takes for a number.
    factor : SI value of the text's unit.

    Examples
    --------
    >>> import math
    >>> numeral_of(math.pi / 2, math.pi / 180), numeral_of(1e-5)
    ('90', '1.0e-05')
    """
    value = float(value)
    if not math.isfinite(value):
        return str(value)
    for digits in (15, 16, 17):
        text = f"{value / factor:.{digits}g}"
        if value_of(text, factor) == value:
            return _with_point(text)
    exact = Fraction(value) / Fraction(factor)
    texts = [
        str(Context(prec=digits).divide(Decimal(exact.numerator), Decimal(exact.denominator)))
        for digits in (18, 19, 20, 21)
    ]
    return _with_point(next((t for t in texts if value_of(t, factor) == value), texts[-1]))


def _digits(numeral: str) -> int:
    """Return how many significant digits a text has."""
    mantissa = re.split("[eE]", numeral)[0]
    return len(re.sub(r"\D", "", mantissa).lstrip("0"))


def _with_point(text: str) -> str:
    """Return 1e-05 as 1.0e-05, which YAML 1.1 takes for a word otherwise; and keep the sign of -0."""
    if text == "-0":
        return "-0.0"
    mantissa, mark, exponent = text.partition("E" if "E" in text else "e")
    return f"{mantissa}{'' if '.' in mantissa else '.0'}e{exponent}" if mark else text
