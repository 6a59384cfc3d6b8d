"""`tumble mount`: how a calibrated unit lies on its mount."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from tumble.cli.options import PrintOptions
from tumble.cli.terminal import console, progress, results_stand, say_json_text, say_written, table
from tumble.workflows import MountRequest

if TYPE_CHECKING:
    from tumble.workflows import Mounted


def mount_command(asked: MountRequest, printed: PrintOptions) -> None:
    """Say how a calibrated unit lies on its mount: three angles, from gravity in two attitudes of the mount.

    A calibration corrects the sensors in the unit's own axes; what uses them knows the mount's. Level the
    mount (shims), record ten seconds; pitch it by 90° about its y axis until x is up, record ten more.
    """
    from tumble.workflows import mount

    with progress(printed.silent) as tell:
        done = mount(replace(asked, progress=tell))
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
