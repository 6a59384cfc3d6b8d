"""A user's questions, answered from a calibration: after so long without aiding, after such a turn."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Vector, Vectors
from tumble.attitude import left_jacobian, twenty_six_directions
from tumble.calibration import CalibratedUnit, nominal_errors, position_from, sheet_unit
from tumble.document.result import Calibration
from tumble.errors import CalibrationFileError
from tumble.records import dataclass
from tumble.simulation import Grade

SECONDS = (10.0, 60.0)
"""s of free inertial navigation that a report states."""
TURN, TURN_RATE = float(np.radians(90.0)), float(np.radians(30.0))
"""rad and rad/s of the turns that are predicted."""


LOST = 0.5
"""rad of attitude error beyond which the first order says nothing."""


@dataclass(frozen=True)
class Answer:
    """One predicted error.

    Attributes
    ----------
    question : what is asked, in words.
    kind : "position" (m, horizontal) or "attitude" (rad, all three components).
    after : standard uncertainty with the calibration.
    before : error of the uncalibrated unit as the calibration has it; None where raw numbers are counts, and
        infinite where its attitude is lost by then.
    sheet : standard uncertainty of any unit of a grade before calibration; None where no grade was named.
    shares : group of parameters -> its share of the variance of `after`, the largest first.
    """

    question: str
    kind: str
    after: float
    before: float | None
    sheet: float | None
    shares: dict[str, float]


def answers(
    calibration: Calibration,
    *,
    seconds: tuple[float, ...] = SECONDS,
    grade: Grade | None = None,
) -> list[Answer]:
    """Return predicted errors at rest in 26 poses (typical and worst), and after a turn about each axis.

    Parameters
    ----------
    calibration : with uncertainties.
    seconds : s without aiding, up to ten minutes each.
    grade : a kind of unit, for what its data sheet promises without calibration.

    Raises
    ------
    CalibrationFileError
        If it has no matrix, or states no uncertainties.
    ValueError
        If a time is out of bounds.
    """
    model, gravity = calibration.model, calibration.site.gravity
    if not calibration.covariance_parameters:
        raise CalibrationFileError(
            "The calibration states no uncertainties, as one from another tool's file: the errors of what it corrects "
            "cannot be predicted. Calibrate the unit with `tumble calibrate`, which states them."
        )
    unit = CalibratedUnit(
        model, tuple(calibration.covariance_parameters), calibration.covariance_matrix, gravity
    )
    sheet = None if grade is None else _sheet(grade, gravity)
    factors = calibration.raw_units.factors
    made: list[Answer] = []
    if model.accelerometer is not None:
        for t in seconds:
            made += _at_rest(unit, sheet, factors, t)
    if model.gyroscope is not None:
        for i, axis in enumerate("xyz"):
            made.append(_turned(unit, sheet, factors, np.eye(3)[i], axis))
    return made


def _sheet(grade: Grade, gravity: float) -> CalibratedUnit:
    both = grade.accelerometer, grade.gyroscope
    return sheet_unit(
        (both[0].bias, both[1].bias),
        (both[0].scale_factor, both[1].scale_factor),
        (both[0].misalignment, both[1].misalignment),
        gravity,
    )


_Factors = tuple[float | None, float | None]


def _at_rest(
    unit: CalibratedUnit, sheet: CalibratedUnit | None, factors: _Factors, seconds: float
) -> list[Answer]:
    ups = twenty_six_directions()
    each = [unit.position_error(seconds, up) for up in ups]
    after = np.array([p.across(up) for p, up in zip(each, ups, strict=True)])
    before = _nominal_positions(unit, factors, seconds, ups)
    by_sheet = None
    if sheet is not None:
        by_sheet = np.array([_position(sheet, seconds, up) for up in ups])
    worst = int(np.argmax(after))
    typical = int(np.argmin(np.abs(after - _rms(after))))
    rows = (
        ("rms of 26 poses", typical, _rms),
        (f"worst pose (up: {_direction(ups[worst])})", worst, _largest),
    )
    return [
        Answer(
            f"{seconds:g} s at rest, {pose}",
            "position",
            of(after),
            None if before is None else of(before),
            None if by_sheet is None else of(by_sheet),
            _sorted(each[at].shares_across(ups[at])),
        )
        for pose, at, of in rows
    ]


def _position(unit: CalibratedUnit, seconds: float, up: Vector) -> float:
    _, by_rate = unit.output_errors(unit.gravity * up, np.zeros(3))
    turned = seconds * float(np.sqrt(np.trace(by_rate @ unit.covariance @ by_rate.T)))
    return float("inf") if turned > LOST else unit.position_error(seconds, up).across(up)


def _nominal_positions(
    unit: CalibratedUnit, factors: _Factors, seconds: float, ups: Vectors
) -> Series | None:
    made: list[float] = []
    for up in ups:
        force = unit.gravity * up
        shown = nominal_errors(unit.model, force, np.zeros(3), factors)
        if shown is None:
            return None
        if float(np.linalg.norm(shown[1])) * seconds > LOST:
            made.append(float("inf"))
            continue
        error = position_from(shown[0][:, None], shown[1][:, None], force, seconds)[:, 0]
        made.append(float(np.linalg.norm(error - (error @ up) * up)))
    return np.array(made)


def _turned(
    unit: CalibratedUnit,
    sheet: CalibratedUnit | None,
    factors: _Factors,
    axis: Vector,
    name: str,
) -> Answer:
    angle, rate = TURN, TURN_RATE
    seconds = angle / rate
    # Gravity along another axis than that of the turn, as on a table that is level.
    up = np.roll(axis, 1)
    found = unit.attitude_error(axis, angle, seconds, up)
    shown = nominal_errors(unit.model, unit.gravity * up, rate * axis, factors)
    before = None
    if shown is not None:
        before = _unless_lost(float(np.linalg.norm(left_jacobian(angle * axis) @ shown[1] * seconds)))
    by_sheet = None
    if sheet is not None:
        promised = sheet.attitude_error(axis, angle, seconds, up)
        by_sheet = _unless_lost(float(np.sqrt(np.trace(promised.covariance))))
    whole = float(np.trace(found.covariance))
    shares = {name: float(np.trace(part)) / max(whole, 1e-300) for name, part in found.parts.items()}
    question = f"a turn of {np.degrees(angle):g}° about {name} in {seconds:.2g} s"
    return Answer(question, "attitude", float(np.sqrt(whole)), before, by_sheet, _sorted(shares))


def _unless_lost(angle: float) -> float:
    return float("inf") if angle > LOST else angle


def _sorted(shares: dict[str, float]) -> dict[str, float]:
    return dict(sorted(shares.items(), key=lambda item: -item[1]))


def _largest(values: Series) -> float:
    return float(np.max(values))


def _rms(values: Series) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _direction(up: Vector) -> str:
    return " ".join(
        f"{'+' if v > 0 else '−'}{axis}" for v, axis in zip(up, "xyz", strict=True) if abs(v) > 1e-9
    )


def practical(kind: str, value: float) -> tuple[float, str]:
    """Return a predicted error in a unit that people read: m, cm or km; degrees or arc-seconds.

    Parameters
    ----------
    kind : "position" or "attitude".
    value : m or rad.
    """
    if kind == "position":
        if value >= 1000.0:
            return value / 1000.0, "km"
        return (value, "m") if value >= 0.1 else (100.0 * value, "cm")
    degrees = float(np.degrees(value))
    return (degrees, "°") if degrees >= 0.01 else (3600.0 * degrees, "″")
