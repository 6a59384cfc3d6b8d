"""What `--prior` names: an earlier calibration of the unit, a file of `tumble registry fleet`, or a grade."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from tumble.calibration.prior import FleetSheet, StableKnowledge, TriadFleet, stable_knowledge
from tumble.document.result import Calibration, read_calibration
from tumble.errors import UsageError
from tumble.fleet.fleet_document import PROCEDURE
from tumble.records import dataclass
from tumble.simulation import grades


@dataclass(frozen=True)
class Known:
    """What is known before a recording: the angles of the unit itself, or the spreads of its kind."""

    angles: StableKnowledge | None = None
    sheet: grades.Grade | FleetSheet | None = None


def known_beforehand(prior: str | os.PathLike[str], serial: str | None = None) -> Known:
    """Return what is known before a recording of the unit itself, or of its kind.

    Parameters
    ----------
    prior : a calibration.json of the unit, or the folder with it, whose accelerometer angles are kept; a file of
        `tumble registry fleet`; or the name of a grade.
    serial : of the unit, if it is known.

    Raises
    ------
    CalibrationFileError
        If the file cannot be read, or states no uncertainty of the angles.
    UsageError
        If there is no such grade, or the calibration is of another unit or states no accelerometer matrix.
    """
    text = os.fspath(prior)
    if text in grades.GRADES or not (Path(text).exists() or text.endswith(".json")):
        return Known(sheet=grades.find_grade(text))
    earlier = read_calibration(text)
    if earlier.procedure == PROCEDURE:
        return Known(sheet=FleetSheet(_triad(earlier, "accelerometer"), _triad(earlier, "gyroscope")))
    if serial is not None and earlier.imu.serial_number not in (None, serial):
        raise UsageError(
            f"{prior} is the calibration of unit {earlier.imu.serial_number}, and this is unit {serial}: "
            "a prior must be of the same unit."
        )
    size = len(earlier.covariance_parameters)
    names = {name: index for index, name in enumerate(earlier.covariance_parameters)}
    at = [names.get(f"accelerometer.matrix[{i},{j}]", size) for i in range(3) for j in range(3)]
    if size in at or earlier.accelerometer is None or earlier.accelerometer.matrix is None:
        raise UsageError(
            f"{prior} states no accelerometer matrix with its covariance: it cannot serve as --prior."
        )
    matrix = np.array(earlier.accelerometer.matrix, dtype=float)
    return Known(stable_knowledge(matrix, earlier.covariance_matrix[np.ix_(at, at)]))


def find_sheet(name: str | os.PathLike[str]) -> grades.Grade | FleetSheet:
    """Return a data sheet: a grade, or a file of `tumble registry fleet`.

    Parameters
    ----------
    name : of a grade, or the file.

    Raises
    ------
    UsageError
        If there is no such grade, or the file is a unit's calibration.
    CalibrationFileError
        If the file cannot be read.
    """
    sheet = known_beforehand(name).sheet
    if sheet is None:
        raise UsageError(
            f"{name} is a unit's calibration and no fleet's: `tumble registry fleet -o fleet.json` writes one."
        )
    return sheet


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
