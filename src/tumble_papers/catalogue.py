"""The papers' items: every table, figure and claim that can be made anew."""

from __future__ import annotations

from tumble.reproduction import Item
from tumble_papers.hayal import chapter_4, positions, scenarios
from tumble_papers.savage import formulas, section_9
from tumble_papers.zhang import navigation, pose_sets, tables

_STUDIES = (
    *(*chapter_4.STUDIES, *scenarios.STUDIES, *positions.STUDIES),
    *(*tables.STUDIES, *navigation.STUDIES, *pose_sets.STUDIES),
    *(*formulas.STUDIES, *section_9.STUDIES),
)
ITEMS: dict[str, Item] = {study.name: study.item for study in _STUDIES}
"""Every item by name, a paper after the other, each in its own order: the entry point `tumble.reproduction`."""
