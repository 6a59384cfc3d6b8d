"""`tumble mount`: how a calibrated unit lies on its mount."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tumble.cli.options import Columns, Gravity, Json, Quiet, Rate, SiteOption, Topics, Units
from tumble.cli.progress import progress, results_stand

if TYPE_CHECKING:
    from tumble.workflows.mount import Mounted


def mount_command(
    level: Annotated[Path, typer.Argument(help="A recording at rest with the mount level.")],
    pitched: Annotated[
        Path, typer.Argument(help="A recording at rest with the mount pitched by 90° about its y axis, x up.")
    ],
    calibration: Annotated[
        Path, typer.Option("--calibration", "-c", help="calibration.json, or the folder that holds it.")
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="The file, or the folder for mount.json.")
    ] = Path("mount.json"),
    mount_mrad: Annotated[
        float, typer.Option(help="How well the mount was levelled and turned about its y axis, one sigma.")
    ] = 0.0,
    site: SiteOption = None,
    gravity: Gravity = None,
    units: Units = None,
    columns: Columns = None,
    rate: Rate = None,
    topic: Topics = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Tell how a calibrated unit lies on its mount: three angles, from gravity in two attitudes of the mount.

    A calibration corrects the sensors in the unit's own axes; what uses them knows the mount's. Level the
    mount (shims), record ten seconds; pitch it by 90° about its y axis until x is up, record ten more.
    """
    from tumble.workflows.mount import mount
    from tumble.workflows.site import choose_site

    place = choose_site(site, gravity)
    with progress(quiet or as_json) as say:
        done = mount(
            level,
            pitched,
            calibration,
            output=output,
            mount_sigma=1e-3 * mount_mrad,
            site=place,
            columns=columns,
            units=units,
            rate=rate,
            topics=topic,
            progress=say,
        )
    results_stand()
    if as_json:
        typer.echo(done.file.read_text(encoding="utf-8"), nl=False)
        return
    _print(done, quiet)


def _print(done: Mounted, quiet: bool) -> None:
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False)
    found = done.alignment
    table = Table(box=SIMPLE, pad_edge=False)
    for name in ("turned about", "exact, mrad", "± one sigma", "first order, mrad"):
        table.add_column(name, justify="left" if name == "turned about" else "right")
    for axis, exact, sigma, first in zip("xyz", found.angles, found.sigmas, found.first_order, strict=True):
        table.add_row(
            f"the unit's {axis}", f"{1e3 * exact:+.4f}", f"{1e3 * sigma:.4f}", f"{1e3 * first:+.4f}"
        )
    console.print(table)
    if not quiet:
        for name, seconds, norm in zip(("Level", "Pitched"), done.seconds, done.norms, strict=True):
            console.print(f"{name}: {seconds:.1f} s at rest, {1e3 * norm:+.2f} mm/s² off gravity.")
        for remark in done.remarks:
            console.print(f"• {remark}", markup=False)
    typer.echo(f"written: {done.file.resolve()}")
