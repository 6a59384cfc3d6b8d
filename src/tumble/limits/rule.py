"""Decision rules of JCGM 106:2012: whether a quantity is within its limits, known with an uncertainty only.

simple (8.2): the estimate itself decides. guarded (8.3): it has to be inside by the expanded uncertainty U = 2u to
pass, and outside by as much to fail. risk (7 and 8.3.2): the probability that the quantity conforms, from a normal
distribution about the estimate, has to be at least 1 - risk to pass, at most risk to fail. Between them nothing is
decided: measure better, or let a person decide.
"""

from __future__ import annotations

import math

from tumble.document.limits_block import Decision, Rule

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
