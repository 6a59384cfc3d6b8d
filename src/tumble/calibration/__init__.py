"""From a recording and what is believed of it to the sensor model: one adjustment, and procedures as records.

`calibrate` estimates, `Session` is what is given, `find_procedure` tells what a protocol is made for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tumble.calibration.estimate import Estimate
    from tumble.calibration.joint import calibrate
    from tumble.calibration.session import Options, Session, find_procedure

__all__ = ["Estimate", "Options", "Session", "calibrate", "find_procedure"]

_MODULES = {
    "Estimate": "estimate",
    "Options": "session",
    "Session": "session",
    "calibrate": "joint",
    "find_procedure": "session",
}


def __getattr__(name: str) -> object:
    """Fetch a name from its module at first use: whoever reads an estimate needs no estimator.

    Raises
    ------
    AttributeError
        If the room has no such name.
    """
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
