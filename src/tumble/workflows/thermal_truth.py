"""What was true of a simulated unit and temperature, for ``truth.json``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from tumble.sensor.thermal import ThermalModel
    from tumble.simulation import ChamberTruth, ThermalGrade


def thermal_truth(truth: ChamberTruth, grade: ThermalGrade) -> dict[str, Any]:
    """Return the thermal block of a truth, with the names of a calibration's.

    Parameters
    ----------
    truth : the unit and its temperatures.
    grade : what it was drawn from.
    """
    from tumble.sensor.gauge import frame_rotation

    accelerometer = truth.thermal.reference.accelerometer
    in_frame = None
    if accelerometer is not None and np.linalg.det(accelerometer.matrix) > 0.0:
        C_new_b = np.real(frame_rotation(accelerometer.matrix, "accelerometer-x"))
        in_frame = _block(truth.thermal.turned(C_new_b))
    chamber = truth.chamber
    return {
        **_block(truth.thermal),
        "in_frame_accelerometer_x": in_frame,
        "unit_celsius": [float(truth.unit.min()), float(truth.unit.max())],
        "chamber": {
            "rate_k_per_s": chamber.rate,
            "time_constant_s": chamber.time_constant,
            "thermometer_noise_k": chamber.thermometer_noise,
            "thermometer_resolution_k": chamber.thermometer_resolution,
        },
        "source": grade.source,
        "assumed": list(grade.assumed),
    }


def _block(model: ThermalModel) -> dict[str, Any]:
    return {
        "basis": {
            "kind": model.basis.kind,
            "reference_celsius": model.basis.reference_celsius,
            "nodes_celsius": model.basis.nodes.tolist(),
            "order": model.basis.order,
        },
        "parameters": dict(zip(model.names, model.vector().tolist(), strict=True)),
        "lag_s": model.lag,
        "hysteresis_width_k": model.hysteresis_width,
    }
