"""`tumble convert`: calibrations to and from other tools' files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, cast

from tumble.cli.options import PrintOptions
from tumble.cli.terminal import console, results_stand, say, say_json, say_written, table
from tumble.errors import UsageError
from tumble.workflows import FIRST, ConvertRequest, option, refuse

if TYPE_CHECKING:
    from tumble.workflows import Converted


def convert_command(
    asked: ConvertRequest,
    printed: PrintOptions,
    source: str | None = option(FIRST, "TARGET", "--from", complete="target"),
    output: Path | None = option(FIRST, "PATH", "--output", "-o"),
    units: str | None = option(FIRST, "UNIT,UNIT"),
) -> None:
    """Write a calibration as another tool's file, or read one. Without arguments: the list of targets.

    tumble convert calibrated --to kalibr -o imu-intrinsics.yaml

    With --frame alone the calibration is written anew in another frame, its covariance too.

    Each file says its formula and a test vector in its comments. What a form cannot hold is said with its
    size; too large a loss is refused.

    Parameters
    ----------
    source : Read this tool's file and write calibration.json.
    output : The file (default: the tool's own name for it).
    units : With --from: raw units where the file does not say them, as g,deg/s.
    """
    to, calibration = asked.target, cast("Path | None", asked.calibration)
    from tumble.workflows import Converted, convert_from, convert_to, list_targets, turn

    if to is None:
        of_targets = ["rate", "temperature", "largest_loss", "topic", "noise"]
        turned = calibration is not None and source is None
        refuse(asked, of_targets if turned else [*of_targets, "frame"], "{} goes with --to TARGET alone.")
    elif source is not None:
        raise UsageError(
            "--to and --from exclude each other: read into calibration.json first, then write from it."
        )
    if units is not None and source is None:
        raise UsageError("--units is about reading: it goes with --from TARGET alone.")
    if to is not None:
        done = convert_to(**vars(replace(asked, output=output)))
    elif calibration is None:
        if source is not None:
            raise UsageError("Name the file to read: tumble convert FILE --from TARGET.")
        _list(list_targets(), printed.as_json)
        return
    elif source is not None:
        done = convert_from(calibration, source, output=output or Path("calibration.json"), units=units)
    elif asked.frame is not None:
        file, document = turn(calibration, asked.frame, output or Path("turned.json"))
        done = Converted([file], document.remarks[-1:])
    else:
        raise UsageError("Say where to: --to or --from TARGET; `tumble convert` alone lists the targets.")
    results_stand()
    _say(done, printed)


def _say(done: Converted, printed: PrintOptions) -> None:
    if printed.as_json:
        say_json({"files": [str(f.resolve()) for f in done.files], "remarks": done.remarks})
        return
    if not printed.quiet:
        say(*(f"• {remark}" for remark in done.remarks))
    say_written(done.files)


def _list(rows: list[dict[str, str]], as_json: bool) -> None:
    if as_json:
        say_json(rows)
        return
    heads = ("target", "tool and file", "direction", "holds")
    console().print(table(heads, [[*row.values()] for row in rows]))
