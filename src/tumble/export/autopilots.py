"""What PX4 and ArduPilot have in common: offsets and scale factors along the sensing axes, nothing off the diagonal."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from tumble.arrays import AnyArray
from tumble.errors import CalibrationFileError
from tumble.export import losses
from tumble.export.curves import Curve, thermal_of
from tumble.export.subject import Subject, with_losses
from tumble.export.target import Imported
from tumble.sensor import ImuModel, Triad

Found = dict[str, dict[tuple[str, str, str], float]]
"""By triad: values by number of the unit, axis, and ``offset`` or ``scale``."""


def diagonal(subject: Subject, title: str) -> Subject:
    """Return the subject with scale factors alone for accelerometers and nominal ones for gyros, and what that loses.

    Raises
    ------
    UsageError
        If more is lost than the wishes allow.
    """
    accelerometer, gyroscope = subject.accelerometer, subject.gyroscope
    kept = np.diag(np.diag(accelerometer.matrix))
    lost = losses.of_matrix(accelerometer, kept, "accelerometers", "misalignments (off-diagonals)")
    lost += losses.of_matrix(gyroscope, np.eye(3), "gyros", "scale factors and misalignments")
    model = ImuModel(Triad(kept, accelerometer.bias), Triad(np.eye(3), gyroscope.bias))
    return with_losses(subject, model, lost, title)


def from_parameters(
    found: Found,
    path: Path,
    tool: str,
    curve_of: Callable[[str, str, Triad, list[str]], Curve | None],
) -> Imported:
    """Return the first unit of an autopilot's parameters.

    Parameters
    ----------
    found : both triads.
    path, tool : for the sentences.
    curve_of : returns the bias over temperature of a triad, given its kind, its number and what it is without; it
        adds to the remarks.

    Raises
    ------
    CalibrationFileError
        If nothing of a calibration is in it, an axis is missing, or a number is none that a calibration has.
    """
    if not any(found.values()):
        raise CalibrationFileError(f"{path} has no calibration parameters of {tool}.")
    remarks: list[str] = []
    triads: dict[str, Triad | None] = {}
    curves: dict[str, Curve] = {}
    for kind, entries in found.items():
        triad = triads[kind] = _first(kind, entries, path) if entries else None
        if len({number for number, _, _ in entries}) > 1:
            remarks.append(f"the file has several {kind}s: the first one was read")
        if triad is not None:
            curve = curve_of(kind, min(key[0] for key in entries), triad, remarks)
            if curve is not None:
                curves[kind] = curve
    model = ImuModel(triads["accelerometer"], triads["gyroscope"])
    thermal, said = thermal_of(model, curves, path)
    return Imported(
        model if thermal is None else thermal.reference,
        ("m/s^2", "rad/s"),
        "sensor axes",
        f"the sensing axes as {tool} has them before the board's rotation, taken as orthogonal",
        (path,),
        (*remarks, *said),
        thermal,
    )


def entries_of(values: dict[str, float], names: list[str], what: str, path: Path) -> AnyArray:
    """Return the values of parameters that belong together.

    Raises
    ------
    CalibrationFileError
        If one is missing.
    """
    missing = [name for name in names if name not in values]
    if missing:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        raise CalibrationFileError(f"{path} switches {what} on but lacks {', '.join(missing[:3])}{more}.")
    return np.array([values[name] for name in names])


def _first(kind: str, entries: dict[tuple[str, str, str], float], path: Path) -> Triad:
    number = min(key[0] for key in entries)
    rows: dict[str, np.ndarray] = {"offset": np.zeros(3), "scale": np.ones(3)}
    for what in {key[2] for key in entries if key[0] == number}:
        missing = [axis for axis in "XYZ" if (number, axis, what) not in entries]
        if missing:
            raise CalibrationFileError(f"{path} lacks the {kind}'s {what} of axis {', '.join(missing)}.")
        rows[what] = np.array([entries[number, axis, what] for axis in "XYZ"])
    if not (all(np.all(np.isfinite(values)) for values in rows.values()) and np.all(rows["scale"] > 0.0)):
        raise CalibrationFileError(
            f"{path} has a scale of the {kind} that is not positive, or no finite number."
        )
    return Triad(np.diag(1.0 / rows["scale"]), rows["offset"])
