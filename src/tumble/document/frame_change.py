"""A calibration in another frame; its covariance goes with it.

All 45 numbers of a document (matrices, biases, asymmetries, quadratic terms, g-sensitivity) stand in one vector; the
turn is an analytic function of it, so that the covariance is carried exactly to first order by the complex step.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from tumble.arrays import Table
from tumble.document.entries import (
    PLACES,
    entry_names,
    model_of_vector,
    named_parameters,
    part,
    put,
    stacked,
)
from tumble.document.imported import test_vectors, triad_blocks
from tumble.document.part import rows_of
from tumble.document.result import Calibration, FrameBlock
from tumble.document.thermal_block import thermal_block
from tumble.errors import UsageError
from tumble.sensor import FRAMES, ImuModel, frame_rotation, polar_rotation, propagate

Complex = npt.NDArray[Any]


def turned_to(calibration: Calibration, frame: str) -> Calibration:
    """Return the calibration in another frame, covariance and temperature included: nothing is lost.

    Corrected vectors are turned; the turn depends on the matrix that fixes the frame, which the covariance
    counts. Of a thermal block the coefficients are turned with it (the turn's own uncertainty is not counted
    there). A magnetometer is turned, too; of its covariance the turn's own uncertainty is not counted.

    Parameters
    ----------
    calibration : with a matrix of the triad that fixes the frame.
    frame : a name of `FRAMES`.

    Raises
    ------
    UsageError
        If the frame is unknown, the triad that fixes it is missing or left-handed.
    CalibrationFileError
        If the document has no matrix of either triad.
    """
    if frame not in FRAMES:
        raise UsageError(f"There is no frame {frame!r}: choose one of {', '.join(FRAMES)}.")
    model = calibration.model
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
    C, turned = np.real(rotation(values.astype(complex))), model_of_vector(moved, like=model)
    kept = [
        at
        for term, (place, _) in PLACES.items()
        for at in range(place.start, place.stop)
        if _has(turned, term) and np.any(np.diag(spread)[place] > 0.0)
    ]
    names, units = entry_names(), calibration.raw_units
    accelerometer, gyroscope = triad_blocks(turned)
    remark = f"Turned from the frame {calibration.frame.name} to {frame}, covariance carried."
    field, arms = calibration.magnetometer, calibration.lever_arms
    return msgspec.structs.replace(
        calibration,
        frame=FrameBlock(name=frame, description=FRAMES[frame]),
        accelerometer=accelerometer,
        gyroscope=gyroscope,
        parameters=named_parameters(turned, spread, units),
        limits=None,
        covariance_parameters=[names[at] for at in kept],
        covariance=(0.5 * (spread + spread.T))[np.ix_(kept, kept)].tolist(),
        test_vectors=test_vectors(turned, (units.specific_force, units.angular_rate)),
        remarks=[*calibration.remarks, remark],
        thermal=_turned_thermal(calibration, C, turned),
        lever_arms=None if arms is None else rows_of(np.array(arms) @ C.T),
        magnetometer=None if field is None else field.turned(C),
        turn_ons=None,
    )


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


def _has(model: ImuModel, term: str) -> bool:
    if term == "gyroscope.g_sensitivity":
        return model.g_sensitivity is not None
    kind, _, name = term.partition(".")
    triad = getattr(model, kind)
    return triad is not None and getattr(triad, name) is not None
