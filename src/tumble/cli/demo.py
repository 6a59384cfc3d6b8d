"""`tumble demo`: calibrate the recording that ships with the package."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tumble.cli.calibrate import print_run
from tumble.cli.options import LongPrintOptions, output_option
from tumble.cli.terminal import progress, results_stand


def demo_command(
    printed: LongPrintOptions,
    output: Annotated[
        Path, output_option("Folder for calibration.json and report.html (default: tumble-demo).")
    ] = Path("tumble-demo"),
) -> None:
    """Calibrate a real recording that ships with the package: an MPU-9150 tumbled by hand, 160 s.

    Opens nothing; prints where the report is.
    """
    from tumble.workflows.demo import demo

    with progress(printed.silent) as tell:
        run = demo(output, progress=tell)
    results_stand()
    print_run(run, printed)
    raise typer.Exit(0 if run.calibration.verdict.fit else 1)
