"""How a calibration stands to acceptance limits, for the report and the terminal: beside the verdict, not in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tumble.limits.conformity import rule_words
from tumble.parameters.measures import Measure, said_unit
from tumble.report.page import Block, Sentences, Table, Verdict, section

if TYPE_CHECKING:
    from tumble.document.limits_block import LimitBlock, LimitsBlock
    from tumble.document.result import Calibration

DECISIONS = {"passed": "Within limits", "failed": "Out of limits", "undecided": "Limits undecided"}
HEADS = ("parameter", "value ± standard uncertainty", "from", "to", "probably within", "decision")


def limits_verdict(block: LimitsBlock) -> Verdict:
    """Return the decision in two words, with its reasons.

    Parameters
    ----------
    block : of a document.
    """
    said = [f"{len(block.parameters)} parameters of {block.name!r}; {rule_words(block)}."]
    return Verdict(block.decision == "passed", DECISIONS[block.decision], [*block.reasons, *said])


def limits_section(calibration: Calibration) -> list[Block]:
    """Return the report's section of limits, none where there are none.

    Parameters
    ----------
    calibration : the document.
    """
    block = calibration.limits
    if block is None:
        return []
    words = (
        "Whether the unit is as it has to be; whether the calibration can be trusted, the verdict above says. "
        f"Decision rule: {rule_words(block)} (JCGM 106)."
    )
    rows = [_row(one) for one in block.parameters]
    return section(
        "Limits", limits_verdict(block), Sentences([words], "notes"), Table(HEADS, rows, right=(2, 3, 4))
    )


def _row(one: LimitBlock) -> list[str]:
    ends = one.lower, one.upper
    times, word = said_unit(one.unit, [abs(size) for size in (one.value, *ends) if size is not None])
    sigma = one.standard_uncertainty or 0.0
    value = "–" if one.value is None else Measure(one.value, sigma, one.unit).times(times, word).text
    chance = "–" if one.probability is None else f"{100 * one.probability:.4g} %"
    return [
        one.name,
        value,
        *("–" if end is None else f"{times * end:.4g}" for end in ends),
        chance,
        one.decision,
    ]
