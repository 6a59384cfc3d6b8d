"""Kalibr's and imu_tk's files read; autopilots' parameters are read in `autopilots`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tumble.arrays import Matrix
from tumble.errors import CalibrationFileError
from tumble.export.reading import (
    Imported,
    check_rotation,
    entry,
    invertible,
    matrix_of,
    text_of,
    vector_of,
    yaml_of,
)
from tumble.sensor import FRAMES, ImuModel, Triad
from tumble.sensor.gauge import inverse


def read_file(name: str, path: Path) -> Imported:
    """Read a file of a target.

    Parameters
    ----------
    name : of `tumble.export.target.READ`.
    path : the file, or a folder of several.

    Raises
    ------
    CalibrationFileError
        If it is no file of that tool, or damaged.
    """
    from tumble.export.autopilots import read_ardupilot, read_px4

    by_name = {"kalibr": read_kalibr, "imu-tk": read_imu_tk, "px4": read_px4, "ardupilot": read_ardupilot}
    return by_name[name](path)


def read_kalibr(path: Path) -> Imported:
    """Read a result file of Kalibr, or one of this module.

    Raises
    ------
    CalibrationFileError
        If it is none, or of the model ``calibrated`` or ``scale-misalignment-size-effect`` without matrices.
    """
    document = yaml_of(path)
    if "imu0" not in document:
        if "accelerometer_noise_density" in document:
            raise CalibrationFileError(f"{path} holds Kalibr's noise parameters and no calibration.")
        raise CalibrationFileError(f"{path} has no imu0: it is no result file of Kalibr.")
    imu = document["imu0"]
    if isinstance(imu, dict) and "Tw" in imu:
        raise CalibrationFileError(f"{path} has OpenVINS' keys (Tw, Ta), not Kalibr's.")
    model = entry(document, "imu0.model", path)
    if model == "calibrated":
        raise CalibrationFileError(
            f"{path} is of Kalibr's model 'calibrated', which has no matrices to read."
        )
    M_a = invertible(entry(document, "imu0.accelerometers.M", path), "accelerometers.M", path)
    M_g = invertible(entry(document, "imu0.gyroscopes.M", path), "gyroscopes.M", path)
    A = matrix_of(entry(document, "imu0.gyroscopes.A", path), "gyroscopes.A", path)
    C = matrix_of(entry(document, "imu0.gyroscopes.C_gyro_i", path), "gyroscopes.C_gyro_i", path)
    check_rotation(C, path)
    remarks: list[str] = []
    biases: list[np.ndarray] = []
    for name in ("accelerometers", "gyroscopes"):
        given: Any = document["imu0"][name].get("bias")
        if given is None:
            remarks.append(f"Kalibr's file has no bias of the {name}: it is taken as zero")
        biases.append(np.zeros(3) if given is None else vector_of(given, f"{name}.bias", path))
    if model == "scale-misalignment-size-effect":
        remarks.append("Kalibr's lever arms of the accelerometers are left out")
    sensitivity = np.asarray(A @ C)
    return Imported(
        ImuModel(
            Triad(M_a, biases[0]),
            Triad(np.asarray(M_g @ C), biases[1]),
            sensitivity if np.any(sensitivity) else None,
        ),
        ("m/s^2", "rad/s"),
        "accelerometer-x",
        FRAMES["accelerometer-x"],
        (path,),
        tuple(remarks),
    )


def read_imu_tk(path: Path) -> Imported:
    """Read both triads' files of a folder, or one file, of the triad that its name says.

    Raises
    ------
    CalibrationFileError
        If a file is not 21 numbers, or which triad it is of cannot be told.
    """
    files = sorted(path.glob("*.calib")) if path.is_dir() else [path]
    if not files:
        raise CalibrationFileError(f"The folder {path} has no .calib file of imu_tk.")
    found: dict[str, Triad] = {}
    for file in files:
        kind = _kind(file)
        if kind in found:
            raise CalibrationFileError(
                f"{path} has several files of the {kind}: give one of them, or clear the folder."
            )
        words = text_of(file).split()
        try:
            numbers = np.array([float(word) for word in words])
        except ValueError:
            raise CalibrationFileError(f"{file} holds words: imu_tk's file is 21 numbers.") from None
        if numbers.size != 21:
            raise CalibrationFileError(f"{file} has {numbers.size} numbers: imu_tk's file is 21, T, K and B.")
        found[kind] = _triad_of(numbers[:9], numbers[9:18], numbers[18:], file)
    accelerometer, frame = found.get("accelerometer"), "accelerometer-z"
    if accelerometer is not None and _is_full(accelerometer.matrix):
        frame = "output of imu_tk"
    return Imported(
        ImuModel(accelerometer, found.get("gyroscope")),
        ("counts", "counts"),
        frame,
        FRAMES.get(frame, "the axes of the corrected output"),
        tuple(files),
        ("imu_tk's file does not say its raw unit: counts is taken, or what --units says",),
    )


def _is_full(matrix: Matrix) -> bool:
    """Whether more than round-off is below the diagonal, where imu_tk itself has zeros."""
    return bool(np.abs(np.tril(matrix, -1)).max() > 1e-9 * np.abs(matrix).max())


def _kind(file: Path) -> str:
    name = file.stem.lower()
    kinds = [kind for kind, mark in (("accelerometer", "acc"), ("gyroscope", "gyr")) if mark in name]
    if len(kinds) != 1:
        raise CalibrationFileError(
            f"Which triad {file} is of cannot be seen: its name must hold acc or gyr, as accelerometer.calib."
        )
    return kinds[0]


def _triad_of(T: Any, K: Any, B: Any, file: Path) -> Triad:
    """Return the triad of imu_tk's numbers.

    Parameters
    ----------
    T, K, B : misalignment (3, 3), scale (3, 3), diagonal, and bias (3,), as read.
    file : that they are from.

    Raises
    ------
    CalibrationFileError
        If they are no such numbers.
    """
    misalignment = invertible(T, "the misalignment matrix", file)
    scale = invertible(K, "the scale matrix", file)
    if np.any(scale - np.diag(np.diag(scale))):
        raise CalibrationFileError(f"The scale matrix in {file} is not diagonal: it is no file of imu_tk.")
    return Triad(inverse(misalignment @ scale), vector_of(B, "the bias", file))
