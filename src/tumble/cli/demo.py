"""`tumble demo`: calibrate the recording that ships with the package."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tumble.cli.calibrate import print_run
from tumble.cli.options import Json, Quiet, Verbose
from tumble.cli.progress import progress, results_stand


def demo_command(
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder for calibration.json and report.html.")
    ] = Path("tumble-demo"),
    as_json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Calibrate a real recording that ships with the package: an MPU-9150 tumbled by hand, 160 s.

    Opens nothing; prints where the report is.
    """
    from tumble.workflows.demo import demo

    with progress(quiet or as_json) as say:
        run = demo(output, progress=say)
    results_stand()
    print_run(run, as_json=as_json, quiet=quiet, verbose=verbose)
    raise typer.Exit(0 if run.calibration.verdict.fit else 1)
