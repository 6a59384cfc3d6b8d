"""The names of the procedures that a protocol may ask for; what they do is no concern of a protocol."""

from __future__ import annotations

from pathlib import Path
from pkgutil import iter_modules

_ROOM = Path(__file__).parent / "calibration" / "procedures"

KNOWN_PROCEDURES = tuple(sorted(module.name.replace("_", "-") for module in iter_modules([str(_ROOM)])))
"""A file each in the room of procedures: a protocol that names another one is mistaken."""
