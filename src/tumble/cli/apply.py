"""`tumble apply`: correct a recording with a calibration."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from tumble.cli.options import (
    Columns,
    Json,
    OutsideOption,
    Quiet,
    Rate,
    Recordings,
    TemperatureOption,
    Topics,
    Units,
)
from tumble.cli.progress import progress, results_stand


def apply_command(
    calibration: Annotated[Path, typer.Argument(help="calibration.json, or the folder that holds it.")],
    recordings: Recordings,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="The corrected file, .csv or .parquet (default: NAME-corrected.csv)."
        ),
    ] = None,
    units: Units = None,
    columns: Columns = None,
    rate: Rate = None,
    topic: Topics = None,
    temperature: TemperatureOption = None,
    outside: OutsideOption = "refuse",
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Correct a recording: specific force in m/s², angular rate in rad/s, in the calibration's frame b.

    Recordings longer than memory are corrected block by block. A calibration with a thermal model follows the
    recording's temperature; beyond the temperatures that were calibrated it refuses (see --outside). The file says
    which calibrations it went through: none is applied twice.
    """
    from tumble.workflows.apply import apply

    with progress(quiet or as_json) as say:
        done = apply(
            calibration,
            recordings,
            output=output,
            columns=columns,
            units=units,
            rate=rate,
            topics=topic,
            temperature=temperature,
            outside=outside,
            progress=lambda samples: say(f"{samples:,} samples corrected"),
        )
    results_stand()
    if as_json:
        typer.echo(
            json.dumps({"file": str(done.file.resolve()), "samples": done.samples, "remarks": done.remarks})
        )
        return
    if not quiet:
        for remark in done.remarks:
            typer.echo(remark)
    typer.echo(f"{done.samples} samples corrected, written: {done.file.resolve()}")
