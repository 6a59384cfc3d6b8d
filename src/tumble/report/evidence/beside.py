"""The joint estimate and a paper's own estimator, side by side: values and uncertainties."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tumble.parameters.measures import fixed, with_uncertainty
from tumble.records import dataclass
from tumble.report.page import Block, Sentences, Table, section

if TYPE_CHECKING:
    from tumble.calibration.estimate import Beside, Estimate
    from tumble.report.parameters import ParameterRow
    from tumble.report.subject import Subject

# Differences beyond so many of the estimator's standard uncertainties are worth a sentence.
FAR = 3.0


@dataclass(frozen=True, slots=True)
class Compared:
    """One parameter as both ways have it, in the joint one's unit for readers.

    Attributes
    ----------
    row : of the joint estimate.
    value, sigma : the estimator's own.
    difference : joint minus the estimator's, in standard uncertainties of the estimator's.
    ratio : the joint standard uncertainty over the estimator's.
    """

    row: ParameterRow
    value: float
    sigma: float
    difference: float
    ratio: float


def beside(told: Beside, subject: Subject) -> list[Block]:
    """Return both ways as a table; nothing where nothing stands beside.

    Parameters
    ----------
    told : what the estimate rests on.
    subject : of the report.
    """
    found = parameters_beside(told, subject.estimate, subject.rows)
    if not found:
        return []
    name = told.estimate.procedure
    heads = ("parameter", "joint", name, "difference / uncertainty", "ratio")
    rows = [
        [
            f"{one.row.group}: {one.row.label}",
            one.row.shown.text,
            f"{with_uncertainty(one.value, one.sigma)} {one.row.shown.unit}".rstrip(),
            _signed(one.difference),
            fixed(one.ratio, 2),
        ]
        for one in found
    ]
    words = Sentences([_words(found, name, told.source)], "paragraphs")
    return section("A paper's own estimator beside", words, Table(heads, rows))


def parameters_beside(told: Beside, estimate: Estimate, rows: list[ParameterRow]) -> list[Compared]:
    """Return the parameters that both ways have with an uncertainty.

    Parameters
    ----------
    told : the estimator's.
    estimate : the joint one.
    rows : the joint parameters for readers.
    """
    others = {p.name: p for p in told.estimate.parameters}
    found: list[Compared] = []
    for own, row in zip(estimate.parameters, rows, strict=False):
        other = others.get(own.name)
        if other is None or not (own.standard_uncertainty > 0.0 and other.standard_uncertainty > 0.0):
            continue
        factor = row.shown.sigma / own.standard_uncertainty
        found.append(
            Compared(
                row,
                factor * other.value,
                factor * other.standard_uncertainty,
                (own.value - other.value) / other.standard_uncertainty,
                own.standard_uncertainty / other.standard_uncertainty,
            )
        )
    return found


def _words(found: list[Compared], name: str, source: str) -> str:
    far = [one for one in found if abs(one.difference) > FAR]
    typical = math.exp(sum(math.log(one.ratio) for one in found) / len(found))
    told = (
        f"Both are made from the same recording: {name} by {source}, the joint estimate from every sample at once. "
        f"Joint standard uncertainties are {fixed(typical, 2)} times {name}'s in the (geometric) mean. "
        f"± is one standard uncertainty; differences are in those of {name}: where the model is right, below about "
        "two. The last column is the joint uncertainty over the other."
    )
    if not far:
        return told
    named = ", ".join(f"{one.row.group.lower()} {one.row.label}" for one in far[:3])
    more = f" and {len(far) - 3} more" if len(far) > 3 else ""
    return f"{told} Farther apart are {named}{more}: what only one of them models has moved them."


def _signed(value: float) -> str:
    text = fixed(value, 1)
    return text if text.startswith("-") or text == "0.0" else f"+{text}"
