"""`tumble plan`: how accurate a test will be, before it is done, and which would be better.

Of any protocol as it is, and of a test of poses, which are searched.
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from tumble.cli.groups import completed, refuse_given
from tumble.cli.options import LongPrintOptions, SiteOptions
from tumble.cli.plan_options import (
    PlanOptions,
    PoseOptions,
    ProtocolOptions,
    WishOptions,
)
from tumble.cli.terminal import progress, results_stand
from tumble.workflows.request import FIRST, option


def plan_command(
    context: typer.Context,
    procedure: Annotated[
        str,
        typer.Argument(
            metavar="PROTOCOL",
            autocompletion=completed("protocol"),
            help="What is planned. Poses are searched: multi-position, hand-held, six-position. Any other protocol, by "
            "name (turntable-9, strapdown-rotation, multi-position-26, …) or as a file, is judged as it is.",
        ),
    ],
    planned: PlanOptions,
    wishes: WishOptions,
    site: SiteOptions,
    searched: PoseOptions,
    judged: ProtocolOptions,
    printed: LongPrintOptions,
    output: Path | None = option(FIRST, "FOLDER", "--output", "-o"),
) -> None:
    """Say how accurate a test will be before it is done, and find a better one.

    Of any protocol: both triads predicted, what it does not determine, what each step is worth, what to add:

    tumble plan turntable-9 --imu tactical --site 48.1

    Of poses: which poses, for how long, in which order; a protocol to simulate and to calibrate with, and
    a sheet to print for the operator:

    tumble plan multi-position --imu tactical --time 15 -o plan

    All numbers are one sigma.

    Parameters
    ----------
    output : A folder for protocol.yaml, plan.json and sheet.html.
    """
    from tumble.workflows.given.site import choose_site
    from tumble.workflows.planning.plan import kind_of_plan

    shared = {**asdict(planned), "site": choose_site(**asdict(site))}
    if kind_of_plan(procedure) == "poses":
        _refuse(context, [ProtocolOptions], f"a {procedure} test")
        asked = {"procedure": procedure, **shared, **asdict(wishes), **asdict(searched)}
        _search(asked, output, printed)
    else:
        _refuse(context, [PoseOptions], "a protocol as it is")
        _judge({"asked": procedure, **shared, **asdict(wishes), **asdict(judged)}, output, printed)


def _refuse(context: typer.Context, groups: list[type], what: str) -> None:
    refuse_given(context, groups, f"{{}} says nothing to {what}: leave it out.")


def _judge(asked: dict[str, Any], output: Path | None, printed: LongPrintOptions) -> None:
    """Judge a protocol as it is."""
    from tumble.cli.plan_tables import print_protocol
    from tumble.workflows.planning.protocol import plan_any_protocol

    with progress(printed.silent) as tell:
        done = plan_any_protocol(output=output, progress=tell, steps=not printed.quiet, **asked)
    results_stand()
    print_protocol(done, printed)


def _search(
    asked: dict[str, Any],
    output: Path | None,
    printed: LongPrintOptions,
) -> None:
    """Search the poses of a test."""
    from tumble.cli.plan_tables import print_poses
    from tumble.workflows.planning.poses import PoseOrder, plan_poses

    with progress(printed.silent) as tell:
        done = plan_poses(PoseOrder(**asked), output=output, progress=tell)
    results_stand()
    print_poses(done, printed)
