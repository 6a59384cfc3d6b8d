"""What the unit showed before: holds and turns with nominal values instead of the calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import Series
from tumble.records import dataclass
from tumble.units import angular_rate_factor, specific_force_factor

if TYPE_CHECKING:
    from tumble.recording.recording import Recording
    from tumble.segmentation import HoldMeans, Timeline
    from tumble.sensor import ImuModel


@dataclass(frozen=True, slots=True)
class Uncalibrated:
    """Residuals with nominal values: one per hold (nan where there is none), and what "nominal" is."""

    residuals: Series
    words: str


def nominal_hold_norms(recording: Recording, means: HoldMeans, gravity: float) -> Uncalibrated | None:
    """Return the norm of each hold's raw mean minus `gravity`, m/s².

    Counts have no nominal unit: there the rough six-position values stand for it.
    """
    if means.specific_force is None:
        return None
    factor = specific_force_factor(recording.specific_force_unit)
    if factor is not None:
        return Uncalibrated(
            np.linalg.norm(factor * means.specific_force, axis=1) - gravity, "the raw values in their unit"
        )
    from tumble.calibration.equations.triad_unknowns import BIAS, SCALE, rough_triad

    rough = rough_triad(means.specific_force, gravity)
    corrected = (means.specific_force - rough[BIAS]) / rough[SCALE]
    return Uncalibrated(
        np.linalg.norm(corrected, axis=1) - gravity,
        "rough six-position values of bias and scale, because counts alone mean nothing",
    )


def nominal_turn_angles(
    recording: Recording, timeline: Timeline, means: HoldMeans, model: ImuModel
) -> Uncalibrated | None:
    """Return the angle between gravity carried over each turn and gravity seen after it, rad.

    The gyro's matrix is nominal (diagonal), its bias and the accelerometers are the calibration's, so
    that the difference is what scale and misalignment of the gyro do. The Earth's rotation over a turn
    is left aside.
    """
    gyro, force = model.gyroscope, model.accelerometer
    if gyro is None or force is None or recording.angular_rate is None or recording.specific_force is None:
        return None
    from tumble.attitude import integrate_turns
    from tumble.calibration.equations.gathering import gather
    from tumble.calibration.equations.turn import window_directions

    factor = angular_rate_factor(recording.angular_rate_unit)
    inverse = np.diag(1.0 / np.diag(gyro.matrix)) if factor is None else factor * np.eye(3)
    data = gather(recording, timeline, means)
    turns = np.flatnonzero(data.turn_start >= 0)
    angles = np.full(data.holds, np.nan)
    head, tail = window_directions(data, force.matrix, force.bias, inverse)
    integrated = integrate_turns(
        data.time,
        data.raw_rate,
        data.raw_force,
        data.turn_start[turns],
        data.turn_stop[turns],
        gyro_inverse=inverse,
        gyro_bias=gyro.bias,
        force_inverse=np.asarray(np.linalg.inv(force.matrix), dtype=np.float64),
        force_bias=force.bias,
    )
    carried = np.einsum("tab,tb->ta", integrated.C_start_end, head[turns + 1])
    angles[turns] = np.arctan2(
        np.linalg.norm(np.cross(carried, tail[turns]), axis=1), np.einsum("ta,ta->t", carried, tail[turns])
    )
    words = "the gyro's nominal scale factor on axes taken as perpendicular"
    if factor is None:
        words = (
            "the gyro's estimated scale factors on axes taken as perpendicular (counts have no nominal ones)"
        )
    return Uncalibrated(angles, words)
