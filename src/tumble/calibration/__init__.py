"""Procedures: ways to estimate the sensor model from a recorded protocol.

One file a procedure; each builds conditions for `tumble.estimation` and writes no solver of its own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tumble.calibration.composition import calibration_from_estimate
    from tumble.calibration.estimate import Estimate
    from tumble.calibration.hand_held import calibrate_hand_held
    from tumble.calibration.modified_multi_position import calibrate_modified_multi_position
    from tumble.calibration.multi_position import calibrate_multi_position
    from tumble.calibration.rate_table import calibrate_rate_table
    from tumble.calibration.result import Calibration, read_calibration
    from tumble.calibration.six_position import calibrate_six_position

__all__ = [
    "Calibration",
    "Estimate",
    "calibrate_hand_held",
    "calibrate_modified_multi_position",
    "calibrate_multi_position",
    "calibrate_rate_table",
    "calibrate_six_position",
    "calibration_from_estimate",
    "read_calibration",
]

_MODULES = {
    "Calibration": "result",
    "Estimate": "estimate",
    "calibrate_hand_held": "hand_held",
    "calibrate_modified_multi_position": "modified_multi_position",
    "calibrate_multi_position": "multi_position",
    "calibrate_rate_table": "rate_table",
    "calibrate_six_position": "six_position",
    "calibration_from_estimate": "composition",
    "read_calibration": "result",
}


def __getattr__(name: str) -> object:
    """Fetch a name from its module at first use: reading a calibration needs no estimator.

    Raises
    ------
    AttributeError
        If the room has no such name.
    """
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
