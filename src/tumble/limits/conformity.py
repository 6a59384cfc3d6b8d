"""A calibration held against limits: each limited parameter decided by the rule, and all of them together."""

from __future__ import annotations

import math

from tumble.document.limits_block import LimitBlock, LimitsBlock
from tumble.document.result import Calibration, ParameterBlock
from tumble.limits.reading import Limit, Limits, covers
from tumble.limits.rule import GUARD, conformance_probability, decision, overall

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
    return calibration.model_copy(update={"limits": decide(calibration, limits)})


def decide(calibration: Calibration, limits: Limits) -> LimitsBlock:
    """Hold a calibration's parameters against limits.

    A limit that the calibration has no parameter for leaves the whole undecided, and so does one in another kind
    of unit: what was not compared did not pass.

    Parameters
    ----------
    calibration, limits : the one and the other.
    """
    blocks: list[LimitBlock] = []
    used: set[str] = set()
    for parameter in calibration.every_parameter:
        limit = limits.limit_of(parameter.name)
        if limit is not None:
            used.add(limit.name)
            blocks.append(_decided(parameter, limit, limits))
    for limit in limits.limits:
        names = [p.name for p in calibration.every_parameter if covers(limit.name, p.name)]
        if limit.name not in used and not names:
            blocks.append(_missing(limit))
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


def _missing(limit: Limit) -> LimitBlock:
    return LimitBlock(
        name=limit.name,
        value=None,
        standard_uncertainty=None,
        unit="",
        lower=None,
        upper=None,
        probability=None,
        decision="undecided",
        reason=f"The calibration has no {limit.name}: nothing was compared with its limits.",
    )


def _decided(parameter: ParameterBlock, limit: Limit, limits: Limits) -> LimitBlock:
    value, sigma, unit = parameter.value, parameter.standard_uncertainty, parameter.unit
    written, times = limit.unit_written(unit)
    shown = "" if written == "1" else f" {written}"
    label = parameter.name[0].upper() + parameter.name[1:]
    interval = limit.interval(unit)
    if interval is None:
        return LimitBlock(
            name=parameter.name,
            value=value,
            standard_uncertainty=sigma,
            unit=unit,
            lower=None,
            upper=None,
            probability=None,
            decision="undecided",
            reason=f"{label} is in {unit}, and its limits are in another kind of unit: they were not compared.",
        )
    lower, upper, largest = interval
    found = decision(limits.rule, value, sigma, lower, upper, limits.risk)
    probability = conformance_probability(value, sigma, lower, upper)
    told = f"{label} of {times * value:.5g} ± {times * sigma:.2g}{shown} is"
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
