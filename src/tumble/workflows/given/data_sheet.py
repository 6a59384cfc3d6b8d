"""What `--data-sheet` names: a grade, or a fleet's own mean and spread as `tumble registry fleet` writes them."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from tumble.calibration.prior import FleetSheet, TriadFleet
from tumble.document.result import Calibration, read_calibration
from tumble.errors import UsageError
from tumble.simulation.grades import GRADES, Grade, find_grade


def find_sheet(name: str | os.PathLike[str]) -> Grade | FleetSheet:
    """Return a data sheet.

    Parameters
    ----------
    name : of a grade, or a file of `tumble registry fleet`.

    Raises
    ------
    UsageError
        If there is no such grade, or the file is no fleet's.
    CalibrationFileError
        If the file cannot be read.
    """
    text = os.fspath(name)
    if text in GRADES or not (Path(text).exists() or text.endswith(".json")):
        return find_grade(text)
    from tumble.fleet.fleet_document import PROCEDURE

    document = read_calibration(text)
    if document.procedure != PROCEDURE:
        raise UsageError(
            f"{text} is a unit's calibration and no fleet's: `tumble registry fleet -o fleet.json` writes one. What "
            "an earlier calibration of the same unit knows, --prior takes."
        )
    return FleetSheet(_triad(document, "accelerometer"), _triad(document, "gyroscope"))


def _triad(document: Calibration, kind: str) -> TriadFleet | None:
    triad = getattr(document.model, kind)
    names = {name: at for at, name in enumerate(document.covariance_parameters)}
    wanted = [f"{kind}.matrix[{i},{j}]" for i in range(3) for j in range(3)]
    wanted += [f"{kind}.bias[{i}]" for i in range(3)]
    if triad is None or not all(name in names for name in wanted):
        return None
    at = [names[name] for name in wanted]
    units = document.raw_units
    unit = units.specific_force if kind == "accelerometer" else units.angular_rate
    return TriadFleet.of(unit, triad.matrix, triad.bias, document.covariance_matrix[np.ix_(at, at)])
