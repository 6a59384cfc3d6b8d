"""The papers' items: every table, figure and claim that can be made anew."""

from __future__ import annotations

from tumble.reproduction import Item
from tumble_papers.hayal import CHAPTER_4, POSITIONS, SCENARIO_TABLES
from tumble_papers.savage import FORMULAS, SECTION_9
from tumble_papers.zhang import NAVIGATION, POSE_SETS, TABLES_AND_FIGURES

_STUDIES = (
    *(*CHAPTER_4, *SCENARIO_TABLES, *POSITIONS),
    *(*TABLES_AND_FIGURES, *NAVIGATION, *POSE_SETS),
    *(*FORMULAS, *SECTION_9),
)
ITEMS: dict[str, Item] = {study.name: study.item for study in _STUDIES}
"""Every item by name, a paper after the other, each in its own order: the entry point `tumble.reproduction`."""
