"""What a protocol asked for and a plan predicted, beside what was found: steps, and accuracy achieved."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tumble.document import Calibration
from tumble.parameters import GROUPS
from tumble.protocol import SpinStep, Step, TurnStep
from tumble.recording import Recording
from tumble.report.page import Block, Sentences, Table, section
from tumble.report.parameters import achieved_beside
from tumble.report.subject import Subject


def protocol(subject: Subject) -> list[Block]:
    """Return the steps of the protocol, and what was said of them; nothing without a protocol.

    Parameters
    ----------
    subject : of the report.
    """
    told, matching, recording = subject.protocol, subject.matching, subject.recording
    if told is None or matching is None:
        return []
    places: dict[int, list[str]] = {}
    for matched in matching.holds:
        hold = subject.timeline.holds[matched.hold]
        where = f"hold {matched.hold + 1}, {_span(recording, hold.start, hold.stop)}"
        places.setdefault(matched.step, []).append(where)
    for spin in matching.spins:
        places.setdefault(spin.step, []).append(_span(recording, spin.start, spin.stop))
    rows = [
        [str(number + 1), _step_words(step), "; ".join(places.get(number, ["not found"]))]
        for number, step in enumerate(told.steps)
        if number in places or not isinstance(step, TurnStep)
    ]
    said = (
        Sentences(matching.remarks)
        if matching.remarks
        else Sentences(["Every step was found, and nothing else."], "paragraphs")
    )
    table = Table(("step", "what", "found"), rows, folded="The steps and where they were found")
    return section(f"Protocol {told.name}", said, table)


def _span(recording: Recording, first: int, stop: int) -> str:
    start = float(recording.time[0])
    return f"{recording.time[first] - start:.1f} to {recording.time[stop - 1] - start:.1f} s"


def _step_words(step: Step) -> str:
    """Return what a step is, in words.

    Examples
    --------
    >>> import numpy as np
    >>> from tumble.protocol import HoldStep, SpinStep
    >>> _step_words(HoldStep(5.0, None, "on its back")), _step_words(SpinStep(8.0, -np.pi / 4))
    ('hold: on its back', 'spin: -45°/s about up')
    """
    if isinstance(step, SpinStep):
        axis = "up" if step.axis_b is None else "(" + ", ".join(f"{v:.3g}" for v in step.axis_b) + ")"
        words = f"{np.degrees(step.rate):.6g}°/s about {axis}"
        return f"spin: {step.name}, {words}" if step.name else f"spin: {words}"
    kind = type(step).__name__.removesuffix("Step").lower()
    return f"{kind}: {step.name}" if step.name else kind


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
