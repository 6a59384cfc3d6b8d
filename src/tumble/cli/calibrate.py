"""`tumble calibrate`: from a recording to a calibration, a report and a verdict."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from tumble.cli.options import (
    Columns,
    Gravity,
    Intervals,
    Json,
    OptionalRecordings,
    ProtocolOption,
    Quiet,
    Rate,
    SiteOption,
    Topics,
    Units,
    Verbose,
)
from tumble.cli.progress import progress, results_stand
from tumble.cli.several import Several, one_prior, refuse_what_is_of_one

if TYPE_CHECKING:
    from tumble.workflows.calibrate import CalibrationRun


def calibrate_command(
    recordings: OptionalRecordings = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="Folder for calibration.json and report.html (default: NAME-calibration)."
        ),
    ] = None,
    procedure: Annotated[
        str | None,
        typer.Option(
            help="hand-held, multi-position, six-position, improved-six-position, rate-table, "
            "modified-multi-position, turntable, laboratory, strapdown-rotation or thermal; without it the protocol or "
            "the recording decides, and it is said why."
        ),
    ] = None,
    protocol: ProtocolOption = None,
    site: SiteOption = None,
    gravity: Gravity = None,
    units: Units = None,
    columns: Columns = None,
    rate: Rate = None,
    topic: Topics = None,
    prior: Annotated[
        list[Path] | None,
        typer.Option(
            help="An earlier calibration.json of this unit: its non-orthogonalities are kept, and six poses suffice. "
            "With --array once for each unit, in their order, or once for all."
        ),
    ] = None,
    data_sheet: Annotated[
        str | None,
        typer.Option(
            metavar="GRADE",
            help="For multi-position: a kind of unit (hg1700, consumer-mems, ...; see `tumble simulate --help`) whose "
            "data sheet is believed beforehand.",
        ),
    ] = None,
    intervals: Intervals = None,
    optional_terms: Annotated[
        bool,
        typer.Option(
            "--optional-terms/--no-optional-terms",
            help="Try g-sensitivity and quadratic terms, and keep them if the data want them.",
        ),
    ] = True,
    noise_correction: Annotated[
        bool,
        typer.Option(
            "--noise-correction/--no-noise-correction",
            help="Take the noise's own square out of the norm of gyros on the Earth's rate.",
        ),
    ] = True,
    unknowns: Annotated[
        int | None,
        typer.Option(help="For multi-position: 9 a triad, 6 (no non-orthogonality) or 3 (bias alone)."),
    ] = None,
    noise: Annotated[
        Path | None,
        typer.Option(
            metavar="NOISE.JSON",
            help="What `tumble noise` wrote for this unit: its noise models, not the holds' scatter, then say how well "
            "the means of holds are known.",
        ),
    ] = None,
    monte_carlo: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="For joint: propagate distributions with N draws (JCGM 101; 10000 take seconds) and say whether the "
            "stated intervals hold.",
        ),
    ] = None,
    turn_ons: Annotated[
        bool,
        typer.Option(
            "--turn-ons",
            help="Each RECORDING (a file, acc.csv,gyro.csv, or a protocol file) is the same unit switched on anew: "
            "biases are each one's own, what is stable is common to all (procedure joint).",
        ),
    ] = False,
    array: Annotated[
        bool,
        typer.Option(
            "--array",
            help="Each RECORDING is another unit, all tumbled together, fixed to one another, on one clock: a "
            "calibration for each, and how each sits against the first (procedure joint).",
        ),
    ] = False,
    imu_model: Annotated[str | None, typer.Option(help="Model of the unit, noted in the file.")] = None,
    imu_serial: Annotated[
        str | None, typer.Option(help="Serial number of the unit, noted in the file.")
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Calibrate an IMU from a recording of it tumbled by hand, on faces, or on a rate table.

    By hand: rest the unit in at least nine different poses (better 26: faces, edges, corners), a few
    seconds each, and turn it in between about all axes. With a fixture or a table: say in a protocol
    what was done (--protocol; `tumble simulate` writes examples). Writes calibration.json and
    report.html, prints the parameters with their standard uncertainties, and says whether the result
    is fit for use (exit status 0) or not (1).
    """
    from tumble.cli.array import default_folder, print_array
    from tumble.workflows.array import calibrate_array
    from tumble.workflows.calibrate import calibrate
    from tumble.workflows.site import choose_site
    from tumble.workflows.turn_ons import calibrate_turn_ons

    of_one: dict[str, object] = {
        "--data-sheet": data_sheet,
        "--intervals": intervals,
        "--unknowns": unknowns,
        "--noise": noise,
        "--monte-carlo": monte_carlo,
        "--no-noise-correction": None if noise_correction else False,
    }
    several: Several = {
        "recordings": recordings or [],
        "site": choose_site(site, gravity),
        "columns": columns,
        "units": units,
        "rate": rate,
        "topics": topic,
        "optional_terms": optional_terms,
    }
    if array:
        of_one |= {"--turn-ons": turn_ons or None, "--protocol": protocol}
        of_one |= {"--imu-model": imu_model, "--imu-serial": imu_serial}
        refuse_what_is_of_one("--array", procedure, of_one)
        with progress(quiet or as_json) as say:
            made = calibrate_array(
                output=output or default_folder(recordings or []),
                prior=prior or None,
                progress=say,
                **several,
            )
        results_stand()
        print_array(made, as_json=as_json, quiet=quiet)
        raise typer.Exit(0 if all(run.calibration.verdict.fit for run in made.runs) else 1)
    folder, known = output or _default_folder(recordings or [], protocol), one_prior(prior)
    if turn_ons:
        refuse_what_is_of_one("--turn-ons", procedure, of_one)
        with progress(quiet or as_json) as say:
            run = calibrate_turn_ons(
                output=folder,
                protocol=protocol,
                prior=known,
                imu=(imu_model, imu_serial),
                progress=say,
                **several,
            )
        _end(run, as_json=as_json, quiet=quiet, verbose=verbose)
    with progress(quiet or as_json) as say:
        run = calibrate(
            recordings or [],
            output=folder,
            procedure=procedure,
            protocol=protocol,
            site=choose_site(site, gravity),
            columns=columns,
            units=units,
            rate=rate,
            topics=topic,
            prior=known,
            data_sheet=data_sheet,
            intervals=intervals,
            optional_terms=optional_terms,
            noise_correction=noise_correction,
            unknowns=unknowns,
            noise=noise,
            monte_carlo=monte_carlo,
            imu=(imu_model, imu_serial),
            progress=say,
        )
    _end(run, as_json=as_json, quiet=quiet, verbose=verbose)


def _end(run: CalibrationRun, *, as_json: bool, quiet: bool, verbose: bool) -> NoReturn:
    """Print what was found, and leave with the status of its verdict."""
    results_stand()
    print_run(run, as_json=as_json, quiet=quiet, verbose=verbose)
    raise typer.Exit(0 if run.calibration.verdict.fit else 1)


def _default_folder(recordings: list[Path], protocol: str | None) -> Path:
    """Return where the results go when nobody says: beside what they were made from, by its name."""
    first = recordings[0] if recordings else None
    if first is not None and first.suffix.lower() not in (".yaml", ".yml"):
        return Path(f"{first.stem}-calibration")
    given = first or Path(protocol or "protocol")
    return Path(f"{given.parent.resolve().name if given.is_file() else given.name}-calibration")


def print_run(run: CalibrationRun, *, as_json: bool, quiet: bool, verbose: bool) -> None:
    """Print what a calibration found."""
    if as_json:
        typer.echo(run.calibration.to_json(), nl=False)
        return
    from rich.console import Console

    from tumble.report.table import print_calibration

    console = Console(highlight=False)
    if not quiet:
        console.print(run.reason, markup=False)
        for remark in run.recording.remarks:
            # A guess is said, and so is what was changed; what was merely found or cannot be seen, on request.
            if verbose or remark.kind in ("assumed", "mended"):
                console.print(f"{remark.kind}: {remark.text}", markup=False, style="dim")
        console.print()
    print_calibration(run.calibration, console, quiet=quiet)
    for remark in () if quiet else run.estimate.remarks:
        console.print(f"- {remark}", markup=False)
    for file in run.files:
        console.print(f"written: {file.resolve()}", markup=False, soft_wrap=True)
    if verbose:
        seconds = ", ".join(f"{stage} {value:.2f} s" for stage, value in run.seconds.items())
        console.print(f"time: {seconds}", markup=False, style="dim")
