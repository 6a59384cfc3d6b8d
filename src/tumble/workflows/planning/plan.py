"""Planning a test before it is done: which kinds of plans there are, and what all of them begin and end with.

Poses are searched (`plan_poses`), any protocol is judged as it is (`plan_any_protocol`).
"""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from tumble.earth import Site
from tumble.errors import UsageError

if TYPE_CHECKING:
    from tumble.protocol import Protocol
    from tumble.simulation import Grade

SEARCHED = ("multi-position", "hand-held", "six-position")
"""Procedures whose poses are searched."""

Kind = Literal["poses", "protocol"]
_DEFAULT_LATITUDE_DEG = 45.0


def kind_of_plan(asked: str) -> Kind:
    """Return which kind of plan is made of what is asked for.

    Parameters
    ----------
    asked : a procedure, the name of a protocol, or a protocol file.

    Raises
    ------
    UsageError
        If there is no such thing.
    ProtocolError
        If the file is no protocol.
    """
    if asked in SEARCHED:
        return "poses"
    find_protocol(asked)
    return "protocol"


def find_protocol(asked: str) -> Protocol:
    """Return a named protocol or a file's.

    Parameters
    ----------
    asked : as the user wrote it.

    Raises
    ------
    UsageError
        If there is neither.
    ProtocolError
        If the file is none.
    """
    from tumble.protocol import PROTOCOLS
    from tumble.workflows.given.protocols import read_given_protocol

    if asked in PROTOCOLS or Path(asked).exists():
        return read_given_protocol(asked).protocol
    names = [*SEARCHED, *(name for name in PROTOCOLS if name not in SEARCHED)]
    near = difflib.get_close_matches(asked.lower(), names, 1)
    meant = f" Did you mean {near[0]}?" if near else ""
    raise UsageError(
        f"There is no plan of {asked!r}: give a protocol file, or one of {', '.join(dict.fromkeys(names))}.{meant}"
    )


def planned_grade(imu: str) -> tuple[Grade, list[str]]:
    """Return a grade, and a sentence where no source states some of it.

    Parameters
    ----------
    imu : its name.

    Raises
    ------
    UsageError
        If there is none of that name.
    """
    from tumble.simulation.grades import find_grade

    grade = find_grade(imu)
    return grade, [f"Of {grade.name} no source states: {'; '.join(grade.assumed)}."] if grade.assumed else []


def planned_place(site: Site | None, ending: str) -> tuple[Site, list[str]]:
    """Return the place of a test, and a sentence where it is assumed.

    Parameters
    ----------
    site : that was given, or None.
    ending : of the sentence.
    """
    if site is not None:
        return site, []
    place = Site.from_latitude(math.radians(_DEFAULT_LATITUDE_DEG), 0.0)
    return place, [f"No site was given: latitude {_DEFAULT_LATITUDE_DEG:g}° at height 0 {ending}"]


def read_targets(text: str | None, sizes: Mapping[str, float], refusal: str) -> dict[str, float]:
    """Return wished-for standard uncertainties by name, SI, of a text such as "bias=50,scale=100".

    Parameters
    ----------
    text : as the user wrote it, or None.
    sizes : SI units in the unit that each name's number is in.
    refusal : what is said of another text.

    Raises
    ------
    UsageError
        If it cannot be read.
    """
    found: dict[str, float] = {}
    for part in (text or "").split(","):
        if not part.strip():
            continue
        name, _, number = (piece.strip() for piece in part.partition("="))
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if name not in sizes or not (math.isfinite(value) and value > 0.0):
            raise UsageError(f"--targets {text}: {refusal}")
        found[name] = value * sizes[name]
    return found


def check_seed(seed: int) -> None:
    """Refuse a seed that is none.

    Parameters
    ----------
    seed : as the user wrote it.

    Raises
    ------
    UsageError
        If it is below zero.
    """
    if seed < 0:
        raise UsageError(f"--seed {seed}: a seed is a whole number from 0 on.")


def write_plan(folder: Path, protocol: Protocol, document: dict[str, Any], title: str) -> list[Path]:
    """Write a plan's protocol, document and sheet beside their places, then rename them all; return the places.

    Parameters
    ----------
    folder, protocol, document, title : where, and of plain data; the title is the sheet's.

    Raises
    ------
    OutputError
        If they cannot be written; earlier ones are intact.
    """
    from tumble.files import write_texts
    from tumble.protocol import protocol_to_yaml
    from tumble.report.operator_sheet import render_sheet

    texts = {
        "protocol.yaml": protocol_to_yaml(protocol),
        "plan.json": json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n",
        "sheet.html": render_sheet(protocol, title),
    }
    return write_texts({folder / name: text for name, text in texts.items()})


def finite(value: float) -> float | None:
    """Return a number that JSON has, or None.

    Parameters
    ----------
    value : of any size.
    """
    return value if math.isfinite(value) else None
