"""What `--prior` names: an earlier calibration of the unit, a file of `tumble registry fleet`, or a grade."""

from __future__ import annotations

import os
from pathlib import Path

from tumble.calibration import FleetSheet, StableKnowledge, TriadFleet, stable_knowledge
from tumble.document import PLACES, Calibration, entry_names, read_calibration, stacked
from tumble.errors import UsageError
from tumble.fleet import PROCEDURE
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
    wanted = [f"accelerometer.matrix[{i},{j}]" for i in range(3) for j in range(3)]
    if not {*wanted} <= {*earlier.covariance_parameters} or earlier.model.accelerometer is None:
        raise UsageError(
            f"{prior} states no accelerometer matrix with its covariance: it cannot serve as --prior."
        )
    place = PLACES["accelerometer.matrix"][0]
    return Known(stable_knowledge(earlier.model.accelerometer.matrix, stacked(earlier)[1][place, place]))


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
    wanted = [name for name in entry_names() if name.startswith((f"{kind}.matrix", f"{kind}.bias"))]
    if triad is None or not {*wanted} <= {*document.covariance_parameters}:
        return None
    place = slice(PLACES[f"{kind}.matrix"][0].start, PLACES[f"{kind}.bias"][0].stop)
    units = document.raw_units
    unit = units.specific_force if kind == "accelerometer" else units.angular_rate
    return TriadFleet.of(unit, triad.matrix, triad.bias, stacked(document)[1][place, place])
