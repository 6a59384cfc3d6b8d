"""What a calibration rests on, for readers: one renderer for each kind of evidence, by its class."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tumble.calibration import (
    Beside,
    Budget,
    Evidence,
    Holds,
    Magnetometer,
    Spins,
    ThermalCurves,
    TurnOns,
    Turns,
)
from tumble.report.evidence.budget import beside, budget
from tumble.report.evidence.magnetometer import magnetometer
from tumble.report.evidence.residuals import holds, spins, turns
from tumble.report.evidence.thermal import thermal
from tumble.report.evidence.turn_ons import turn_ons
from tumble.report.page import Block
from tumble.report.subject import Subject

# In the order in which a report has them.
RENDERERS: dict[type[Evidence], Callable[[Any, Subject], list[Block]]] = {
    ThermalCurves: thermal,
    Holds: holds,
    Spins: spins,
    Turns: turns,
    Magnetometer: magnetometer,
    TurnOns: turn_ons,
    Beside: beside,
    Budget: budget,
}


def render_evidence(subject: Subject, *kinds: type[Evidence]) -> list[Block]:
    """Return what stands in the report of the estimate's evidence.

    Parameters
    ----------
    subject : of the report.
    kinds : of evidence, in order.
    """
    blocks: list[Block] = []
    for kind in kinds:
        record = subject.estimate.shown(kind)
        if record is not None:
            blocks += RENDERERS[kind](record, subject)
    return blocks
