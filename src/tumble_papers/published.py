"""The numbers that the papers print, as they print them."""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files
from typing import Any


@cache
def hayal() -> dict[str, Any]:
    """Return the printed tables of Hayal (2010): ``tables``, ``position_tables`` and the abstract's claim."""
    text = (files("tumble") / "data" / "papers" / "hayal-2010.json").read_text(encoding="utf-8")
    return json.loads(text)


@cache
def zhang() -> dict[str, Any]:
    """Return the printed numbers of Zhang et al. (2010): ``tables``, ``figures``, ``simulation`` and ``claims``."""
    text = (files("tumble") / "data" / "papers" / "zhang-2010.json").read_text(encoding="utf-8")
    return json.loads(text)


@cache
def savage() -> dict[str, Any]:
    """Return the printed numbers of Savage (2018): ``tables``, equations by number, ``section_9``.

    ``another_implementation`` has figures that the paper does not print.
    """
    text = (files("tumble") / "data" / "papers" / "savage-2018.json").read_text(encoding="utf-8")
    return json.loads(text)
