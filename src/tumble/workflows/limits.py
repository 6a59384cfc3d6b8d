"""A stored calibration held against acceptance limits."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from tumble.document import read_calibration
from tumble.limits import decide, read_limits

if TYPE_CHECKING:
    from tumble.document.limits_block import LimitsBlock


def limits_of(calibration: str | os.PathLike[str], limits: str | os.PathLike[str]) -> LimitsBlock:
    """Return how a calibration's parameters stand to limits.

    Parameters
    ----------
    calibration : a ``calibration.json``, or its folder.
    limits : file of limits.

    Raises
    ------
    CalibrationFileError, UsageError
        If one of the two cannot be read.
    """
    return decide(read_calibration(calibration), read_limits(Path(limits)))
