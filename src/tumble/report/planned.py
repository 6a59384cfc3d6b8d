"""What a plan predicted beside what was achieved."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tumble.report.page import Block, Sentences, Table, section
from tumble.report.parameters import GROUPS, achieved_beside

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tumble.document.result import Calibration
    from tumble.report.subject import Subject


def planned(subject: Subject) -> list[Block]:
    """Return a section with predicted and achieved uncertainties; nothing without a plan.

    Parameters
    ----------
    subject : of the report.
    """
    sentence = planned_sentence(subject.calibration, subject.predicted)
    if sentence is None:
        return []
    rows = [
        [
            row.name,
            predicted.text,
            achieved.text,
            f"{achieved.sigma / predicted.sigma:.2g}",
        ]
        for row, predicted, achieved in sorted(
            achieved_beside(subject.calibration, subject.predicted),
            key=lambda one: GROUPS.index(one[0].group),
        )
    ]
    heads = ("standard uncertainty of", "predicted", "achieved", "achieved over predicted")
    return section("Beside the plan", Sentences([sentence], "paragraphs"), Table(heads, rows))


def planned_sentence(calibration: Calibration, predicted: Mapping[str, float]) -> str | None:
    """Return how the uncertainties compare with those that a plan predicted; None without a plan.

    Parameters
    ----------
    calibration : the result.
    predicted : standard uncertainties by name, SI.
    """
    beside = achieved_beside(calibration, predicted)
    if not beside:
        return None
    ratios = sorted((achieved.sigma / foreseen.sigma, row.name) for row, foreseen, achieved in beside)
    middle = ratios[len(ratios) // 2][0]
    return (
        f"Beside the plan: the median uncertainty is {middle:.2g} times the predicted one. Least for "
        f"{ratios[0][1]} ({ratios[0][0]:.2g} times), most for {ratios[-1][1]} ({ratios[-1][0]:.2g} times)."
    )
