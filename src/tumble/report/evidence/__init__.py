"""What a calibration rests on, for readers: one renderer for each kind of evidence, by its name."""

from __future__ import annotations

from collections.abc import Callable

from tumble.report.evidence.beside import beside
from tumble.report.evidence.budget import budget, reliability
from tumble.report.evidence.holds import holds
from tumble.report.evidence.rotations import rotations
from tumble.report.evidence.sequences import sequences
from tumble.report.evidence.spins import spins
from tumble.report.evidence.thermal import thermal
from tumble.report.evidence.turn_ons import turn_ons
from tumble.report.evidence.turns import turns
from tumble.report.page import Block
from tumble.report.subject import Subject

Renderer = Callable[[Subject], list[Block]]

RENDERERS: dict[str, Renderer] = {
    "thermal": thermal,
    "holds": holds,
    "turns": turns,
    "spins": spins,
    "rotations": rotations,
    "sequences": sequences,
    "budget": budget,
    "reliability": reliability,
    "turn-ons": turn_ons,
    "beside": beside,
}
