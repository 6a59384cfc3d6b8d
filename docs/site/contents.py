"""Where each page stands at the side of the site, by what a reader wants of it, and for whom it is.

Tutorials teach, how-to pages solve a task, reference says what is, explanation says why (Diátaxis). A code host shows
the tables of index.md instead.
"""

from __future__ import annotations

from fnmatch import fnmatchcase

CONTENTS = {
    "Where to begin": ["start/*"],
    "Tutorials": ["reference/*-notebook", "tutorials/*"],
    "How to: record and calibrate": [
        *(
            "capture",
            "capture-sources",
            "inspect",
            "procedures/index",
            "procedures/*",
            "magnetometer",
            "thermal",
            "noise",
        ),
    ],
    "How to: plan": ["plan", "protocols", "mount"],
    "How to: many units": ["production", "registry", "certificate"],
    "How to: use the result": ["convert", "corrected", "targets/*", "navigation", "python", "reproduce"],
    "Reference": [
        *(
            "commands",
            "reference/commands/index",
            "report",
            "formats",
            "file-format",
            "conventions",
            "gallery",
            "glossary",
        ),
        *("contract", "reliability", "simulation", "noise-models", "reference/rooms/index"),
    ],
    "Explanation": [
        *(
            "joint",
            "science",
            "uncertainty",
            "poses",
            "segmentation",
            "real-recordings",
            "noise-other-tools",
        ),
        "papers/*",
    ],
    "For those who work on it": [
        *("architecture", "style", "decisions/index", "decisions/*"),
        *("reference/contributing", "reference/changelog"),
    ],
}

READERS = {
    "Where to begin": "For somebody with an IMU and ten minutes.",
    "Tutorials": "A tutorial: for somebody who does it the first time, from beginning to end.",
    "How to: record and calibrate": "How to: for somebody who has a unit to calibrate and knows what an IMU is.",
    "How to: plan": "How to: for somebody who prepares a test, or builds a fixture for it.",
    "How to: many units": "How to: for a laboratory or a production line.",
    "How to: use the result": "How to: for somebody who has a calibration and wants to use it.",
    "Reference": "Reference: for looking something up.",
    "Explanation": "Explanation: for somebody who wants to know why, and how far it can be trusted.",
    "For those who work on it": "For those who work on tumble.",
}


def sections_of(page: str) -> list[str]:
    """Return the sections in which a page stands: one, or it is lost or stands twice.

    Parameters
    ----------
    page : as Sphinx names it, without ending.
    """
    by_name = [name for name, pages in CONTENTS.items() if page in pages]
    return by_name or [
        name
        for name, pages in CONTENTS.items()
        if any("*" in one and fnmatchcase(page, one) for one in pages)
    ]


def with_reader(page: str, text: str) -> str:
    """Return a page with a line under its title that says for whom it is.

    Parameters
    ----------
    page, text : its name, and its Markdown.
    """
    sections = sections_of(page)
    head, newline, rest = text.partition("\n")
    if not sections or not head.startswith("# "):
        return text
    return f"{head}{newline}\n*{READERS[sections[0]]}*\n{rest}"
