"""`tumble apply`: correct a recording with a calibration."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from tumble.cli.groups import ADVANCED, option
from tumble.cli.options import (
    CalibrationArgument,
    FileOptions,
    PrintOptions,
    Recordings,
    TemperatureOptions,
    output_option,
)
from tumble.cli.terminal import progress, results_stand, say, say_json


def apply_command(
    calibration: CalibrationArgument,
    recordings: Recordings,
    file: FileOptions,
    temperature: TemperatureOptions,
    printed: PrintOptions,
    output: Annotated[
        Path | None,
        output_option(
            "The corrected file: .csv or .parquet. Of a bag: a bag of its kind. A name without an ending: a "
            "folder like EuRoC's. By default NAME-corrected, as the recording is, else .csv.",
            "FILE",
        ),
    ] = None,
    shift_lag: Annotated[
        bool,
        option(
            ADVANCED, "", "Take out the lag between the triads that the calibration states.", "--shift-lag"
        ),
    ] = False,
) -> None:
    """Correct a recording: specific force in m/s², angular rate in rad/s, in the calibration's frame b.

    tumble apply calibrated imu.csv -o corrected.csv

    tumble apply calibrated drive.bag -o drive-corrected.bag

    Of a bag everything but the IMU's messages stays as it is, byte for byte. Recordings longer than memory are
    corrected block by block. A calibration with a thermal model follows the recording's temperature; beyond the
    temperatures that were calibrated it refuses (see --outside). The file says which calibrations it went through:
    none is applied twice.
    """
    from tumble.workflows.apply import apply

    with progress(printed.silent) as tell:
        tell("reading")
        done = apply(
            calibration,
            recordings,
            output=output,
            shift_lag=shift_lag,
            progress=lambda samples: tell(f"{samples:,} samples corrected"),
            **file.given(),
            **asdict(temperature),
        )
    results_stand()
    if printed.as_json:
        say_json({"file": str(done.file.resolve()), "samples": done.samples, "remarks": done.remarks})
        return
    if not printed.quiet:
        say(*done.remarks)
    say(f"{done.samples} samples corrected, written: {done.file.resolve()}")
