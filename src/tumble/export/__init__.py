"""Calibrations in other tools' forms: one file a target, each with its formula and a test vector.

`TARGETS` names them. A target writes what it can hold of a calibration and says what it cannot
(`losses`); where the other side's files are complete enough it reads them too.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tumble.export.registry import TARGETS, find_target
    from tumble.export.subject import Subject, prepare
    from tumble.export.target import Target

__all__ = ["TARGETS", "Subject", "Target", "find_target", "prepare"]

_MODULES = {
    "TARGETS": "registry",
    "Subject": "subject",
    "Target": "target",
    "find_target": "registry",
    "prepare": "subject",
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
