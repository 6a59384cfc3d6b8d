"""Calibrations computed from calibrations: another frame, the inverse, two as one; the covariance goes with them.

All 45 numbers of a document (matrices, biases, asymmetries, quadratic terms, g-sensitivity) stand in one vector; each
operation is an analytic function of it, so that the covariance is carried exactly to first order by the complex step.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import Square, Table
from tumble.document.entries import (
    PLACES,
    SIZE,
    entry_names,
    model_of_vector,
    named_parameters,
    part,
    put,
    stacked,
)
from tumble.document.imported import test_vectors, triad_blocks
from tumble.document.magnetometer_block import MagnetometerBlock
from tumble.document.merging import merge_models
from tumble.document.result import Calibration, FrameBlock, RawUnits
from tumble.document.thermal_block import thermal_block
from tumble.errors import UsageError
from tumble.sensor import FRAMES, ImuModel, frame_rotation, polar_rotation, propagate
from tumble.sensor.gauge import inverse
from tumble.sensor.propagation import jacobian
from tumble.units import angular_rate_factor, specific_force_factor

Complex = npt.NDArray[Any]

RAW_FRAME = "raw axes"
_RAW_WORDS = "the raw output of the sensors themselves, axis by axis: not orthogonal"


def turned_to(calibration: Calibration, frame: str) -> Calibration:
    """Return the calibration in another frame, covariance and temperature included: nothing is lost.

    Corrected vectors are turned; the turn depends on the matrix that fixes the frame, which the covariance
    counts. Of a thermal block the coefficients are turned with it (the turn's own uncertainty is not counted
    there). A magnetometer is turned, too; of its covariance the turn's own uncertainty is not counted.

    Parameters
    ----------
    calibration : of one stage.
    frame : a name of `FRAMES`.

    Raises
    ------
    UsageError
        If the frame is unknown, the triad that fixes it is missing or left-handed, or the document is composed.
    CalibrationFileError
        If the document has no matrix of either triad.
    """
    if calibration.composed_with is not None:
        raise UsageError(
            "A composed calibration has frames: merge it into one first (`tumble compose --merge`)."
        )
    if frame not in FRAMES:
        raise UsageError(f"There is no frame {frame!r}: choose one of {', '.join(FRAMES)}.")
    model = calibration.own_model
    fixed_by = "gyroscope" if frame == "mean-gyro" else "accelerometer"
    triad = getattr(model, fixed_by)
    if triad is None:
        raise UsageError(f"The frame {frame!r} is fixed by the {fixed_by}, which is not calibrated.")
    if np.linalg.det(triad.matrix) <= 0.0:
        raise UsageError(
            f"The {fixed_by} matrix is left-handed: an axis is reversed; put its sign right first."
        )

    def rotation(x: Complex) -> Complex:
        matrix = part(x, f"{fixed_by}.matrix")
        return polar_rotation(matrix) if frame == "mean-gyro" else frame_rotation(matrix, frame)

    def turn(x: Complex) -> Complex:
        C = rotation(x)
        moved = x.copy()
        for name in ("accelerometer.matrix", "gyroscope.matrix", "gyroscope.g_sensitivity"):
            put(moved, name, part(x, name) @ C.T)
        return moved

    values, covariance = stacked(calibration)
    moved, spread = propagate(turn, values, covariance)
    return _document(
        calibration,
        model_of_vector(moved, like=model),
        spread,
        frame=FrameBlock(name=frame, description=FRAMES[frame]),
        thermal=_turned_thermal(
            calibration, np.real(rotation(values.astype(complex))), model_of_vector(moved, model)
        ),
        remark=f"turned from the frame {calibration.frame.name} to {frame}, covariance carried",
        lever_arms=_turned_arms(calibration, np.real(rotation(values.astype(complex)))),
        magnetometer=None
        if calibration.magnetometer is None
        else calibration.magnetometer.turned(np.real(rotation(values.astype(complex)))),
    )


def _turned_arms(calibration: Calibration, C: Table) -> Any:
    """The accelerometers' places along the axes of another frame."""
    if calibration.lever_arms is None:
        return None
    return tuple(tuple(float(v) for v in row) for row in np.array(calibration.lever_arms) @ C.T)


def _turned_thermal(calibration: Calibration, C: Table, reference: ImuModel) -> Any:
    """The thermal block with coefficients of matrices turned; biases are the sensors' own."""
    thermal = calibration.thermal_model
    if thermal is None or calibration.thermal is None:
        return None
    other = replace(thermal.turned(C), reference=reference)
    names = list(calibration.thermal.covariance_parameters)
    effect = np.eye(len(names))
    place = {name: at for at, name in enumerate(names)}
    for name, at in place.items():
        stem, _, index = name.rstrip("]").rpartition("[")
        if ("matrix" in stem or "g_sensitivity" in stem) and index.count(",") == 2:
            k, i, j = index.split(",")
            effect[at, at] = 0.0
            for m in range(3):
                effect[at, place[f"{stem}[{k},{i},{m}]"]] = C[int(j), m]
    covariance = effect @ np.array(calibration.thermal.covariance) @ effect.T
    return thermal_block(other, names, covariance)


def inverted(calibration: Calibration) -> Calibration:
    """Return the calibration that makes raw numbers (SI) of corrected ones: it undoes the other.

    ``raw = M true + b`` gives ``M^-1`` and ``-M^-1 b``; a g-sensitivity G gives ``-M_g^-1 G M_a^-1`` on what is then
    the specific force, and adds ``M_g^-1 G M_a^-1 b_a`` to the gyros' bias. It takes recordings that the other has
    corrected, as their columns say.

    Raises
    ------
    UsageError
        If it has terms that have no inverse of this form (asymmetry, quadratic, temperature), is composed, or
        is in counts.
    CalibrationFileError
        If the document has no matrix of either triad.
    """
    if calibration.composed_with is not None:
        raise UsageError("A composed calibration is inverted stage by stage, the last one first.")
    if calibration.thermal is not None:
        raise UsageError("A calibration that changes with temperature has no inverse of this form.")
    model = calibration.own_model
    for triad in (model.accelerometer, model.gyroscope):
        if triad is not None and not triad.is_straight:
            raise UsageError("A calibration with asymmetry or quadratic terms has no inverse of this form.")
    units = calibration.raw_units
    factors = (specific_force_factor(units.specific_force), angular_rate_factor(units.angular_rate))
    if None in factors:
        raise UsageError("A calibration that takes counts cannot be inverted: what it would give is not SI.")
    force_factor, rate_factor = (float(f or 1.0) for f in factors)
    has_force, has_rate = model.accelerometer is not None, model.gyroscope is not None

    def undo(x: Complex) -> Complex:
        result = np.zeros(SIZE, dtype=x.dtype)
        force = inverse(force_factor * part(x, "accelerometer.matrix")) if has_force else None
        b_a = force_factor * part(x, "accelerometer.bias")
        if force is not None:
            put(result, "accelerometer.matrix", force)
            put(result, "accelerometer.bias", -(force @ b_a))
        if has_rate:
            rate = inverse(rate_factor * part(x, "gyroscope.matrix"))
            bias = -(rate @ (rate_factor * part(x, "gyroscope.bias")))
            if force is not None:
                coupled = rate @ (rate_factor * part(x, "gyroscope.g_sensitivity")) @ force
                put(result, "gyroscope.g_sensitivity", -coupled)
                bias = bias + coupled @ b_a
            put(result, "gyroscope.matrix", rate)
            put(result, "gyroscope.bias", bias)
        return result

    values, covariance = stacked(calibration)
    moved, spread = propagate(undo, values, covariance)
    document = _document(
        calibration,
        model_of_vector(moved, like=model),
        spread,
        frame=FrameBlock(name=RAW_FRAME, description=_RAW_WORDS),
        remark=f"the inverse of calibration {calibration.identity}: from corrected to raw numbers in m/s² and rad/s",
        units=RawUnits(specific_force="m/s^2", angular_rate="rad/s"),
    )
    return document.model_copy(
        update={"input_corrected_by": [*calibration.input_corrected_by, calibration.identity]}
    )


def merged(calibration: Calibration) -> Calibration:
    """Return a composed calibration as one matrix and bias a triad, where that is exact.

    The stages' errors are taken as independent.

    Raises
    ------
    UsageError
        If a stage has asymmetry, quadratic terms or temperature, or they are of different triads.
    CalibrationFileError
        If a stage has no matrix of either triad.
    """
    if any(stage.thermal is not None for stage in calibration.stages):
        raise UsageError(
            "Calibrations with temperature one after another are no single one: leave --merge out."
        )
    first = calibration.stages[0]
    model = first.own_model
    values, covariance = stacked(first)
    for stage in calibration.stages[1:]:
        model = merge_models(model, stage.own_model)
        more, spread = stacked(stage)
        both = np.concatenate([values, more])
        joint = np.block([[covariance, np.zeros((SIZE, SIZE))], [np.zeros((SIZE, SIZE)), spread]])
        effect = jacobian(_chained, both)
        values, covariance = np.real(_chained(both.astype(complex))), effect @ joint @ effect.T
    last = calibration.stages[-1]
    document = _document(
        last,
        model,
        covariance,
        frame=last.frame,
        remark=f"{len(calibration.stages)} calibrations one after another as one: "
        + ", ".join(stage.identity for stage in calibration.stages),
        units=first.raw_units,
    )
    return document.model_copy(
        update={"input_corrected_by": list(first.input_corrected_by), "composed_with": None}
    )


def _chained(x: Complex) -> Complex:
    """`merge_models` on two vectors of 45 (analytic)."""
    one, two = x[:SIZE], x[SIZE:]
    result = np.zeros(SIZE, dtype=x.dtype)
    for kind in ("accelerometer", "gyroscope"):
        matrix = part(one, f"{kind}.matrix")
        put(result, f"{kind}.matrix", matrix @ part(two, f"{kind}.matrix"))
        put(result, f"{kind}.bias", matrix @ part(two, f"{kind}.bias") + part(one, f"{kind}.bias"))
    first, name = part(one, "gyroscope.g_sensitivity"), "gyroscope.g_sensitivity"
    put(
        result,
        name,
        part(one, "gyroscope.matrix") @ part(two, name) + first @ part(two, "accelerometer.matrix"),
    )
    bias = part(result, "gyroscope.bias") + first @ part(two, "accelerometer.bias")
    put(result, "gyroscope.bias", bias)
    return result


def _document(
    calibration: Calibration,
    model: ImuModel,
    spread: Square,
    *,
    frame: FrameBlock,
    remark: str,
    thermal: Any = None,
    units: RawUnits | None = None,
    lever_arms: Any = None,
    magnetometer: MagnetometerBlock | None = None,
) -> Calibration:
    """The document with another model and covariance; what is told of a triad that was told before."""
    units = units or calibration.raw_units
    names = entry_names()
    sigma = np.sqrt(np.maximum(np.diag(spread), 0.0))
    kept = [
        at
        for term, (place, _) in PLACES.items()
        for at in range(place.start, place.stop)
        if _has(model, term) and np.any(sigma[place] > 0.0)
    ]
    accelerometer, gyroscope = triad_blocks(model)
    if lever_arms is None and any(stage.lever_arms is not None for stage in calibration.stages):
        remark += "; the accelerometers' lever arms are not in it"
    if magnetometer is None and any(stage.magnetometer is not None for stage in calibration.stages):
        remark += "; the magnetometer is not in it"
    return calibration.model_copy(
        update={
            "frame": frame,
            "raw_units": units,
            "accelerometer": accelerometer,
            "gyroscope": gyroscope,
            "parameters": named_parameters(model, spread, units),
            "limits": None,
            "covariance_parameters": [names[at] for at in kept],
            "covariance": (0.5 * (spread + spread.T))[np.ix_(kept, kept)].tolist(),
            "test_vectors": test_vectors(model, (units.specific_force, units.angular_rate)),
            "remarks": [*calibration.remarks, remark[0].upper() + remark[1:] + "."],
            "thermal": thermal,
            "lever_arms": lever_arms,
            "magnetometer": magnetometer,
            "turn_ons": None,
        }
    )


def _has(model: ImuModel, term: str) -> bool:
    if term == "gyroscope.g_sensitivity":
        return model.g_sensitivity is not None
    kind, _, name = term.partition(".")
    triad = getattr(model, kind)
    return triad is not None and getattr(triad, name) is not None
