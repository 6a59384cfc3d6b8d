"""`tumble calibrate`, of several units too, and `tumble demo`: from recordings to calibrations and reports."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from tumble.cli.groups import ADVANCED, FIRST, option, refuse_given
from tumble.cli.options import (
    FiguresOption,
    FileOptions,
    Intervals,
    Limits,
    LongPrintOptions,
    NoiseFile,
    NoteOption,
    OptionalRecordings,
    Prior,
    Protocol,
    RegistryName,
    SiteOptions,
    UnitOptions,
    check_figures,
    complete_procedure,
    draw_figures,
    output_option,
)
from tumble.cli.terminal import console, progress, results_stand, say_json_text, say_written
from tumble.errors import UsageError
from tumble.procedure_names import KNOWN_PROCEDURES
from tumble.records import dataclass

if TYPE_CHECKING:
    from tumble.workflows.calibrate import CalibrationRun


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


_SEVERAL = "Several recordings"


@dataclass(frozen=True)
class OneOptions:
    """What goes with one recording of one unit alone."""

    intervals: Intervals = None
    noise: NoiseFile = None
    field: Annotated[
        str | None,
        option(
            ADVANCED,
            "NORM[,DIP]|wmm,LONGITUDE,DATE",
            "Magnetic field there with its unit, and its dip in degrees (49.2uT,66): makes the scale factors of a "
            "magnetometer absolute. Or by the World Magnetic Model at --site (wmm,11.58,2026-05-03).",
        ),
    ] = None
    estimator: Annotated[
        str | None,
        option(
            ADVANCED,
            "NAME",
            "A paper's own estimator, whose result stands beside the joint one, with the difference in sigmas, and "
            "with -o in calibration-NAME.json: six-position, multi-position-9, zhang-optimal, ... An unknown NAME "
            "lists all with their sources.",
        ),
    ] = None
    monte_carlo: Annotated[
        int | None,
        option(
            ADVANCED,
            "N",
            "Propagate distributions with N draws (JCGM 101; 10000 take seconds) and say whether the "
            "stated intervals hold.",
        ),
    ] = None


@dataclass(frozen=True)
class ProtocolOptions:
    """What was done to the unit."""

    protocol: Protocol = None


@dataclass(frozen=True)
class SeveralOptions:
    """What several recordings are of."""

    turn_ons: Annotated[
        bool,
        option(
            _SEVERAL,
            "",
            "Each RECORDING (a file, acc.csv,gyro.csv, or a protocol file) is the same unit switched on anew: "
            "biases are each one's own, what is stable is common to all.",
            "--turn-ons",
        ),
    ] = False


@dataclass(frozen=True)
class EstimateOptions:
    """How parameters are estimated, of one recording or several."""

    prior: Prior = None
    confirm_scale: Annotated[
        bool,
        option(
            ADVANCED,
            "",
            "The unit's scale factors are really beyond what units have: no reason against its calibration.",
            "--confirm-scale",
        ),
    ] = False


def calibrate_command(
    context: typer.Context,
    estimate: EstimateOptions,
    done_to_it: ProtocolOptions,
    site: SiteOptions,
    file: FileOptions,
    several: SeveralOptions,
    one: OneOptions,
    unit: UnitOptions,
    printed: LongPrintOptions,
    recordings: OptionalRecordings = None,
    limits: Limits = None,
    registry: RegistryName = None,
    notes: NoteOption = None,
    figures: FiguresOption = None,
    output: Annotated[
        Path | None, output_option("Folder for calibration.json and report.html (default: NAME-calibration).")
    ] = None,
    procedure: Annotated[
        str | None,
        option(
            FIRST,
            "NAME",
            f"What is believed: {', '.join(KNOWN_PROCEDURES[:-1])} or {KNOWN_PROCEDURES[-1]}; without it the "
            "protocol or the recording decides, and it is said why.",
            complete=complete_procedure,
        ),
    ] = None,
) -> None:
    """Calibrate an IMU from a recording of it tumbled by hand, on faces, or on a rate table.

    tumble calibrate imu.csv --site 48.1,520 -o calibrated

    By hand: rest the unit in at least nine different poses (better 26: faces, edges, corners), a few
    seconds each, and turn it in between about all axes. With a fixture or a table: say in a protocol
    what was done (--protocol; `tumble simulate` writes examples). Writes calibration.json and
    report.html, prints the parameters with their standard uncertainties, and says whether the result
    is fit for use (exit status 0) or not (1). With --limits the unit has to be within them, too.
    """
    from tumble.workflows.given.notes import notes_of
    from tumble.workflows.given.site import choose_site

    given = recordings or []
    check_figures(figures, output or _default_folder(given, done_to_it.protocol))
    if registry is not None:
        from tumble.workflows.registry import require_registry

        require_registry(registry, unit.imu_serial)
    shared: dict[str, Any] = {**file.given(), "site": choose_site(**asdict(site)), "limits": limits}
    shared |= {"notes": notes_of(notes), "confirm_scale": estimate.confirm_scale}
    shared |= {
        "output": output or _default_folder(given, done_to_it.protocol),
        "protocol": done_to_it.protocol,
        "prior": estimate.prior,
        "imu": unit.imu,
    }
    if several.turn_ons:
        from tumble.workflows.several.turn_ons import calibrate_turn_ons

        _refuse_beside_turn_ons(context, procedure)
        _calibrate(partial(calibrate_turn_ons, given, **shared), printed, registry, figures)
    from tumble.workflows.calibrate import calibrate

    shared |= {"procedure": procedure, **asdict(one)}
    _calibrate(partial(calibrate, given, **shared), printed, registry, figures)


def _refuse_beside_turn_ons(context: typer.Context, procedure: str | None) -> None:
    """Refuse what belongs to a single recording."""
    if procedure not in (None, "joint"):
        raise UsageError(
            f"--turn-ons is the joint estimator's, and --procedure {procedure} was asked for: leave one of them out."
        )
    refuse_given(context, [OneOptions], "{} does not go with --turn-ons: leave one of them out.")


def _calibrate(
    make: Callable[..., CalibrationRun],
    printed: LongPrintOptions,
    registry: str | None,
    figures: str | None,
) -> NoReturn:
    """Make a calibration, print what was found, and leave with the status of its verdict."""
    with progress(printed.silent) as tell:
        run = make(progress=tell)
        run.files += draw_figures(figures, run.page, run.files)
    if registry is not None:
        from tumble.workflows.registry import add_calibration

        add_calibration(registry, run.calibration)
    results_stand()
    print_run(run, printed)
    raise typer.Exit(0 if run.accepted else 1)


def _default_folder(recordings: list[Path], protocol: str | None) -> Path:
    """Return where the results go when nobody says: beside what they were made from, by its name."""
    first = recordings[0] if recordings else None
    if first is not None and first.suffix.lower() not in (".yaml", ".yml"):
        return Path(f"{first.stem}-calibration")
    given = first or Path(protocol or "protocol")
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
    from tumble.calibration.estimate import Beside
    from tumble.report.evidence import render_evidence
    from tumble.report.planned import planned_sentence
    from tumble.report.summary import print_calibration, verdict_line
    from tumble.report.terminal import print_blocks

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
    from tumble.document.field_document import FIELD_ALONE
    from tumble.report.advice import next_steps

    if run.calibration.procedure == FIELD_ALONE:
        return ["Hold the unit still in twelve attitudes or more, and all triads are calibrated."]
    subject = run.subject
    return next_steps(run.calibration, subject.rows, subject.up_b, run.recording, run.timeline, run.protocol)
