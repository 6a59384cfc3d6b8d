"""`tumble apply`: correct a recording with a calibration."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

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
        output_option("The corrected file, .csv or .parquet (default: NAME-corrected.csv).", "FILE"),
    ] = None,
) -> None:
    """Correct a recording: specific force in m/s², angular rate in rad/s, in the calibration's frame b.

    tumble apply calibrated imu.csv -o corrected.csv

    Recordings longer than memory are corrected block by block. A calibration with a thermal model follows the
    recording's temperature; beyond the temperatures that were calibrated it refuses (see --outside). The file says
    which calibrations it went through: none is applied twice.
    """
    from tumble.workflows.apply import apply

    with progress(printed.silent) as tell:
        done = apply(
            calibration,
            recordings,
            output=output,
            progress=lambda samples: tell(f"{samples:,} samples corrected"),
            **asdict(file),
            **asdict(temperature),
        )
    results_stand()
    if printed.as_json:
        say_json({"file": str(done.file.resolve()), "samples": done.samples, "remarks": done.remarks})
        return
    if not printed.quiet:
        say(*done.remarks)
    say(f"{done.samples} samples corrected, written: {done.file.resolve()}")
