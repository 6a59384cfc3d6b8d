"""`tumble plan`: how accurate a test will be, before it is done, and which would be better."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tumble.cli.options import Gravity, Json, Quiet, SiteOption
from tumble.cli.progress import progress, results_stand
from tumble.errors import UsageError

if TYPE_CHECKING:
    from rich.table import Table

    from tumble.workflows.plan import Plan

_UNIT, _FIXTURE, _TEST, _POSES = "Unit", "Fixture", "Test", "Poses (multi-position, hand-held, six-position)"
_JOINT = "Any protocol"
# What only a whole protocol understands.
_OF_PROTOCOLS = ["noise", "recorded", "steps"]
# What only a test of poses, and only an error budget, understands.
_OF_POSES = [
    "data_sheet",
    "poses",
    "minutes",
    "turn",
    "criterion",
    "wanted",
    "reach",
    "outer",
    "inner",
    "given",
    "targets",
]
_OF_SEARCHES = ["poses", "minutes", "turn", "criterion", "wanted", "reach", "outer", "inner", "hold"]
_OF_BUDGETS = [
    "gyro_walk_deg_per_root_hour",
    "gyro_pulse_arcsec",
    "heading_mrad",
    "execution_mrad",
    "azimuth_deg",
    "turn_rate",
    "pause",
    "play_backs",
    "formulas",
    "start_bias",
    "norm",
    "asymmetry",
    "monte_carlo",
]


def plan_command(
    context: typer.Context,
    procedure: Annotated[
        str,
        typer.Argument(
            metavar="PROTOCOL",
            help="What is planned. Poses are searched: multi-position, hand-held, six-position. An error budget: "
            "strapdown-rotation. Any other protocol, by name (turntable-9, multi-position-26, …) or as a file, is "
            "judged as it is.",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="Of poses and protocols: a folder for protocol.yaml, plan.json, sheet.html (and plan.html). "
            "Of strapdown-rotation: a file for the whole budget, as JSON.",
        ),
    ] = None,
    imu: Annotated[
        str,
        typer.Option(
            help="Grade of the unit: consumer-mems, industrial-mems, hg1900, hg1700, tactical, ring-laser.",
            rich_help_panel=_UNIT,
        ),
    ] = "consumer-mems",
    gyro_walk_deg_per_root_hour: Annotated[
        float | None,
        typer.Option(
            help="The gyros' angle random walk in °/√h, of another data sheet.", rich_help_panel=_UNIT
        ),
    ] = None,
    gyro_pulse_arcsec: Annotated[
        float | None,
        typer.Option(help="Size of the gyros' pulses in arc-seconds (default: none).", rich_help_panel=_UNIT),
    ] = None,
    accelerometer_noise_ug: Annotated[
        float | None,
        typer.Option(
            help="The accelerometers' noise in µg/√Hz, of another data sheet.", rich_help_panel=_UNIT
        ),
    ] = None,
    data_sheet: Annotated[
        str | None,
        typer.Option(
            metavar="GRADE",
            help="Believe this grade's spreads beforehand, as calibrate --data-sheet does; six poses then suffice.",
            rich_help_panel=_UNIT,
        ),
    ] = None,
    poses: Annotated[
        int | None,
        typer.Option(help="How many poses (9; hand-held 26).", rich_help_panel=_POSES),
    ] = None,
    minutes: Annotated[
        float | None,
        typer.Option(
            "--time",
            metavar="MINUTES",
            help="Instead of --poses: how long the test may last; poses and dwells are then as many and as long "
            "as is best.",
            rich_help_panel=_POSES,
        ),
    ] = None,
    criterion: Annotated[
        str,
        typer.Option(
            help="What is made small: A (mean variance), D (volume), E (worst combination), minimax (worst against "
            "Zhang's nine) or I (error of a corrected vector).",
            rich_help_panel=_POSES,
        ),
    ] = "A",
    wanted: Annotated[
        str | None,
        typer.Option(
            "--for",
            metavar="PARAMETERS",
            help="What matters, such as bias or 'scale,misalignment yz' (default: everything).",
            rich_help_panel=_POSES,
        ),
    ] = None,
    reach: Annotated[
        str,
        typer.Option(
            help="Which poses there are: 26, sphere, two-axis, or a protocol file whose holds are a jig's poses.",
            rich_help_panel=_POSES,
        ),
    ] = "26",
    outer: Annotated[
        str | None,
        typer.Option(
            metavar="MIN,MAX,STEP",
            help="Angles in ° of a two-axis fixture's level axis (-180,135,45).",
            rich_help_panel=_POSES,
        ),
    ] = None,
    inner: Annotated[
        str | None,
        typer.Option(
            metavar="MIN,MAX,STEP",
            help="Angles in ° of the axis that it carries, the unit's z (0,315,45).",
            rich_help_panel=_POSES,
        ),
    ] = None,
    given: Annotated[
        Path | None,
        typer.Option(
            metavar="RECORDING|CALIBRATION",
            help="What is there already: the next poses, turns or rotations are said, and when to stop.",
            rich_help_panel=_TEST,
        ),
    ] = None,
    targets: Annotated[
        str | None,
        typer.Option(
            metavar="bias=50,scale=100,misalignment=20",
            help="Wished-for standard uncertainties in µg, ppm and ″; of protocols also gyro-bias (°/h), gyro-scale, "
            "gyro-misalignment, rotation and g-sensitivity.",
            rich_help_panel=_TEST,
        ),
    ] = None,
    noise: Annotated[
        Path | None,
        typer.Option(
            metavar="NOISE.JSON",
            help="The unit's own noise, by tumble noise, in place of the grade's.",
            rich_help_panel=_JOINT,
        ),
    ] = None,
    recorded: Annotated[
        str | None,
        typer.Option(
            "--protocol",
            metavar="FILE",
            help="With --given RECORDING: the protocol that it was recorded with, which has the table's angles.",
            rich_help_panel=_JOINT,
        ),
    ] = None,
    steps: Annotated[
        bool,
        typer.Option(
            "--steps/--no-steps",
            help="Judge what each step is worth.",
            rich_help_panel=_JOINT,
        ),
    ] = True,
    turn: Annotated[
        float | None,
        typer.Option(help="Seconds from one pose to the next (3; hand-held 2).", rich_help_panel=_POSES),
    ] = None,
    fixture_mrad: Annotated[
        float | None,
        typer.Option(
            help="How well the fixture is levelled and the unit aligned on it, one sigma (0.1° are 1.75; default: "
            "1, and 8.7 of a six-position test).",
            rich_help_panel=_FIXTURE,
        ),
    ] = None,
    heading_mrad: Annotated[
        float | None,
        typer.Option(
            help="How well the outer axis' direction against north is known (default: as the fixture).",
            rich_help_panel=_FIXTURE,
        ),
    ] = None,
    execution_mrad: Annotated[
        float | None,
        typer.Option(
            help="How far beside its angle an axis stops (default: as the fixture).", rich_help_panel=_FIXTURE
        ),
    ] = None,
    azimuth_deg: Annotated[
        float, typer.Option(help="Where the outer axis points, from north by east.", rich_help_panel=_FIXTURE)
    ] = 90.0,
    site: SiteOption = None,
    gravity: Gravity = None,
    hold: Annotated[
        float | None,
        typer.Option(
            help="Seconds of rest in each pose (30; hand-held 4), or before and after each sequence (10).",
            rich_help_panel=_TEST,
        ),
    ] = None,
    turn_rate: Annotated[
        float, typer.Option(help="Rate of the rotations in °/s.", rich_help_panel=_TEST)
    ] = 57.3,
    pause: Annotated[
        float,
        typer.Option(help="Seconds between two rotations, and beside each rest.", rich_help_panel=_TEST),
    ] = 1.0,
    play_backs: Annotated[
        int,
        typer.Option(
            help="How often the recording is played back with what it told (calibrate: until it settles).",
            rich_help_panel=_TEST,
        ),
    ] = 2,
    formulas: Annotated[
        bool,
        typer.Option(
            "--formulas/--least-squares",
            help="Savage's (13), or all components by least squares.",
            rich_help_panel=_TEST,
        ),
    ] = False,
    start_bias: Annotated[
        bool,
        typer.Option(
            "--start-bias/--no-start-bias",
            help="The gyros' bias from the rest before each sequence.",
            rich_help_panel=_TEST,
        ),
    ] = True,
    norm: Annotated[
        bool,
        typer.Option(
            "--norm/--no-norm",
            help="The vertical from the acceleration's length, or projected.",
            rich_help_panel=_TEST,
        ),
    ] = True,
    asymmetry: Annotated[
        bool,
        typer.Option(
            "--asymmetry/--no-asymmetry",
            help="With sequences 1a to 3a, for gyros with asymmetry.",
            rich_help_panel=_TEST,
        ),
    ] = True,
    monte_carlo: Annotated[int, typer.Option(help="Also draw so many tests, with all errors at once.")] = 0,
    seed: Annotated[int, typer.Option(help="Another seed draws others.")] = 0,
    as_json: Json = False,
    quiet: Quiet = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Also list all parameters with their largest sources.")
    ] = False,
) -> None:
    """Tell how accurate a test will be before it is done, and find a better one.

    Of any protocol: both triads foretold, what it does not tell, what each step is worth, what to add:

    tumble plan turntable-9 --imu tactical --site 48.1

    Of poses: which poses, for how long, in which order; a protocol to simulate and to calibrate with, and
    a sheet to print for the operator:

    tumble plan multi-position --imu tactical --time 15 -o plan

    Of the strapdown rotation test: which error contributes what, and whether the fixture suffices:

    tumble plan strapdown-rotation --imu ring-laser --fixture-mrad 1.75 --site 48.1

    All numbers are one sigma.
    """
    from tumble.workflows.plan import PROCEDURES as BUDGETS
    from tumble.workflows.plan import plan
    from tumble.workflows.pose_plan import PROCEDURES
    from tumble.workflows.site import choose_site

    place = choose_site(site, gravity)
    if procedure not in (*PROCEDURES, *BUDGETS):
        from tumble.cli.plan_joint import print_joint
        from tumble.workflows.joint_plan import find_protocol, plan_any_protocol

        find_protocol(procedure)
        others = ["fixture_mrad", "accelerometer_noise_ug"]
        _refuse(context, [*_OF_SEARCHES, *_OF_BUDGETS, *others], procedure, "a protocol as it is")
        with progress(quiet or as_json) as say:
            judged = plan_any_protocol(
                procedure,
                imu=imu,
                data_sheet=data_sheet,
                noise=noise,
                given=given,
                recorded=recorded,
                targets=targets,
                site=place,
                seed=seed,
                steps=steps and not quiet,
                output=output,
                progress=say,
            )
        results_stand()
        print_joint(judged, as_json=as_json, quiet=quiet, verbose=verbose)
        return
    _refuse(context, _OF_PROTOCOLS, procedure)
    if procedure in PROCEDURES:
        _refuse(context, _OF_BUDGETS, procedure)
        from tumble.cli.plan_poses import print_poses
        from tumble.workflows.pose_plan import plan_pose_test

        with progress(quiet or as_json) as say:
            found = plan_pose_test(
                procedure,
                imu=imu,
                data_sheet=data_sheet,
                accelerometer_noise_ug=accelerometer_noise_ug,
                poses=poses,
                minutes=minutes,
                hold=hold,
                turn=turn,
                criterion=criterion,
                wanted=wanted,
                reach=reach,
                outer=outer,
                inner=inner,
                given=given,
                targets=targets,
                placement=None if fixture_mrad is None else 1e-3 * fixture_mrad,
                site=place,
                seed=seed,
                output=output,
                progress=say,
            )
        results_stand()
        print_poses(found, as_json=as_json, quiet=quiet, verbose=verbose)
        return
    _refuse(context, _OF_POSES, procedure)
    with progress(quiet or as_json) as say:
        done = plan(
            procedure,
            imu=imu,
            gyro_walk_deg_per_root_hour=gyro_walk_deg_per_root_hour,
            gyro_pulse_arcsec=gyro_pulse_arcsec,
            accelerometer_noise_ug=accelerometer_noise_ug,
            fixture=1e-3 * (1.0 if fixture_mrad is None else fixture_mrad),
            heading=None if heading_mrad is None else 1e-3 * heading_mrad,
            execution=None if execution_mrad is None else 1e-3 * execution_mrad,
            site=place,
            hold=10.0 if hold is None else hold,
            turn_rate=math.radians(turn_rate),
            pause=pause,
            azimuth=math.radians(azimuth_deg),
            play_backs=play_backs,
            method="formulas" if formulas else "least-squares",
            start_bias=start_bias,
            norm=norm,
            asymmetry=asymmetry,
            monte_carlo=monte_carlo,
            seed=seed,
            output=output,
            progress=say,
        )
    results_stand()
    if as_json:
        document = {
            **done.budget.to_dict(),
            "fixture_suffices": done.suffices,
            "verdict": done.verdict,
            "advice": done.advice,
            "remarks": done.remarks,
        }
        typer.echo(json.dumps(document, ensure_ascii=False, allow_nan=False))
        return
    _print(done, quiet, verbose)


def _refuse(context: typer.Context, names: list[str], procedure: str, what: str | None = None) -> None:
    """Refuse options that this procedure would not understand, rather than ignore them."""
    test = f"a {procedure} test" if what is None else what
    for parameter in context.command.params:
        source = context.get_parameter_source(parameter.name or "")
        if parameter.name in names and source is not None and source.name == "COMMANDLINE":
            raise UsageError(f"{parameter.opts[0]} says nothing to {test}: leave it out.")


def _print(done: Plan, quiet: bool, verbose: bool) -> None:
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False)
    budget = done.budget
    if not quiet:
        table = Table(box=SIMPLE, pad_edge=False, padding=(0, 1, 0, 0))
        table.add_column("one sigma by source")
        for group in budget.groups:
            table.add_column("\n".join([*group.short.split(" "), group.practical]), justify="right")
        factors = [group.factor for group in budget.groups]
        parts = budget.group_contributions()
        for number, source in enumerate(budget.sources):
            column = parts[:, number]
            table.add_row(source.name, *(_shown(v * f) for v, f in zip(column, factors, strict=True)))
        table.add_section()
        total = [_shown(v * f) for v, f in zip(budget.group_rms(), factors, strict=True)]
        table.add_row("total", *total, style="bold")
        drawn = budget.group_drawn()
        if drawn is not None and budget.drawn is not None:
            row = [_shown(v * f) for v, f in zip(drawn, factors, strict=True)]
            table.add_row(f"{budget.drawn.runs} tests drawn", *row)
        console.print(table)
        if verbose:
            console.print(_parameters(done))
    for sentence in done.verdict:
        console.print(sentence, style="bold green" if done.suffices else "bold yellow", markup=False)
    if not quiet:
        for sentence in (*done.advice, *done.remarks):
            console.print(f"• {sentence}", markup=False)
    if done.file is not None:
        typer.echo(f"written: {done.file.resolve()}")


def _parameters(done: Plan) -> Table:
    """Every parameter with its total and the three sources that make most of it."""
    from rich.box import SIMPLE
    from rich.table import Table

    budget = done.budget
    table = Table(box=SIMPLE, pad_edge=False)
    for name in ("parameter", "total", "", "largest sources"):
        table.add_column(name, justify="right" if name == "total" else "left")
    totals: list[float] = budget.totals.tolist()
    rows: list[list[float]] = budget.contributions.tolist()
    for group in budget.groups:
        for number in range(group.first, group.stop):
            parts = sorted(zip(rows[number], budget.sources, strict=True), key=lambda part: -part[0])
            largest = ", ".join(
                f"{source.name} {_shown(group.factor * value)}" for value, source in parts[:3] if value > 0.0
            )
            total = _shown(group.factor * totals[number])
            table.add_row(budget.parameters[number], total, group.practical, largest)
    return table


def _shown(value: float) -> str:
    """Two digits; a dash for nothing."""
    if abs(value) < 5e-4:
        return "–"
    digits = max(0, 1 - math.floor(math.log10(abs(value))))
    return f"{value:.{min(digits, 3)}f}"
