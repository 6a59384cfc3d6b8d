"""The document of a calibration: read, written, applied, compared, combined and converted.

calibration.json says what it is, in which convention, with its formula, covariance and test vectors. Nothing in
this room estimates anything: an estimate comes in by `composition`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tumble.document.composition import calibration_from_estimate
    from tumble.document.result import Calibration, read_calibration

__all__ = ["Calibration", "calibration_from_estimate", "read_calibration"]

_MODULES = {
    "Calibration": "result",
    "calibration_from_estimate": "composition",
    "read_calibration": "result",
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
