"""A calibration prepared for a target: its units, frame and terms, its magnetometer, and what is lost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from tumble.arrays import Matrix, inverted
from tumble.document import Calibration
from tumble.errors import UsageError
from tumble.export import losses
from tumble.export.losses import Loss
from tumble.export.polynomials import NO_CURVES, polynomials_of
from tumble.export.subject import LOCAL, FieldCorrection, SensorNoise, Subject, Wishes
from tumble.export.target import BIAS, CURVED, G_SENSITIVITY, MATRIX, NONLINEAR, SCALE, Target
from tumble.sensor import FRAMES, ImuModel, ThermalModel, Triad, change_frame, polar_rotation
from tumble.units import MICROTESLA, angular_rate_factor, find_unit, specific_force_factor


def prepare(
    calibration: Calibration | None,
    target: Target,
    wishes: Wishes | None = None,
    noise: SensorNoise | None = None,
) -> Subject:
    """Return the calibration in a target's units and frame, with what gets lost.

    Parameters
    ----------
    calibration : None for a target that holds noise alone.
    target : whose form it is to get.
    wishes : of the user.
    noise : coefficients, for targets that hold them.

    Raises
    ------
    UsageError
        If something that the target needs is missing, the units cannot be had, or more would be lost than
        the wishes allow.
    CalibrationFileError
        If the calibration has no matrix of either triad.
    """
    wishes = wishes or Wishes()
    if target.needs_noise and noise is None:
        raise UsageError(
            f"{target.title} wants noise: give the noise.json that `tumble noise -o` wrote with --noise."
        )
    if calibration is None:
        if not target.needs_noise:
            raise UsageError(f"{target.title} holds a calibration: name its calibration.json first.")
        return Subject(ImuModel.ideal(), ("m/s^2", "rad/s"), "", "", None, wishes, noise=noise)
    found: list[Loss] = []
    said: list[str] = []
    model, thermal, celsius = _at_temperature(calibration, target, wishes)
    if calibration.lever_arms is not None and target.accelerometer:
        found.append(losses.of_lever_arms(np.array(calibration.lever_arms, dtype=np.float64)))
    scale, units = _in_units(model, calibration, target)
    model = _both_triads(scaled(model, scale), units, found)
    whole, frame = _in_frame(model, thermal, calibration, target, wishes)
    if frame != calibration.frame.name:
        said.append(
            f"corrected vectors are in the frame {frame}, not in the calibration's {calibration.frame.name}"
        )
    curves = NO_CURVES
    if thermal is not None:
        curves, lost = polynomials_of(_scaled_thermal(thermal, scale))
        found += lost
    kept = curves.at(curves.reference, _projected(whole, target, units, found))
    magnetometer, of_field = field_for(calibration, frame, target, wishes.largest_loss)
    found += [*(Loss(text) for text in target.loses), *of_field]
    if not target.corrects:
        # Of all that has no place in it, the whole is stated.
        found = of_field
    there, span = _there(calibration, model, whole, scale, units)
    if celsius is not None and target.corrects:
        found.insert(0, losses.of_temperature([(true, whole) for _, true in there], celsius, span))
    if target.corrects or None not in (specific_force_factor(units[0]), angular_rate_factor(units[1])):
        pairs = [(true, curves.at(warm, kept)) for warm, true in there] or [(whole, kept)]
        found[:0] = losses.in_all(pairs, span, corrects=target.corrects)
    subject = Subject(
        kept,
        units,
        frame,
        FRAMES.get(frame, calibration.frame.description),
        calibration,
        wishes,
        curves,
        noise,
        tuple(found),
        tuple(said),
        magnetometer,
    )
    _refuse_large(subject, target)
    return subject


def _projected(model: ImuModel, target: Target, units: tuple[str, str], found: list[Loss]) -> ImuModel:
    """Keep what the target holds, take nominal numbers for the rest, and note what that loses."""
    sensitivity = model.g_sensitivity
    triads: list[Triad] = []
    for name, triad, holds, factor in (
        ("accelerometers", model.accelerometer, target.accelerometer, specific_force_factor(units[0])),
        ("gyros", model.gyroscope, target.gyroscope, angular_rate_factor(units[1])),
    ):
        assert triad is not None
        lost = replace(triad, **dict.fromkeys(CURVED if NONLINEAR in holds else ()))
        found += losses.of_nonlinearity(lost, name)
        triad = replace(triad, **dict.fromkeys(curve for curve, *_ in lost.curves()))
        if sensitivity is not None and name == "gyros" and G_SENSITIVITY not in holds:
            found.append(losses.of_g_sensitivity(triad, sensitivity))
            sensitivity = None
        matrix, bias = triad.matrix, triad.bias
        if SCALE in holds:
            matrix = np.diag(np.diag(triad.matrix))
            found += losses.of_matrix(triad, matrix, name, "misalignments (off-diagonals)")
        elif MATRIX not in holds:
            matrix = np.eye(3) / (factor or 1.0)
            found += losses.of_matrix(triad, matrix, name, "scale factors and misalignments")
        if BIAS not in holds:
            bias = np.zeros(3)
            found += losses.of_bias(triad, name)
        triads.append(replace(triad, matrix=matrix, bias=bias))
    return ImuModel(triads[0], triads[1], sensitivity)


def _there(
    calibration: Calibration, model: ImuModel, whole: ImuModel, scale: Sequence[float], units: tuple[str, str]
) -> tuple[list[tuple[float, ImuModel]], str]:
    """The true models at temperatures of a calibration with temperature, turned as `model` was to be `whole`."""
    thermal = calibration.thermal_model
    if thermal is None:
        return [], ""
    assert model.accelerometer is not None
    assert whole.accelerometer is not None
    turn = np.linalg.solve(model.accelerometer.matrix, whole.accelerometer.matrix).T
    low, high = thermal.span_celsius
    found: list[tuple[float, ImuModel]] = []
    for celsius, state in product(np.linspace(low, high, 9).tolist(), (-1.0, 1.0)):
        true = _both_triads(scaled(thermal.at(celsius, 0.0, state), scale), units, [])
        found.append((celsius, true.turned(np.asarray(turn, dtype=np.float64))))
    return found, f", from {low:g} to {high:g} °C"


def _at_temperature(
    calibration: Calibration, target: Target, wishes: Wishes
) -> tuple[ImuModel, ThermalModel | None, float | None]:
    """The model; what changes with temperature for targets that hold it, else the one temperature."""
    thermal = calibration.thermal_model
    if thermal is None and wishes.temperature is not None:
        raise UsageError("The calibration has no thermal model: leave --at-temperature out.")
    if thermal is None or (target.temperature and wishes.temperature is None):
        return calibration.model, thermal, None
    celsius = thermal.basis.reference_celsius if wishes.temperature is None else wishes.temperature
    low, high = thermal.span_celsius
    if not low - 2.0 <= celsius <= high + 2.0:
        raise UsageError(
            f"The calibration is of {low:g} to {high:g} °C: it cannot be taken at {celsius:g} °C (--at-temperature)."
        )
    return thermal.at(celsius), None, celsius


def _in_units(
    model: ImuModel, calibration: Calibration, target: Target
) -> tuple[list[float], tuple[str, str]]:
    """What raw numbers are to be multiplied by, and the units that they then have."""
    given = calibration.raw_units
    # As the units are called here, for the document may have another spelling, and the names go into programs.
    own = (
        find_unit("specific force", given.specific_force) or given.specific_force,
        find_unit("angular rate", given.angular_rate) or given.angular_rate,
    )
    if target.units is None or not target.corrects:
        return [1.0, 1.0], own
    ours = (specific_force_factor(own[0]), angular_rate_factor(own[1]))
    theirs = (specific_force_factor(target.units[0]), angular_rate_factor(target.units[1]))
    scale: list[float] = []
    for number, (from_si, to_si, triad) in enumerate(
        zip(ours, theirs, (model.accelerometer, model.gyroscope), strict=True)
    ):
        assert to_si is not None
        if from_si is None and triad is not None:
            raise UsageError(
                f"The calibration takes counts, and {target.title} works on {target.units[number]}. Calibrate again "
                "and say how many counts the driver takes for one unit, as --units '16384 LSB/g,131 LSB/(deg/s)'."
            )
        scale.append((from_si or 1.0) / to_si)
    return scale, target.units


def scaled(model: ImuModel, scale: Sequence[float]) -> ImuModel:
    """Return a model whose raw numbers are larger by `scale`, of specific force and of angular rate."""
    return ImuModel(
        None if model.accelerometer is None else model.accelerometer.in_raw_unit(scale[0]),
        None if model.gyroscope is None else model.gyroscope.in_raw_unit(scale[1]),
        None if model.g_sensitivity is None else scale[1] * model.g_sensitivity,
    )


def _scaled_thermal(thermal: ThermalModel, scale: Sequence[float]) -> ThermalModel:
    groups = {
        group: {
            name: scale[not name.startswith("acc")] * values
            for name, values in getattr(thermal, group).items()
        }
        for group in ("coefficients", "rate_coefficients", "hysteresis")
    }
    return replace(thermal, reference=scaled(thermal.reference, scale), **groups)


def _both_triads(model: ImuModel, units: tuple[str, str], found: list[Loss]) -> ImuModel:
    """A triad that is not calibrated is nominal: one raw unit is one unit."""

    def nominal(name: str, factor: float | None) -> Triad:
        found.append(Loss(f"the {name} are not calibrated: nominal numbers stand in their place"))
        return Triad(np.eye(3) / (factor or 1.0), np.zeros(3))

    return ImuModel(
        model.accelerometer or nominal("accelerometers", specific_force_factor(units[0])),
        model.gyroscope or nominal("gyros", angular_rate_factor(units[1])),
        model.g_sensitivity,
    )


def _in_frame(
    model: ImuModel, thermal: ThermalModel | None, calibration: Calibration, target: Target, wishes: Wishes
) -> tuple[ImuModel, str]:
    frame = target.frame or wishes.frame or calibration.frame.name
    if target.frame is not None and wishes.frame not in (None, target.frame):
        raise UsageError(
            f"{target.title} can only be in the frame {target.frame}, not in {wishes.frame}: leave --frame out."
        )
    if frame == calibration.frame.name:
        return model, frame
    if thermal is not None:
        raise UsageError(
            f"A calibration with temperature is written in its own frame: leave --frame {frame} out."
        )
    return _with_zeros(change_frame(model, frame), frame), frame


def _with_zeros(model: ImuModel, frame: str) -> ImuModel:
    """What is zero by the frame's definition is zero exactly, not to round-off."""
    triangle = {"accelerometer-x": np.tril, "accelerometer-z": np.triu}.get(frame)
    if triangle is None or model.accelerometer is None:
        return model
    triad = replace(model.accelerometer, matrix=triangle(model.accelerometer.matrix))
    return replace(model, accelerometer=triad)


def _refuse_large(subject: Subject, target: Target) -> None:
    limit = subject.wishes.largest_loss
    large = [loss for loss in subject.losses if loss.size is not None and loss.size > limit]
    if large:
        raise UsageError(
            f"{target.title} cannot hold this calibration: {large[0].text}. That is above the limit of "
            f"{1e6 * limit:.0f} ppm; take another target, or accept it with --largest-loss PPM."
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
        f"the magnetometer is turned by {angle:.3g}° against the accelerometers' axes ({1e6 * size:.0f} ppm). "
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


_NOT_WRITTEN = (
    "the magnetometer is left out: it takes counts or the field's norm is not known, and {title} works in {unit} "
    "(calibrate with --units and --field)"
)
_UNFIT = "the magnetometer is left out: its calibration is not fit for use"
_ELSEWHERE = "the magnetometer is left out: {title} holds none"
