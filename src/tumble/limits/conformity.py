"""A calibration held against limits: decision rules, each limited parameter, and all of them together.

Decision rules of JCGM 106:2012: whether a quantity is within its limits, known with an uncertainty only.

simple (8.2): the estimate itself decides. guarded (8.3): it has to be inside by the expanded uncertainty U = 2u to
pass, and outside by as much to fail. risk (7 and 8.3.2): the probability that the quantity conforms, from a normal
distribution about the estimate, has to be at least 1 - risk to pass, at most risk to fail. Between them nothing is
decided: measure better, or let a person decide.
"""

from __future__ import annotations

import math

from msgspec.structs import replace

from tumble.document.limits_block import Decision, LimitBlock, LimitsBlock, Rule
from tumble.document.result import Calibration, ParameterBlock
from tumble.limits.reading import Limit, Limits, covers
from tumble.parameters.measures import Measure, said_unit

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
    told = f"{label} of {Measure(value, sigma, unit).times(times, word).text} is"
    bounds = _bounds(times * lower, times * upper, shown)
    if found == "failed":
        reason = f"{told} outside {bounds}."
    elif found == "undecided":
        reason = (
            f"{told} too near to a limit of {bounds} to decide ({100 * probability:.3g} % probably within)."
        )
    elif GUARD * sigma > largest:
        found = "undecided"
        reason = (
            f"{told} known worse than the ± {times * largest:.3g}{shown} (k = 2) that its limits ask for."
        )
    else:
        reason = f"{told} within {bounds}."
    return LimitBlock(
        name=parameter.name,
        value=value,
        standard_uncertainty=sigma,
        unit=unit,
        lower=lower if math.isfinite(lower) else None,
        upper=upper if math.isfinite(upper) else None,
        largest_uncertainty=largest if math.isfinite(largest) else None,
        probability=probability,
        decision=found,
        reason=reason,
    )


def _bounds(lower: float, upper: float, unit: str) -> str:
    if not math.isfinite(lower):
        return f"at most {upper:.4g}{unit}"
    if not math.isfinite(upper):
        return f"at least {lower:.4g}{unit}"
    return f"{lower:.4g} to {upper:.4g}{unit}"
