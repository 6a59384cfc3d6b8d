"""What a calibration is worth to a user, as a table, and what a filter could carry of it, as `filter.json`."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from msgspec import Meta

from tumble.document import Answer, DocumentPart, answers, practical
from tumble.parameters import spaced, with_uncertainty
from tumble.report.page import Block, Sentences, Table, section
from tumble.report.subject import Subject

FORMAT: Literal["tumble filter states"] = "tumble filter states"
VERSION: Literal[1] = 1
MODEL = "corrected = (1 + E) true + bias (a rate also + G specific_force); a state is an entry of E, G, bias"


class _Strict(DocumentPart, forbid_unknown_fields=True):
    """A part that has no other keys."""


class StateBlock(_Strict):
    """A state of a sensor, in SI.

    Attributes
    ----------
    name : in words.
    row : axis of the sensor: 0 for x.
    column : axis of the input for an entry of E or G; null for a bias.
    sigma : one standard deviation at the start, from the calibration.
    unit : of sigma.
    walk_per_root_second : by how much it wanders: root of the density that drives it.
    largest_share_of_variance : of the variance of horizontal or vertical position, tilt or heading, after any
        of the times.
    carry : whether a filter on such a trajectory should have it.
    """

    name: str
    kind: Literal["accelerometer", "gyroscope", "g-sensitivity"]
    row: Annotated[int, Meta(ge=0, le=2)]
    column: Annotated[int, Meta(ge=0, le=2)] | None
    sigma: Annotated[float, Meta(ge=0.0)]
    unit: str
    walk_per_root_second: Annotated[float, Meta(ge=0.0)]
    largest_share_of_variance: Annotated[float, Meta(ge=0.0)]
    carry: bool


class FilterDocument(_Strict):
    """The sensor states that a filter could have, and which of them it should.

    Attributes
    ----------
    model : what a state is an entry of.
    trajectory : that they were judged on.
    seconds : s of free navigation after which they were judged.
    """

    format: Literal["tumble filter states"] = FORMAT
    version: Literal[1] = VERSION
    model: str = MODEL
    trajectory: str
    seconds: list[float]
    states: list[StateBlock]
    remarks: list[str]


HEADS = ("after", "uncalibrated", "calibrated, one sigma", "most of it from")
_WORTH = (
    "The error that this calibration leaves, in position after some time without satellites or other "
    "aiding, and in attitude after a turn. Beside it is the error of the same unit with nominal "
    "scale factors and no bias. Its worst pose is its own; the one that is named is the calibration's."
)
FOOTNOTE = (
    "Horizontal position from a known start; attitude in all three components. From the calibration's covariance "
    "alone: the sensors' noise, the wander of their biases and how far these move until the unit is next switched on "
    "come on top."
)
OF_SEVERAL = (
    "Horizontal position from a known start; attitude in all three components. From the "
    "calibration's covariance alone, with biases as uncertain as they are when the unit is next "
    "switched on. The sensors' noise and the wander of their biases come on top."
)
_GROUPS = {
    "accelerometer.bias": "accelerometer bias",
    "accelerometer.matrix": "accelerometer scale and angles",
    "accelerometer.quadratic": "accelerometer quadratic",
    "accelerometer.asymmetry": "accelerometer asymmetry",
    "gyroscope.bias": "gyro bias",
    "gyroscope.matrix": "gyro scale and angles",
    "gyroscope.quadratic": "gyro quadratic",
    "gyroscope.asymmetry": "gyro asymmetry",
    "gyroscope.g_sensitivity": "g-sensitivity",
}


def predictions(subject: Subject) -> list[Block]:
    """Return the predicted errors.

    Parameters
    ----------
    subject : of the report.
    """
    calibration = subject.calibration
    told = answers(calibration)
    if not told:
        return []
    note = FOOTNOTE if calibration.turn_ons is None else OF_SEVERAL
    return section(
        "What it is worth",
        Sentences([_WORTH], "paragraphs"),
        Table(HEADS, [cells(answer) for answer in told]),
        Sentences([note], "notes"),
    )


def cells(answer: Answer, *, with_sheet: bool = False) -> list[str]:
    """Return question, uncalibrated error, calibrated one and its main cause as texts.

    Parameters
    ----------
    answer : a prediction.
    with_sheet : put what the data sheet promises third.
    """
    sheet = [_about_zero(answer.kind, answer.sheet)] if with_sheet else []
    return [answer.question, _before(answer), *sheet, _about_zero(answer.kind, answer.after), _causes(answer)]


def _about_zero(kind: str, error: float | None) -> str:
    if error is None or not math.isfinite(error):
        return "–" if error is None else "attitude lost"
    value, unit = practical(kind, error)
    return f"{with_uncertainty(0.0, value)}{spaced(unit)}"


def _before(answer: Answer) -> str:
    if answer.before is None or not math.isfinite(answer.before):
        return _about_zero(answer.kind, answer.before)
    value, unit = practical(answer.kind, answer.before)
    scale = value / answer.before if answer.before > 0.0 else 1.0
    return f"{with_uncertainty(value, scale * answer.after)}{spaced(unit)}"


def _causes(answer: Answer) -> str:
    """Name what makes up nine tenths of the variance, two groups at most."""
    named: list[str] = []
    whole = 0.0
    for group, share in list(answer.shares.items())[:2]:
        named.append(f"{_GROUPS.get(group, group)} {100.0 * min(share, 1.0):.0f} %")
        whole += share
        if whole > 0.9:
            break
    return ", ".join(named)
