"""What a calibration document says of limits: which rule decided, and how each limited parameter came out."""

from __future__ import annotations

from typing import Literal

from tumble.document.part import DocumentPart

Decision = Literal["passed", "failed", "undecided"]
Rule = Literal["simple", "guarded", "risk"]


class LimitBlock(DocumentPart):
    """One parameter against its limits, all in the parameter's own unit.

    `lower`, `upper` : null where that side is free. `largest_uncertainty` : of the expanded uncertainty (k = 2), or
    null. `probability` : that the true value is within the limits, null without an uncertainty.
    """

    name: str
    value: float | None
    standard_uncertainty: float | None
    unit: str
    lower: float | None
    upper: float | None
    largest_uncertainty: float | None = None
    probability: float | None
    decision: Decision
    reason: str


class LimitsBlock(DocumentPart):
    """All limits of one file together: passed only where each of them is.

    `risk` : largest probability of a wrong acceptance or rejection, of the rule "risk" only.
    """

    name: str
    sha256: str
    rule: Rule
    risk: float | None = None
    decision: Decision
    reasons: list[str]
    parameters: list[LimitBlock]
