"""`tumble mount`: how a calibrated unit lies on its mount."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tumble.cli.groups import FIRST, option
from tumble.cli.options import FileOptions, PrintOptions, output_option
from tumble.cli.terminal import console, progress, results_stand, say_json_text, say_written, table

if TYPE_CHECKING:
    from tumble.workflows.mount import Mounted


def mount_command(
    level: Annotated[Path, typer.Argument(metavar="LEVEL", help="A recording at rest with the mount level.")],
    pitched: Annotated[
        Path,
        typer.Argument(
            metavar="PITCHED",
            help="A recording at rest with the mount pitched by 90° about its y axis, x up.",
        ),
    ],
    calibration: Annotated[
        Path,
        option(FIRST, "CALIBRATION", "calibration.json, or the folder that holds it.", "--calibration", "-c"),
    ],
    file: FileOptions,
    printed: PrintOptions,
    output: Annotated[
        Path, output_option("The file, or the folder for mount.json (default: mount.json).", "PATH")
    ] = Path("mount.json"),
    mount_mrad: Annotated[
        float,
        option(
            FIRST,
            "MRAD",
            "How well the mount was levelled and turned about its y axis, one sigma.",
            show_default=True,
        ),
    ] = 0.0,
) -> None:
    """Say how a calibrated unit lies on its mount: three angles, from gravity in two attitudes of the mount.

    A calibration corrects the sensors in the unit's own axes; what uses them knows the mount's. Level the
    mount (shims), record ten seconds; pitch it by 90° about its y axis until x is up, record ten more.
    """
    from tumble.workflows.mount import mount

    with progress(printed.silent) as tell:
        done = mount(
            level,
            pitched,
            calibration,
            output=output,
            mount_sigma=1e-3 * mount_mrad,
            progress=tell,
            **file.given(),
        )
    results_stand()
    if printed.as_json:
        say_json_text(done.file.read_text(encoding="utf-8"))
        return
    _print(done, printed.quiet)


def _print(done: Mounted, quiet: bool) -> None:
    screen, found = console(), done.alignment
    rows = [
        [f"the unit's {axis}", f"{1e3 * angle:+.4f}", f"{1e3 * sigma:.4f}"]
        for axis, angle, sigma in zip("xyz", found.angles, found.sigmas, strict=True)
    ]
    heads = ("turned about", "mrad", "± one sigma")
    screen.print(table(heads, rows, right=(1, 2, 3)))
    if not quiet:
        for name, seconds, norm in zip(("Level", "Pitched"), done.seconds, done.norms, strict=True):
            screen.print(f"{name}: {seconds:.1f} s at rest, {1e3 * norm:+.2f} mm/s² off gravity.")
        for remark in done.remarks:
            screen.print(f"• {remark}")
    say_written([done.file])
