"""Sentences about a calibration that table and report share, and how it stands to acceptance limits."""

from __future__ import annotations

import math

from tumble.calibration import TERMS
from tumble.document import Calibration, LimitBlock, LimitsBlock, TermBlock
from tumble.limits import rule_words
from tumble.parameters import Measure, amount, said_unit, two_digits
from tumble.report.page import Block, Sentences, Table, Verdict, section


def verdict_words(fit: bool) -> str:
    """Return the verdict in three or four words."""
    return "Fit for use" if fit else "Not fit for use"


def term_words(name: str) -> str:
    """Return an optional term's name in words.

    Parameters
    ----------
    name : as the document has it.
    """
    return TERMS[name].words if name in TERMS else name.replace("_", " ")


def quality_sentences(calibration: Calibration) -> list[str]:
    """Return how well the data fit, in sentences with numbers."""
    quality = calibration.quality
    counted = [f"{quality.holds} holds"] if quality.holds else []
    counted += [f"{quality.turns} turns"] if quality.turns or not quality.spins else []
    counted += [f"{quality.spins} spins"] if quality.spins else []
    if calibration.thermal is not None:
        # What counts are the stretches of rest at their temperatures; the remarks say how many, and which turns.
        counted = []
    # Of three the first two have a comma between them.
    counts = [*counted[:-2], " and ".join(counted[-2:])] if counted else []
    words = [", ".join([*counts, f"{quality.degrees_of_freedom} degrees of freedom."])]
    # Without a degree of freedom it is round-off, and not a quality.
    if quality.rms_hold_norm is not None and quality.degrees_of_freedom > 0:
        text = f"Rms of the corrected holds' norm against gravity {two_digits(1e3 * quality.rms_hold_norm)} mm/s²"
        if quality.rms_turn_angle is not None:
            text += f", of gravity carried over the turns {two_digits(math.degrees(quality.rms_turn_angle))}°"
        words.append(text + ".")
    if quality.sigma0 is not None:
        text = f"Residuals over what the noise inside the holds explains (sigma0): {quality.sigma0:.2f}"
        if quality.sigma0_with_variance_components is not None:
            text += f"; with the variance components found: {quality.sigma0_with_variance_components:.2f}"
        words.append(text + ".")
    own = [p.coverage_factor for p in calibration.parameters if p.coverage_factor is not None]
    factor = f"{quality.coverage_factor:.2f} standard uncertainties"
    if own:
        span = f"{min(own):.2f}" if max(own) - min(own) < 0.005 else f"{min(own):.2f} to {max(own):.2f}"
        factor = f"{span} standard uncertainties, by each parameter's own degrees of freedom"
    words.append(
        f"Largest normalised residual {quality.largest_normalised_residual:.1f}; 95 % intervals are ± {factor}."
    )
    return words


def terms_sentences(calibration: Calibration) -> list[str]:
    """Return what became of each optional term."""
    return [
        (
            f"Optional term {term_words(term.name)}: {'kept' if term.kept else 'left out'} "
            f"(probability of chance {chance(term)}, limit {term.limit:.2g})."
        )
        for term in calibration.quality.optional_terms
    ]


def chance(term: TermBlock) -> str:
    """Return how probable it is that chance alone gives the term's F statistic."""
    return "below 1e-12" if term.probability < 1e-12 else f"{term.probability:.2g}"


def left_out_sentences(calibration: Calibration) -> list[str]:
    """Return what took no part, and why."""
    left = calibration.quality.left_out
    said = [f"Left out: {item.kind} {item.number}: {item.reason}." for item in left]
    return said or ["Nothing was left out as an outlier."]


def component_words(name: str, sigma: float) -> str:
    """Return a variance component in words.

    Its name has the SI unit after a comma, and then in brackets the recording if there are several.

    Examples
    --------
    >>> component_words("accelerometer bias from hold to hold, m/s² (a.csv)", 0.00981)
    'Accelerometer bias from hold to hold (a.csv): 1 mg.'
    """
    name, bracket, whose = name.partition(" (")
    what, _, unit = name.rpartition(", ")
    what = f"{what[:1].upper()}{what[1:]}{bracket}{whose}"
    return f"{what}: {amount(sigma, unit)}." if sigma else f"{what}: none found beyond the noise."


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
