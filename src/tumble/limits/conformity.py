"""Limits of parameters or of groups of them, and a calibration held against them: each parameter, and all together.

``limits.yaml`` has a decision rule and limits. A key is a parameter as the calibration's table names it (``gyro bias
x``) or a group (``gyro bias``); a parameter's own entry goes before its group's. Every number has its unit.

Decision rules of JCGM 106:2012: whether a quantity is within its limits, known with an uncertainty only.

simple (8.2): the estimate itself decides. guarded (8.3): it has to be inside by the expanded uncertainty U = 2u to
pass, and outside by as much to fail. risk (7 and 8.3.2): the probability that the quantity conforms, from a normal
distribution about the estimate, has to be at least 1 - risk to pass, at most risk to fail. Between them nothing is
decided: measure better, or let a person decide.
"""

from __future__ import annotations

import hashlib
import math
import re
from pathlib import Path
from typing import Any, cast

from msgspec.structs import replace

from tumble.document import Calibration, Decision, LimitBlock, LimitsBlock, ParameterBlock, Rule
from tumble.errors import UsageError
from tumble.files import number_of, opened, read_yaml, reading
from tumble.parameters import FAMILIES, Measure, is_known, parameter_of, said_unit, si_of
from tumble.records import dataclass
from tumble.simulation import find_grade

KEYS = ("name", "rule", "risk", "limits")
_ENTRY = ("within", "from", "to", "nominal", "data sheet", "sigmas", "largest uncertainty")
SIGMAS = 3.0
"""Of a data sheet's spread, where the file does not say how many: a sheet's tolerance is three of them."""
_AMOUNT = re.compile(r"\s*([-+−]?[\d.]+(?:[eE][-+]?\d+)?)\s*(.*?)\s*$")
# What a data sheet says of each kind, and how many times; of a non-orthogonality two axes, each of which leans.
_SHEET = {
    "bias": ("bias", 1.0),
    "scale factor error": ("scale_factor", 1.0),
    "non-orthogonality": ("misalignment", math.sqrt(2.0)),
    "misalignment": ("misalignment", 1.0),
}


@dataclass(frozen=True)
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
        (kind, own), (other_kind, other) = si_of(self.unit), si_of(unit)
        if kind:
            return self.number * own / other if kind == other_kind else None
        return self.number if self.unit == unit else None


@dataclass(frozen=True)
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
            share = self.within.in_unit("1")
            if half is None and middle and share is not None:  # of nothing it is no share
                half = abs(middle) * share
            return None if middle is None or half is None else (middle - half, middle + half, largest)
        lower = -math.inf if self.lower is None else self.lower.in_unit(unit)
        upper = math.inf if self.upper is None else self.upper.in_unit(unit)
        return None if lower is None or upper is None else (lower, upper, largest)


@dataclass(frozen=True)
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
    if rule == "risk" and "risk" not in document:
        raise _LimitError("`rule: risk` needs `risk:` with a probability, such as 2.5 %")
    if "risk" in document:
        if rule != "risk":
            raise _LimitError(f"a risk goes with `rule: risk`, and the rule is {rule}")
        given = _amount(document["risk"], "risk")
        risk = given.in_unit("1")
        if risk is None or not 0.0 < risk < 0.5:
            raise _LimitError(f"the risk {given} is no share between 0 and 50 %")
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
    lower, upper = (_amount(said[word], name) if word in said else None for word in ("from", "to"))
    if lower is not None and upper is not None:
        _check_order(name, lower, upper)
    return Limit(name, lower, upper, largest_uncertainty=amount)


def _check_order(name: str, lower: Amount, upper: Amount) -> None:
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
    force = family.triad == "accelerometer"
    what, times = _SHEET[family.kind]
    sigmas = _positive(_amount(said.get("sigmas", SIGMAS), name), name).number
    spread: float = getattr(grade.accelerometer if force else grade.gyroscope, what)
    return Amount(sigmas * times * spread, family.unit.format(raw="m/s^2" if force else "rad/s"))


def _amount(text: Any, name: str) -> Amount:
    match = _AMOUNT.match(str(text))
    try:
        number = number_of("" if match is None else match[1].replace("−", "-"))
    except ValueError:
        raise _LimitError(f"{name}: {text!r:.60} is no number with a unit, such as 50 mg") from None
    unit = "" if match is None else match[2]
    if not si_of(unit)[0] and "count" not in unit and "/" not in unit:
        raise _LimitError(
            f"{name}: {unit!r:.40} is no unit of a parameter (mg, m/s^2, deg/s, deg/h, rad/s, %, ppm, mrad, deg, ms)"
        )
    return Amount(number, unit)


def _positive(amount: Amount, name: str) -> Amount:
    if not amount.number > 0.0:
        raise _LimitError(f"{name}: {amount} leaves nothing within: give a positive number")
    return amount


GUARD = 2.0
"""Guard band in standard uncertainties: the expanded uncertainty with k = 2 (JCGM 106, 8.3.2.2, r = 1)."""


def conformance_probability(value: float, sigma: float, lower: float, upper: float) -> float:
    """Return the probability that a quantity lies within its limits (JCGM 106, (7) with a normal distribution).

    Parameters
    ----------
    value, sigma : estimate and standard uncertainty; zero for a certain one.
    lower, upper : limits; infinite for none.

    Examples
    --------
    >>> round(conformance_probability(1.0, 0.5, -math.inf, 2.0), 4)  # Φ(2)
    0.9772
    """
    if sigma <= 0.0:
        return float(lower <= value <= upper)
    return _normal((upper - value) / sigma) - _normal((lower - value) / sigma)


def _normal(x: float) -> float:
    return 0.5 * math.erfc(-x / math.sqrt(2.0))


def decision(
    rule: Rule, value: float, sigma: float, lower: float, upper: float, risk: float | None = None
) -> Decision:
    """Return whether a quantity passes.

    Parameters
    ----------
    rule : "simple", "guarded" or "risk".
    value, sigma, lower, upper : as for `conformance_probability`.
    risk : of a wrong decision, for the rule "risk".

    Examples
    --------
    >>> decision("guarded", 1.0, 0.3, -2.0, 2.0), decision("guarded", 1.6, 0.3, -2.0, 2.0)
    ('passed', 'undecided')
    """
    inside = lower <= value <= upper
    if rule == "simple" or sigma <= 0.0:
        return "passed" if inside else "failed"
    if rule == "guarded":
        band = GUARD * sigma
        if lower + band <= value <= upper - band:
            return "passed"
        return "failed" if value < lower - band or value > upper + band else "undecided"
    assert risk is not None  # the file says it
    probability = conformance_probability(value, sigma, lower, upper)
    if probability >= 1.0 - risk:
        return "passed"
    # Within the limits a small probability is a large uncertainty: that is no unit to be failed.
    return "failed" if probability <= risk and not inside else "undecided"


def overall(decisions: list[Decision]) -> Decision:
    """Return what several decisions come to: failed by one, passed by all.

    Parameters
    ----------
    decisions : of the parameters.
    """
    if "failed" in decisions:
        return "failed"
    return "passed" if decisions and all(one == "passed" for one in decisions) else "undecided"


_WORDS = {
    "simple": "simple acceptance: the value itself decides",
    "guarded": "guard band of the expanded uncertainty, k = 2",
}


def with_limits(calibration: Calibration, limits: Limits) -> Calibration:
    """Return a calibration whose document says how it stands to limits.

    Parameters
    ----------
    calibration, limits : the one and the other; the verdict is untouched.
    """
    return replace(calibration, limits=decide(calibration, limits))


def decide(calibration: Calibration, limits: Limits) -> LimitsBlock:
    """Hold a calibration's parameters against limits.

    A limit that the calibration has no parameter for leaves the whole undecided, and so does one in another kind
    of unit: what was not compared did not pass.

    Parameters
    ----------
    calibration, limits : the one and the other.
    """
    parameters = calibration.every_parameter
    blocks = [
        _decided(parameter, limit, limits)
        for parameter in parameters
        if (limit := limits.limit_of(parameter.name)) is not None
    ]
    blocks += [
        _not_compared(
            limit.name, f"The calibration has no {limit.name}: nothing was compared with its limits."
        )
        for limit in limits.limits
        if not any(covers(limit.name, parameter.name) for parameter in parameters)
    ]
    found = overall([block.decision for block in blocks])
    order = {"failed": 0, "undecided": 1, "passed": 2}
    said = sorted((b for b in blocks if b.decision != "passed"), key=lambda b: order[b.decision])
    return LimitsBlock(
        name=limits.name,
        sha256=limits.sha256,
        rule=limits.rule,
        risk=limits.risk,
        decision=found,
        reasons=[block.reason for block in said],
        parameters=blocks,
    )


def rule_words(block: LimitsBlock) -> str:
    """Return the decision rule in words.

    Parameters
    ----------
    block : of a document.
    """
    if block.rule == "risk":
        return f"risk of a wrong decision at most {100 * (block.risk or 0.0):.3g} %"
    return _WORDS[block.rule]


def _not_compared(name: str, reason: str, parameter: ParameterBlock | None = None) -> LimitBlock:
    return LimitBlock(
        name=name,
        value=None if parameter is None else parameter.value,
        standard_uncertainty=None if parameter is None else parameter.standard_uncertainty,
        unit="" if parameter is None else parameter.unit,
        lower=None,
        upper=None,
        probability=None,
        decision="undecided",
        reason=reason,
    )


def _decided(parameter: ParameterBlock, limit: Limit, limits: Limits) -> LimitBlock:
    value, sigma, unit = parameter.value, parameter.standard_uncertainty, parameter.unit
    label = parameter.name[0].upper() + parameter.name[1:]
    interval = limit.interval(unit)
    if interval is None:
        reason = f"{label} is in {unit}, and its limits are in another kind of unit: they were not compared."
        return _not_compared(parameter.name, reason, parameter)
    lower, upper, largest = interval
    times, word = said_unit(unit, map(abs, (value, lower, upper)))
    shown = f" {word}".rstrip()
    found = decision(limits.rule, value, sigma, lower, upper, limits.risk)
    probability = conformance_probability(value, sigma, lower, upper)
    bounds = _bounds(times * lower, times * upper, shown)
    end = f"within {bounds}"
    if found == "failed":
        end = f"outside {bounds}"
    elif found == "undecided":
        end = f"too near to a limit of {bounds} to decide ({100 * probability:.3g} % probably within)"
    elif GUARD * sigma > largest:
        found = "undecided"
        end = f"known worse than the ± {times * largest:.3g}{shown} (k = 2) that its limits ask for"
    return LimitBlock(
        name=parameter.name,
        value=value,
        standard_uncertainty=sigma,
        unit=unit,
        lower=_finite(lower),
        upper=_finite(upper),
        largest_uncertainty=_finite(largest),
        probability=probability,
        decision=found,
        reason=f"{label} of {Measure(value, sigma, unit).times(times, word).text} is {end}.",
    )


def _finite(limit: float) -> float | None:
    return limit if math.isfinite(limit) else None


def _bounds(lower: float, upper: float, unit: str) -> str:
    if not math.isfinite(lower):
        return f"at most {upper:.4g}{unit}"
    if not math.isfinite(upper):
        return f"at least {lower:.4g}{unit}"
    return f"{lower:.4g} to {upper:.4g}{unit}"
