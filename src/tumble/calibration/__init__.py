"""Procedures: ways to estimate the sensor model from a recorded protocol.

One file a procedure; each builds conditions for `tumble.estimation` and writes no solver of its own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tumble.calibration.estimate import Estimate
    from tumble.calibration.procedures.hand_held import calibrate_hand_held
    from tumble.calibration.procedures.modified_multi_position import calibrate_modified_multi_position
    from tumble.calibration.procedures.multi_position import calibrate_multi_position
    from tumble.calibration.procedures.rate_table import calibrate_rate_table
    from tumble.calibration.procedures.six_position import calibrate_six_position

__all__ = [
    "Estimate",
    "calibrate_hand_held",
    "calibrate_modified_multi_position",
    "calibrate_multi_position",
    "calibrate_rate_table",
    "calibrate_six_position",
]

_MODULES = {
    "Estimate": "estimate",
    "calibrate_hand_held": "procedures.hand_held",
    "calibrate_modified_multi_position": "procedures.modified_multi_position",
    "calibrate_multi_position": "procedures.multi_position",
    "calibrate_rate_table": "procedures.rate_table",
    "calibrate_six_position": "procedures.six_position",
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
