"""Calibrations in other tools' forms: one template a target, each with its formula and a test vector.

A file of `targets` is a record and a Jinja2 text. Of a calibration the text is given what the record holds, and what it
does not hold is stated with its size (`losses`). Four tools' files are read, too.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tumble.export.subject import Subject, prepare
    from tumble.export.target import Target, find_target, targets

__all__ = ["Subject", "Target", "find_target", "prepare", "targets"]

_MODULES = {
    "Subject": "subject",
    "Target": "target",
    "find_target": "target",
    "prepare": "subject",
    "targets": "target",
}


def __getattr__(name: str) -> object:
    """Fetch a name from its module at first use.

    Raises
    ------
    AttributeError
        If the room has no such name.
    """
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
