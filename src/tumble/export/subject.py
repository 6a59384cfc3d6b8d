"""`Subject`: a calibration made ready for a target: its units, frame and terms, and what is lost on the way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace
from itertools import product

import numpy as np

from tumble.arrays import Matrix, Vectors
from tumble.document.result import Calibration
from tumble.errors import UsageError
from tumble.export import losses
from tumble.export.losses import Loss
from tumble.export.magnetometer import FieldCorrection, field_for
from tumble.export.noise import SensorNoise
from tumble.export.polynomials import NO_CURVES, Polynomials, polynomials_of
from tumble.export.target import BIAS, G_SENSITIVITY, MATRIX, NONLINEAR, SCALE, Target
from tumble.records import dataclass
from tumble.sensor import FRAMES, ImuModel, Triad, change_frame
from tumble.sensor.thermal import ThermalModel
from tumble.units import angular_rate_factor, find_unit, specific_force_factor

LARGEST_LOSS = 0.02
"""Of the true vector's length: a target that would lose more is not written without being told to."""


@dataclass(frozen=True, slots=True)
class Wishes:
    """What the user wants of a conversion.

    Attributes
    ----------
    frame : name of the frame of corrected vectors, or None for the calibration's or the target's own.
    temperature : °C to take a thermal calibration at, or None for its reference temperature.
    largest_loss : of the true vector's length, beyond which nothing is written.
    topic : name of the ROS topic, or None for the one that the recording was made from, or else /imu0.
    """

    frame: str | None = None
    temperature: float | None = None
    largest_loss: float = LARGEST_LOSS
    topic: str | None = None

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises
        ------
        UsageError
            If one is none that a conversion can work with.
        """
        if not 0.0 <= self.largest_loss < np.inf:
            raise UsageError(f"--largest-loss {1e6 * self.largest_loss:g}: give ppm, 0 or more.")


@dataclass(frozen=True, slots=True)
class Subject:
    """What a target writes.

    Attributes
    ----------
    model : raw numbers in `units`; both triads are there, with what the target holds and nominal numbers for the rest.
    units : of raw specific force and angular rate.
    frame, frame_words : of corrected vectors.
    calibration : where it is from, or None for noise alone.
    curves : biases over temperature, for targets that hold them.
    noise : or None.
    losses : what the target does not hold, with its size.
    magnetometer : its correction, for targets that hold one, or None.
    """

    model: ImuModel
    units: tuple[str, str]
    frame: str
    frame_words: str
    calibration: Calibration | None
    wishes: Wishes
    curves: Polynomials = NO_CURVES
    noise: SensorNoise | None = None
    losses: tuple[Loss, ...] = ()
    remarks: tuple[str, ...] = field(default=())
    magnetometer: FieldCorrection | None = None

    @property
    def topic(self) -> str:
        """The ROS topic: the user's, or that of the recordings if they have one, or /imu0."""
        recordings = self.calibration.recordings if self.calibration is not None else ()
        recorded = {one.topic for one in recordings}
        alone = recorded.pop() if len(recorded) == 1 else None
        return self.wishes.topic or alone or "/imu0"

    @property
    def accelerometer(self) -> Triad:
        """The accelerometers."""
        assert self.model.accelerometer is not None
        return self.model.accelerometer

    @property
    def gyroscope(self) -> Triad:
        """The gyros."""
        assert self.model.gyroscope is not None
        return self.model.gyroscope

    def vectors(self) -> tuple[Vectors, Vectors, Vectors, Vectors]:
        """Return three raw specific forces and angular rates in `units`, round numbers, and both corrected (SI)."""
        force = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, -1.0], [3.0, -4.0, 9.0]])
        rate = np.array([[0.1, 0.0, 0.0], [0.0, 0.2, -0.1], [0.3, -0.4, 0.5]])
        raw_force, raw_rate = (_rounded(raw) for raw in self.model.distort(force, rate))
        force, rate = self.model.correct(raw_force, raw_rate)
        return raw_force, raw_rate, force, rate


def _rounded(values: Vectors) -> Vectors:
    """Return numbers of four digits, which a person can type."""
    return np.array([[float(f"{v:.4g}") for v in row] for row in values])


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
        if NONLINEAR not in holds:
            found += losses.of_nonlinearity(triad, name)
            triad = Triad(triad.matrix, triad.bias)
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
    turned = np.linalg.solve(model.accelerometer.matrix, whole.accelerometer.matrix)
    turn: Matrix = np.asarray(turned.T, dtype=np.float64)
    low, high = thermal.span_celsius
    found: list[tuple[float, ImuModel]] = []
    for celsius, state in product(np.linspace(low, high, 9).tolist(), (-1.0, 1.0)):
        true = _both_triads(scaled(thermal.at(celsius, 0.0, state), scale), units, [])
        found.append((celsius, true.turned(turn)))
    return found, f", from {low:g} to {high:g} °C"


def _at_temperature(
    calibration: Calibration, target: Target, wishes: Wishes
) -> tuple[ImuModel, ThermalModel | None, float | None]:
    """The model; what changes with temperature for targets that hold it, else the one temperature."""
    thermal = calibration.thermal_model
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
    def of(name: str) -> float:
        return scale[0] if name.startswith("acc") else scale[1]

    return replace(
        thermal,
        reference=scaled(thermal.reference, scale),
        coefficients={name: of(name) * values for name, values in thermal.coefficients.items()},
        rate_coefficients={name: of(name) * values for name, values in thermal.rate_coefficients.items()},
        hysteresis={name: of(name) * values for name, values in thermal.hysteresis.items()},
    )


def _both_triads(model: ImuModel, units: tuple[str, str], found: list[Loss]) -> ImuModel:
    """A triad that is not calibrated is nominal: one raw unit is one unit."""
    accelerometer, gyroscope = model.accelerometer, model.gyroscope
    if accelerometer is None:
        factor = specific_force_factor(units[0])
        found.append(Loss("the accelerometers are not calibrated: nominal numbers stand in their place"))
        accelerometer = Triad(np.eye(3) / (factor or 1.0), np.zeros(3))
    if gyroscope is None:
        factor = angular_rate_factor(units[1])
        found.append(Loss("the gyros are not calibrated: nominal numbers stand in their place"))
        gyroscope = Triad(np.eye(3) / (factor or 1.0), np.zeros(3))
    return ImuModel(accelerometer, gyroscope, model.g_sensitivity)


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
    return replace(
        model, accelerometer=replace(model.accelerometer, matrix=triangle(model.accelerometer.matrix))
    )


def _refuse_large(subject: Subject, target: Target) -> None:
    limit = subject.wishes.largest_loss
    large = [loss for loss in subject.losses if loss.size is not None and loss.size > limit]
    if large:
        raise UsageError(
            f"{target.title} cannot hold this calibration: {large[0].text}. That is above the limit of "
            f"{1e6 * limit:.0f} ppm; take another target, or accept it with --largest-loss PPM."
        )
