"""A magnetometer's correction as other tools write it down: ``x = S (u - h)``, and the symmetric S of autopilots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tumble.arrays import Matrix, Vector, Vectors, inverted
from tumble.document.result import Calibration
from tumble.errors import UsageError
from tumble.export.losses import Loss
from tumble.export.target import Target
from tumble.records import dataclass
from tumble.sensor import change_frame, polar_rotation
from tumble.units import MICROTESLA, find_unit, magnetic_field_factor

LOCAL = "local field"


@dataclass(frozen=True, slots=True)
class FieldCorrection:
    """What corrects a magnetometer: ``x = soft_iron @ (u - hard_iron)``.

    Attributes
    ----------
    soft_iron : (3, 3) units of x per raw unit.
    hard_iron : (3,) raw.
    raw_unit, unit : of u ("counts" among them) and of x: "uT", "gauss", "mgauss" or "local field".
    axes : along which x is, in words.
    norm : of the field in which it was found, in units of x.
    """

    soft_iron: Matrix
    hard_iron: Vector
    raw_unit: str
    unit: str
    axes: str
    norm: float

    def correct(self, raw: Vectors) -> Vectors:
        """Return the corrected field of (samples, 3) raw numbers."""
        return (raw - self.hard_iron) @ self.soft_iron.T

    def vectors(self) -> tuple[Vectors, Vectors]:
        """Return three raw fields, round numbers, and the corrected ones."""
        directions = np.array([[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [-0.36, 0.48, 0.8]])
        raw = self.hard_iron + np.linalg.solve(self.soft_iron, self.norm * directions.T).T
        raw = np.array([[float(f"{v:.4g}") for v in row] for row in raw])
        return raw, self.correct(raw)

    def in_units(self, raw_unit: str, unit: str) -> FieldCorrection | None:
        """Return the same for other units of magnetic field; None where counts or an unknown norm do not allow it.

        Parameters
        ----------
        raw_unit, unit : that `tumble.units` knows.
        """
        own, out = magnetic_field_factor(self.raw_unit), magnetic_field_factor(unit)
        wanted = magnetic_field_factor(raw_unit)
        if own is None or wanted is None or out is None or self.unit == LOCAL:
            return None
        before = magnetic_field_factor(self.unit)
        assert before is not None
        return FieldCorrection(
            self.soft_iron * (wanted / own) * (before / out),
            self.hard_iron * (own / wanted),
            raw_unit,
            unit,
            self.axes,
            self.norm * before / out,
        )


def field_correction(calibration: Calibration, frame: str) -> FieldCorrection | None:
    """Return the magnetometer's correction, x in µT where the norm is known; None without one.

    Parameters
    ----------
    calibration : with or without one.
    frame : of corrected vectors.
    """
    if calibration.magnetometer is None:
        return None
    block, triad = calibration.magnetometer, calibration.magnetometer.triad
    if triad is None:
        return None
    axes = "of the magnetometer itself: nothing says how they lie against the accelerometers'"
    if block.frame == "b":
        axes = f"of the frame {frame}"
        if frame != calibration.frame.name:
            turned = change_frame(replace(calibration.model, magnetometer=triad), frame).magnetometer
            assert turned is not None
            triad = turned
    known = block.unit == "T"
    factor = 1.0 / MICROTESLA if known else 1.0
    return FieldCorrection(
        factor * inverted(triad.matrix),
        triad.bias,
        find_unit("magnetic field", block.raw_unit) or block.raw_unit,
        "uT" if known else LOCAL,
        axes,
        factor * (1.0 if block.field is None else block.field.norm),
    )


def without_rotation(made: FieldCorrection, title: str, own: Matrix) -> tuple[FieldCorrection, list[Loss]]:
    """Return the correction with a symmetric matrix, and what that loses: the rotation to the other sensors' axes.

    The norm of the field stays as it is: ``S = R K`` with K symmetric, and K is written.

    Parameters
    ----------
    made : with any matrix.
    title : of the tool.
    own : (3, 3) the part of R that the tool makes by itself, which is not lost.
    """
    turn = np.real(polar_rotation(made.soft_iron.T)).T
    kept = turn.T @ made.soft_iron
    cosine = 0.5 * (np.trace(turn @ own.T) - 1.0)
    angle = float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
    symmetric = replace(made, soft_iron=0.5 * (kept + kept.T), axes="of the magnetometer itself")
    if angle < 1e-4:
        return symmetric, []
    # The largest difference of a vector and the turned one, of its length.
    size = float(2.0 * np.sin(0.5 * np.radians(angle)))
    text = (
        f"the magnetometer is turned by {angle:.3g} deg against the accelerometers' axes ({1e6 * size:.0f} ppm). "
        f"{title} has a symmetric matrix without that rotation: headings are off by up to as much"
    )
    return symmetric, [Loss(text, size)]


def field_for(
    calibration: Calibration, frame: str, target: Target, limit: float
) -> tuple[FieldCorrection | None, list[Loss]]:
    """Return the magnetometer's correction as a target takes it, or None, and what is lost: the rotation, or all of it.

    One that is turned by more than the limit is left out. What else a file holds is no worse for it.

    Parameters
    ----------
    calibration : with or without a magnetometer.
    frame : of corrected vectors.
    target : that takes any matrix, or a symmetric one in a unit of its own.
    limit : of a rotation's effect, of the true vector's length.

    Raises
    ------
    UsageError
        If the target is of a magnetometer alone, and this one cannot be written.
    """
    known = field_correction(calibration, frame)
    if target.magnetometer is None:
        lost = [] if known is None or not target.corrects else [Loss(_ELSEWHERE.format(title=target.title))]
        return None, lost
    if known is None:
        unfit = calibration.magnetometer is not None and calibration.magnetometer.unfit
        if not target.needs_magnetometer:
            return None, [Loss(_UNFIT)] if unfit else []
        why = "'s is not fit for use. Its verdict in calibration.json says why."
        if not unfit:
            why = " has none. Calibrate a recording that has one."
        raise UsageError(f"{target.title} holds a magnetometer, and the calibration{why}")
    if target.magnetometer == "any":
        return known, []
    unit = target.magnetometer
    field = known.in_units(unit, unit)
    if field is None:
        if target.needs_magnetometer:
            raise UsageError(
                f"{target.tool} works in µT, and the magnetometer's calibration takes counts or does not know the "
                "field's norm: say the unit with --units when you calibrate."
            )
        return None, [Loss(_NOT_WRITTEN.format(title=target.tool, unit=unit.replace("mgauss", "milligauss")))]
    block = calibration.magnetometer
    assert block is not None
    # The raw unit tells whose log it was: another firmware turns a compass otherwise.
    own = None if (known.raw_unit, block.frame) != (unit, "b") else block.turn
    field, lost = without_rotation(field, target.tool, np.eye(3) if own is None else np.array(own))
    beyond = [loss for loss in lost if loss.size is not None and loss.size > limit]
    if beyond and not target.needs_magnetometer:
        return None, [Loss(f"the magnetometer is left out (--largest-loss PPM writes it): {beyond[0].text}")]
    return field, lost


def field_lines(made: FieldCorrection, formula: str) -> list[str]:
    """Return what a comment says of a magnetometer: formula, units, test vector.

    Parameters
    ----------
    made : what is written.
    formula : in the tool's own names.
    """
    raw, true = made.vectors()
    unit = "units of the local field" if made.unit == LOCAL else made.unit
    return [
        f"magnetometer: {formula}; raw in {made.raw_unit}, corrected in {unit} along the axes {made.axes}",
        f"test vector: raw magnetic field {_row(raw[2])} corrected to {_row(true[2])}",
    ]


def _row(values: Sequence[float] | Vector) -> str:
    return "[" + ", ".join(f"{v:.9g}" for v in values) + "]"


_NOT_WRITTEN = (
    "the magnetometer is left out: it takes counts or the field's norm is not known, and {title} works in {unit} "
    "(calibrate with --units and --field)"
)
_UNFIT = "the magnetometer is left out: its calibration is not fit for use"
_ELSEWHERE = "the magnetometer is left out: {title} holds none"
