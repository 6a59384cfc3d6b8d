"""What the protocol asked for and what was found: its steps, each with where it is in the recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.report.page import Block, Sentences, Table, section

if TYPE_CHECKING:
    from tumble.protocol import Step
    from tumble.recording.recording import Recording
    from tumble.report.subject import Subject


def protocol(subject: Subject) -> list[Block]:
    """Return the steps of the protocol, and what was said of them; nothing without a protocol.

    Parameters
    ----------
    subject : of the report.
    """
    from tumble.protocol import TurnStep

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
    from tumble.protocol import SpinStep

    if isinstance(step, SpinStep):
        axis = "up" if step.axis_b is None else "(" + ", ".join(f"{v:.3g}" for v in step.axis_b) + ")"
        words = f"{np.degrees(step.rate):.6g}°/s about {axis}"
        return f"spin: {step.name}, {words}" if step.name else f"spin: {words}"
    kind = type(step).__name__.removesuffix("Step").lower()
    return f"{kind}: {step.name}" if step.name else kind
