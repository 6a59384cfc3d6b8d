"""Calibrating the recording that ships with the package."""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib.resources import as_file, files

from tumble.earth import Site
from tumble.workflows.calibrate import CalibrationRun, calibrate

RECORDING = "mpu9150-imu0.csv.gz"
# The recording has no stamps; its authors state 100 Hz and use 9.81 m/s² (docs: tumble/data/NOTICE).
RATE = 100.0
GRAVITY = 9.81


def demo(output: str | os.PathLike[str], *, progress: Callable[[str], None] | None = None) -> CalibrationRun:
    """Calibrate the MPU-9150 recording of the package into the folder `output`.

    Raises
    ------
    OutputError
        If the results cannot be written.
    """
    with as_file(files("tumble") / "data" / RECORDING) as path:
        return calibrate(
            path,
            output=output,
            site=Site.from_gravity(GRAVITY),
            columns="ax,ay,az,gx,gy,gz",
            units="m/s^2,rad/s",
            rate=RATE,
            imu=("MPU-9150", None),
            progress=progress,
        )
