"""`tumble calibrate`, of several units too, and `tumble demo`: from recordings to calibrations and reports."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, cast

import typer

from tumble.cli.options import (
    FiguresOption,
    LongPrintOptions,
    SiteOptions,
    UnitOptions,
    check_figures,
    draw_figures,
)
from tumble.cli.terminal import console, progress, results_stand, say_json_text, say_written
from tumble.workflows import FIRST, CalibrateRequest, option

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tumble.workflows import CalibrationRun


def demo_command(
    printed: LongPrintOptions,
    output: Path = option(FIRST, "DIR", "--output", "-o", default=Path("tumble-demo")),
) -> None:
    """Calibrate a real recording that ships with the package: an MPU-9150 tumbled by hand, 160 s.

    Opens nothing; prints where the report is.

    Parameters
    ----------
    output : Folder for calibration.json and report.html (default: tumble-demo).
    """
    from tumble.workflows import demo

    with progress(printed.silent) as tell:
        run = demo(output, progress=tell)
    results_stand()
    print_run(run, printed)
    raise typer.Exit(0 if run.calibration.verdict.fit else 1)


def calibrate_command(
    unit: UnitOptions,
    asked: CalibrateRequest,
    site: SiteOptions,
    printed: LongPrintOptions,
    figures: FiguresOption = None,
) -> None:
    """Calibrate an IMU from a recording of it tumbled by hand, on faces, or on a rate table.

    tumble calibrate imu.csv --site 48.1,520 -o calibrated

    By hand: rest the unit in at least nine different poses (better 26: faces, edges, corners), a few
    seconds each, and turn it in between about all axes. With a fixture or a table: say in a protocol
    what was done (--protocol; `tumble simulate` writes examples). Writes calibration.json and
    report.html, prints the parameters with their standard uncertainties, and says whether the result
    is fit for use (exit status 0) or not (1). With --limits the unit has to be within them, too.
    """
    output = Path(asked.output or _default_folder(asked))
    check_figures(figures, output)
    from tumble.workflows import calibrate

    with progress(printed.silent) as tell:
        asked = replace(asked, output=output, site=site.place, imu=unit.imu, progress=tell)
        run = calibrate(**vars(asked))
        run.files += draw_figures(figures, run.page, run.files)
    results_stand()
    print_run(run, printed)
    raise typer.Exit(0 if run.accepted else 1)


def _default_folder(asked: CalibrateRequest) -> Path:
    """Return where the results go when nobody says: beside what they were made from, by its name."""
    recordings = cast("Sequence[Path]", asked.paths)
    first = recordings[0] if recordings else None
    if first is not None and first.suffix.lower() not in (".yaml", ".yml"):
        return Path(f"{first.stem}-calibration")
    given = first or Path(asked.protocol or "protocol")
    return Path(f"{given.parent.resolve().name if given.is_file() else given.name}-calibration")


def print_run(run: CalibrationRun, printed: LongPrintOptions) -> None:
    """Print what a calibration found.

    Parameters
    ----------
    run : what was made.
    printed : how to print.
    """
    if printed.as_json:
        say_json_text(run.calibration.to_json())
        return
    from tumble.calibration import Beside
    from tumble.report import planned_sentence, print_blocks, print_calibration, render_evidence, verdict_line

    screen, more = console(), printed.verbose
    if printed.quiet:
        screen.print(verdict_line(run.calibration, run.files), markup=False, soft_wrap=True)
        return
    print_calibration(run.calibration, screen, verbose=more)
    # A guess is said, and so is what was changed; what was merely found or cannot be seen, on request.
    read = [r for r in run.recording.remarks if more or r.kind in ("assumed", "mended", "corrected")]
    screen.print(run.reason, markup=False)
    for line in (*(f"{r.kind}: {r.text}" for r in read), *(run.estimate.remarks if more else ())):
        screen.print(f"- {line}", markup=False)
    if sentence := planned_sentence(run.calibration, run.predicted):
        screen.print(sentence, markup=False)
    if run.papers:
        print_blocks(render_evidence(run.subject, Beside), screen)
    for step in _steps(run)[: None if more else 1]:
        screen.print(f"Next: {step}", markup=False)
    say_written(run.files)
    if more:
        seconds = ", ".join(f"{stage} {value:.2f} s" for stage, value in run.seconds.items())
        screen.print(f"time: {seconds}", style="dim")
        return
    hidden = len(run.estimate.remarks)
    remarks = f", {hidden} remark{'s' if hidden != 1 else ''}" if hidden else ""
    screen.print(f"Intervals, residuals, terms{remarks}: with -v, and in the report.", style="dim")


def _steps(run: CalibrationRun) -> list[str]:
    """What would make the calibration better, the most useful first."""
    from tumble.document import FIELD_ALONE
    from tumble.report import next_steps

    if run.calibration.procedure == FIELD_ALONE:
        return ["Hold the unit still in twelve attitudes or more, and all triads are calibrated."]
    return next_steps(run.subject)
