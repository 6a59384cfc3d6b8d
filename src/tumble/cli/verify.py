"""`tumble verify`: judge a calibration on recordings that it has not seen; `tumble apply`: correct them by it.

`tumble verify --gnss`: judge a calibration by a drive with satellite positions.
"""

from __future__ import annotations

import math
import shlex
import sys
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, cast

import typer

from tumble.cli.options import PrintOptions, SiteOptions
from tumble.cli.terminal import console, progress, results_stand, say, say_json, say_written, table
from tumble.errors import UsageError
from tumble.workflows import (
    FIRST,
    OF_NO_DRIVE,
    ApplyRequest,
    CalibrateRequest,
    DriveRequest,
    VerifyRequest,
    option,
    refuse,
    shared,
)

if TYPE_CHECKING:
    from rich.table import Table

    from tumble.workflows import DriveVerification, Verification


def show_drive(found: DriveVerification, output: Path | None, printed: PrintOptions) -> NoReturn:
    """Write what was asked for, and print the rest; leaves with the verdict's status.

    Parameters
    ----------
    found : what was found.
    output : folder, or None.
    printed : how to print.

    Raises
    ------
    typer.Exit
        Always: 0 if it serves, 1 if not.
    """
    files: list[Path] = []
    if output is not None:
        files = found.write(output, shlex.join(["tumble", *sys.argv[1:]]))
        results_stand()
    if printed.as_json:
        say_json(found.document, indent=1)
    else:
        _print_drive(found.document, printed.quiet)
        say_written(files)
    raise typer.Exit(0 if found.fit else 1)


def _print_drive(document: dict[str, Any], quiet: bool) -> None:
    screen = console()
    if not quiet:
        for sentence in (document["time_offset"]["words"], document["alignment"], *document["remarks"]):
            screen.print(f"• {sentence}")
        for title, key in (
            ("Free drift from known starts, horizontal rms, m", "drift"),
            ("Outages one by one, m", "outages_sliding"),
            ("Outages again and again, m", "outages_repeated"),
        ):
            screen.print(_errors_table(document["variants"], title, key))
        for sentence in document["setting"]:
            screen.print(f"• {sentence}")
    _print_verdict(document["fit"], document["reasons"])


def _print_verdict(fit: bool, reasons: list[str]) -> None:
    screen = console()
    screen.print("SERVES" if fit else "DOES NOT SERVE", style="bold green" if fit else "bold red")
    for reason in reasons:
        screen.print(f"• {reason}")


def _errors_table(variants: list[dict[str, Any]], title: str, key: str) -> object:
    from tumble.report import metres

    chosen = {one["seconds"] for one in variants[0]["outages_sliding"]}
    rows = [[one for one in variant[key] if one["seconds"] in chosen] for variant in variants]
    heads = ["corrected by", *(f"{one['seconds']:g} s" for one in rows[0])]
    cells = [
        [variant["name"], *(metres(one["horizontal_rms"]) for one in row)]
        for variant, row in zip(variants, rows, strict=True)
    ]
    return table(heads, cells, right=range(1, len(heads)), title=title, box=None)


def verify_command(
    asked: DriveRequest,
    site: SiteOptions,
    printed: PrintOptions,
    limits: Path | None = shared(CalibrateRequest, "limits"),
    output: Path | None = option(FIRST, "DIR", "--output", "-o"),
) -> None:
    """Judge a calibration on another recording: the norm of each hold, the angle left after each turn.

    tumble verify calibrated another.csv

    With --gnss the recording is a drive, and the calibration is judged by navigation: free drift and outages with
    it, with parts of it, and without, in metres.

    The residuals are compared with what the calibration's uncertainty and the noise explain. Gravity
    is the calibration's own unless --site or --gravity is given. A calibration with a thermal model follows the
    recording's temperature. Exit status 0: it serves; 1: not. With --limits its parameters have to be within them.

    Parameters
    ----------
    output : With --gnss: folder for verify.json and verify.html.
    """
    if asked.gnss is not None:
        refuse(site, ("site", "gravity"), OF_NO_DRIVE)
        if limits is not None:
            raise UsageError(OF_NO_DRIVE.format("--limits"))
        from tumble.files import results_folder
        from tumble.workflows import verify_drive

        results_folder(output)
        with progress(printed.silent) as tell:
            found = verify_drive(**vars(replace(asked, progress=tell)))
        show_drive(found, output, printed)
    of_drives = "{} is for a drive: give its satellite positions with --gnss."
    refuse(asked, ("lever_arm_b", "data_sheet", "turn_on"), of_drives)
    if output is not None:
        raise UsageError(of_drives.format("--output"))
    from tumble.document import read_calibration
    from tumble.limits import decide, read_limits
    from tumble.workflows import verify

    calibration = cast("Path", asked.calibration)
    held = None if limits is None else decide(read_calibration(calibration), read_limits(limits))
    with progress(printed.silent) as tell:
        asked = replace(asked, site=site.place, progress=tell)
        results = verify(**{one.name: getattr(asked, one.name) for one in fields(VerifyRequest)})
    if printed.as_json:
        told = {} if held is None else {"limits": held}
        say_json([result.document | told for result in results], indent=1)
    else:
        for result in results:
            if not printed.quiet:
                console().print(_table(result))
            _print_verdict(result.fit, result.reasons)
        if held is not None:
            from tumble.report import limits_verdict, print_blocks

            print_blocks([limits_verdict(held)], console())
    within = held is None or held.decision == "passed"
    raise typer.Exit(0 if within and all(result.fit for result in results) else 1)


def _table(result: Verification) -> Table:
    rows: list[list[str]] = []
    for k, (norm, sigma) in enumerate(
        zip(result.hold_norm_error, result.hold_norm_standard_uncertainty, strict=True)
    ):
        turn = f"{math.degrees(result.turn_size[k]):.0f}" if math.isfinite(result.turn_size[k]) else "–"
        scored = f"{math.degrees(result.turn_angle[k]):.3f}" if math.isfinite(result.turn_angle[k]) else "–"
        rows.append([str(k + 1), f"{1e3 * norm:+.2f}", f"{1e3 * sigma:.2f}", turn, scored])
    heads = ("hold", "|f| − g, mm/s²", "± expected", "turn after it, °", "gravity off by, °")
    shown = table(heads, rows, right=range(5), title=result.recording, box="HEAVY_HEAD")
    shown.pad_edge = True
    return shown


def apply_command(asked: ApplyRequest, printed: PrintOptions) -> None:
    """Correct a recording: specific force in m/s², angular rate in rad/s, in the calibration's frame b.

    tumble apply calibrated imu.csv -o corrected.csv

    tumble apply calibrated drive.bag -o drive-corrected.bag

    Of a bag everything but the IMU's messages stays as it is, byte for byte. Recordings longer than memory are
    corrected block by block. A calibration with a thermal model follows the recording's temperature; beyond the
    temperatures that were calibrated it refuses (see --outside). The file says which calibrations it went through:
    none is applied twice.
    """
    from tumble.workflows import apply

    with progress(printed.silent) as tell:
        tell("reading")

        def so_far(samples: int) -> None:
            tell(f"{samples:,} samples corrected")

        done = apply(**vars(replace(asked, progress=so_far)))
    results_stand()
    if printed.as_json:
        say_json({"file": str(done.file.resolve()), "samples": done.samples, "remarks": done.remarks})
        return
    if not printed.quiet:
        say(*done.remarks)
    say(f"{done.samples} samples corrected, written: {done.file.resolve()}")
