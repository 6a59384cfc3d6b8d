"""``limits.yaml``: a decision rule, and limits of parameters or of groups of them.

A key is a parameter as the calibration's table names it (``gyro bias x``) or a group (``gyro bias``); a parameter's
own entry goes before its group's. Every number has its unit.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

from tumble.document.limits_block import Rule
from tumble.errors import UsageError
from tumble.files import number_of, opened, read_yaml, reading
from tumble.parameters.family import FAMILIES, is_known, parameter_of
from tumble.records import dataclass
from tumble.simulation import TriadGrade, find_grade
from tumble.units import RATIOS, unit_factor

KEYS = ("name", "rule", "risk", "limits")
_ENTRY = ("within", "from", "to", "nominal", "data sheet", "sigmas", "largest uncertainty")
SIGMAS = 3.0
"""Of a data sheet's spread, where the file does not say how many: a sheet's tolerance is three of them."""
_AMOUNT = re.compile(r"\s*([-+−]?[\d.]+(?:[eE][-+]?\d+)?)\s*(.*?)\s*$")
_SHEET: dict[str, Callable[[TriadGrade], float]] = {
    "bias": lambda triad: triad.bias,
    "scale factor error": lambda triad: triad.scale_factor,
    # Between two axes, each of which leans by itself.
    "non-orthogonality": lambda triad: math.sqrt(2.0) * triad.misalignment,
    "misalignment": lambda triad: triad.misalignment,
}


@dataclass(frozen=True, slots=True)
class Amount:
    """A number with its unit as the file has them."""

    number: float
    unit: str

    def __str__(self) -> str:
        return f"{self.number:g} {self.unit}".strip()

    def in_unit(self, unit: str) -> float | None:
        """Return the number in a parameter's unit, None where it cannot be told.

        Parameters
        ----------
        unit : as a calibration's parameters have it.
        """
        own, other = unit_factor(self.unit), unit_factor(unit)
        if own is not None and other is not None and own[0] == other[0]:
            return self.number * own[1] / other[1]
        return self.number if self.unit == unit else None


@dataclass(frozen=True, slots=True)
class Limit:
    """The limits of a parameter or group; a side that is None is free.

    `nominal` : what `within` is about, zero where it is None. `within` in a ratio's unit is of the nominal value
    where that has another unit.
    """

    name: str
    lower: Amount | None = None
    upper: Amount | None = None
    nominal: Amount | None = None
    within: Amount | None = None
    largest_uncertainty: Amount | None = None

    def interval(self, unit: str) -> tuple[float, float, float] | None:
        """Return lower and upper limit and the largest expanded uncertainty; None where the units do not match.

        Parameters
        ----------
        unit : of the parameter.
        """
        largest = math.inf if self.largest_uncertainty is None else self.largest_uncertainty.in_unit(unit)
        if largest is None:
            return None
        if self.within is not None:
            middle = 0.0 if self.nominal is None else self.nominal.in_unit(unit)
            half = self.within.in_unit(unit)
            if half is None and middle and self.within.unit in RATIOS:  # of nothing it is no share
                half = abs(middle) * self.within.number * RATIOS[self.within.unit]
            return None if middle is None or half is None else (middle - half, middle + half, largest)
        lower = -math.inf if self.lower is None else self.lower.in_unit(unit)
        upper = math.inf if self.upper is None else self.upper.in_unit(unit)
        return None if lower is None or upper is None else (lower, upper, largest)


@dataclass(frozen=True, slots=True)
class Limits:
    """A file of limits: its rule, and the limits by name."""

    name: str
    sha256: str
    rule: Rule
    risk: float | None
    limits: tuple[Limit, ...]

    def limit_of(self, parameter: str) -> Limit | None:
        """Return the limit that holds for a parameter: its own, or that of the narrowest group with it.

        Parameters
        ----------
        parameter : as a calibration names it.
        """
        found = [one for one in self.limits if covers(one.name, parameter)]
        return max(found, key=lambda one: len(one.name), default=None)


def covers(name: str, parameter: str) -> bool:
    """Return whether a limit's name is a parameter, or the group that it is of.

    Parameters
    ----------
    name, parameter : of the limit and of the parameter.
    """
    return name in (parameter, parameter_of(parameter).family.name)


def read_limits(path: Path) -> Limits:
    """Read a file of limits.

    Parameters
    ----------
    path : of the YAML file.

    Raises
    ------
    UsageError
        If it cannot be read, or says something that is no limit; the sentence names the entry.
    """
    with reading(path, "a file of limits", hint="see docs/production.md for what it says"):
        document = read_yaml(path)
        with opened(path) as file:
            digest = hashlib.sha256(file.read()).hexdigest()
    if not isinstance(document, dict):
        raise UsageError(f"{path} holds no limits: it needs `limits:` with a parameter or group a line.")
    try:
        return _limits(cast("dict[Any, Any]", document), path, digest)
    except _LimitError as error:
        raise UsageError(f"{path}: {error}.") from None


class _LimitError(ValueError):
    """What is wrong with an entry; its words end a sentence."""


def _limits(document: dict[Any, Any], path: Path, digest: str) -> Limits:
    for key in document:
        if key not in KEYS:
            raise _LimitError(f"{key!r:.60} is no entry of limits; there are {', '.join(KEYS)}")
    rule = document.get("rule", "simple")
    if rule not in ("simple", "guarded", "risk"):
        raise _LimitError(f"the rule {rule!r:.60} is none of simple, guarded, risk")
    risk = None
    if rule == "risk":
        if "risk" not in document:
            raise _LimitError("`rule: risk` needs `risk:` with a probability, such as 2.5 %")
        risk = _amount(document.get("risk"), "risk")
        share = RATIOS.get(risk.unit)
        if share is None or not 0.0 < risk.number * share < 0.5:
            raise _LimitError(f"the risk {risk} is no share between 0 and 50 %")
        risk = risk.number * share
    elif "risk" in document:
        raise _LimitError(f"a risk goes with `rule: risk`, and the rule is {rule}")
    entries = document.get("limits")
    if not isinstance(entries, dict) or not entries:
        raise _LimitError("`limits:` has no parameter or group under it")
    found = tuple(_limit(key, entry) for key, entry in cast("dict[Any, Any]", entries).items())
    return Limits(str(document.get("name", path.stem)), digest, rule, risk, found)


def _limit(key: Any, entry: Any) -> Limit:
    name = " ".join(str(key).replace("gyroscope", "gyro").replace("quadratic term", "quadratic").split())
    if name not in FAMILIES and not is_known(name):
        raise _LimitError(
            f"{name!r:.60} is no parameter and no group; groups are accelerometer and gyro bias, scale factor error, "
            "scale factor, non-orthogonality, misalignment; rotation between the triads; gyro g-sensitivity"
        )
    if not isinstance(entry, dict):
        return Limit(name, within=_positive(_amount(entry, name), name))
    said = {str(word).replace("_", " "): value for word, value in cast("dict[Any, Any]", entry).items()}
    for word in said:
        if word not in _ENTRY:
            raise _LimitError(f"{name}: {word!r:.60} is none of {', '.join(_ENTRY)}")
    largest = said.get("largest uncertainty")
    amount = None if largest is None else _positive(_amount(largest, name), name)
    nominal = _amount(said["nominal"], name) if "nominal" in said else None
    if "data sheet" in said:
        return Limit(name, nominal=nominal, within=_of_sheet(name, said), largest_uncertainty=amount)
    if "within" in said:
        if "from" in said or "to" in said:
            raise _LimitError(f"{name}: it has `within` and `from` or `to`: leave one of them out")
        within = _positive(_amount(said["within"], name), name)
        return Limit(name, nominal=nominal, within=within, largest_uncertainty=amount)
    if nominal is not None or not ({"from", "to"} & set(said) or amount is not None):
        raise _LimitError(f"{name}: it needs `within`, or `from` and `to`, or `data sheet`")
    sides = [_amount(said[word], name) if word in said else None for word in ("from", "to")]
    _check_order(name, *sides)
    return Limit(name, *sides, largest_uncertainty=amount)


def _check_order(name: str, lower: Amount | None, upper: Amount | None) -> None:
    if lower is None or upper is None:
        return
    top = upper.in_unit(lower.unit)
    if top is None:
        raise _LimitError(f"{name}: {lower} and {upper} are not of one kind")
    if not lower.number < top:
        raise _LimitError(f"{name}: it is from {lower} to {upper}, which leaves nothing between")


def _of_sheet(name: str, said: dict[str, Any]) -> Amount:
    family = FAMILIES.get(name) or parameter_of(name).family
    if family.triad not in ("accelerometer", "gyro") or family.kind not in _SHEET:
        raise _LimitError(f"{name}: a data sheet says nothing of {family.kind}: give `within`")
    try:
        grade = find_grade(str(said["data sheet"]))
    except UsageError as error:
        raise _LimitError(f"{name}: {str(error).rstrip('.')}") from None
    sheet = grade.accelerometer if family.triad == "accelerometer" else grade.gyroscope
    sigmas = _number(said.get("sigmas", SIGMAS))
    if sigmas is None or not sigmas > 0.0:
        raise _LimitError(f"{name}: sigmas {said['sigmas']!r:.40} is no positive number")
    unit = family.unit.format(raw="m/s^2" if family.triad == "accelerometer" else "rad/s")
    return Amount(sigmas * _SHEET[family.kind](sheet), unit)


def _number(value: Any) -> float | None:
    try:
        return number_of(value)
    except ValueError:
        return None


def _amount(text: Any, name: str) -> Amount:
    match = _AMOUNT.match(str(text))
    number = None if match is None else _number(match[1].replace("−", "-"))
    if match is None or number is None:
        raise _LimitError(f"{name}: {text!r:.60} is no number with a unit, such as 50 mg")
    unit = match[2]
    if unit not in RATIOS and unit_factor(unit) is None and "count" not in unit and "/" not in unit:
        raise _LimitError(
            f"{name}: {unit!r:.40} is no unit of a parameter (mg, m/s^2, deg/s, deg/h, rad/s, %, ppm, mrad, deg, ms)"
        )
    return Amount(number, unit)


def _positive(amount: Amount, name: str) -> Amount:
    if not amount.number > 0.0:
        raise _LimitError(f"{name}: {amount} leaves nothing within: give a positive number")
    return amount
