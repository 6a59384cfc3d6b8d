"""`tumble plan`: how accurate a test will be, before it is done, and which would be better.

What `tumble plan` prints: of any protocol, of a test of poses, of an error budget.
"""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from tumble.cli.groups import refuse_given
from tumble.cli.options import (
    FiguresOption,
    LongPrintOptions,
    SiteOptions,
    check_figures,
    complete_protocol,
    draw_figures,
    output_option,
)
from tumble.cli.plan_options import (
    BudgetOptions,
    PlanOptions,
    PoseOptions,
    ProtocolOptions,
    RestOptions,
    WishOptions,
)
from tumble.cli.terminal import progress, results_stand
from tumble.errors import UsageError


def plan_command(
    context: typer.Context,
    procedure: Annotated[
        str,
        typer.Argument(
            metavar="PROTOCOL",
            autocompletion=complete_protocol,
            help="What is planned. Poses are searched: multi-position, hand-held, six-position. An error budget: "
            "strapdown-rotation. Any other protocol, by name (turntable-9, multi-position-26, …) or as a file, is "
            "judged as it is.",
        ),
    ],
    planned: PlanOptions,
    wishes: WishOptions,
    site: SiteOptions,
    rests: RestOptions,
    searched: PoseOptions,
    budgeted: BudgetOptions,
    judged: ProtocolOptions,
    printed: LongPrintOptions,
    output: Annotated[
        Path | None,
        output_option(
            "Of poses and protocols: a folder for protocol.yaml, plan.json, sheet.html (and plan.html). "
            "Of strapdown-rotation: a file for the whole budget, as JSON.",
            "PATH",
        ),
    ] = None,
    figures: FiguresOption = None,
) -> None:
    """Say how accurate a test will be before it is done, and find a better one.

    Of any protocol: both triads predicted, what it does not determine, what each step is worth, what to add:

    tumble plan turntable-9 --imu tactical --site 48.1

    Of poses: which poses, for how long, in which order; a protocol to simulate and to calibrate with, and
    a sheet to print for the operator:

    tumble plan multi-position --imu tactical --time 15 -o plan

    Of the strapdown rotation test: which error contributes what, and whether the fixture suffices:

    tumble plan strapdown-rotation --imu ring-laser --fixture-mrad 1.75

    All numbers are one sigma.
    """
    from tumble.workflows.given.site import choose_site
    from tumble.workflows.planning.plan import kind_of_plan

    check_figures(figures, output)
    shared = {**asdict(planned), "site": choose_site(**asdict(site))}
    test = f"a {procedure} test"
    match kind_of_plan(procedure):
        case "poses":
            _refuse(context, [ProtocolOptions, BudgetOptions], test)
            _search(
                {"procedure": procedure, **shared, **asdict(wishes), **asdict(searched)},
                rests,
                output,
                figures,
                printed,
            )
        case "budget":
            _refuse(context, [ProtocolOptions, WishOptions, PoseOptions], test)
            _refuse_figures(figures)
            _budget(shared, rests, budgeted, output, printed)
        case "protocol":
            _refuse(context, [PoseOptions, BudgetOptions, RestOptions], "a protocol as it is")
            _refuse_figures(figures)
            _judge({"asked": procedure, **shared, **asdict(wishes), **asdict(judged)}, output, printed)


def _refuse_figures(form: str | None) -> None:
    if form is not None:
        raise UsageError(
            "--figures: only plans that search for poses have figures, as multi-position: leave it out."
        )


def _refuse(context: typer.Context, groups: list[type], what: str) -> None:
    refuse_given(context, groups, f"{{}} says nothing to {what}: leave it out.")


def _judge(asked: dict[str, Any], output: Path | None, printed: LongPrintOptions) -> None:
    """Judge a protocol as it is."""
    from tumble.cli.plan_tables import print_protocol
    from tumble.workflows.planning.protocol import plan_any_protocol

    asked["steps"] = asked["steps"] and not printed.quiet
    with progress(printed.silent) as tell:
        done = plan_any_protocol(output=output, progress=tell, **asked)
    results_stand()
    print_protocol(done, printed)


def _search(
    asked: dict[str, Any],
    rests: RestOptions,
    output: Path | None,
    figures: str | None,
    printed: LongPrintOptions,
) -> None:
    """Search the poses of a test."""
    from tumble.cli.plan_tables import print_poses
    from tumble.workflows.planning.pose_order import PoseOrder
    from tumble.workflows.planning.poses import plan_poses

    order = PoseOrder(
        hold=rests.hold,
        placement=None if rests.fixture_mrad is None else 1e-3 * rests.fixture_mrad,
        accelerometer_noise_ug=rests.accelerometer_noise_ug,
        **asked,
    )
    with progress(printed.silent) as tell:
        done = plan_poses(order, output=output, progress=tell)
    done.files += draw_figures(figures, done.files)
    results_stand()
    print_poses(done, printed)


def _budget(
    asked: dict[str, Any],
    rests: RestOptions,
    options: BudgetOptions,
    output: Path | None,
    printed: LongPrintOptions,
) -> None:
    """Reckon the error budget of a test."""
    from tumble.cli.plan_tables import print_budget
    from tumble.workflows.planning.budget import BudgetOrder, plan_budget

    of_fixture: dict[str, Any] = {"heading": options.heading_mrad, "execution": options.execution_mrad}
    order = BudgetOrder(
        **asked,
        gyro_walk_deg_per_root_hour=options.gyro_walk_deg_per_root_hour,
        gyro_pulse_arcsec=options.gyro_pulse_arcsec,
        accelerometer_noise_ug=rests.accelerometer_noise_ug,
        fixture=1e-3 * (1.0 if rests.fixture_mrad is None else rests.fixture_mrad),
        **{name: 1e-3 * mrad for name, mrad in of_fixture.items() if mrad is not None},
        hold=10.0 if rests.hold is None else rests.hold,
        turn_rate=math.radians(options.turn_rate),
        pause=options.pause,
        azimuth=math.radians(options.azimuth_deg),
        play_backs=options.play_backs,
        method="formulas" if options.formulas else "least-squares",
        start_bias=options.start_bias,
        norm=options.norm,
        asymmetry=options.asymmetry,
        monte_carlo=options.monte_carlo,
    )
    with progress(printed.silent) as tell:
        done = plan_budget(order, output=output, progress=tell)
    results_stand()
    print_budget(done, printed)
