"""`tumble convert`: calibrations to and from other tools' files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tumble.cli.options import NoiseFile, PrintOptions
from tumble.cli.terminal import console, results_stand, say, say_json, say_written, table
from tumble.errors import UsageError
from tumble.records import dataclass
from tumble.workflows.request import ADVANCED, FIRST, argument, option

if TYPE_CHECKING:
    from tumble.workflows.convert import Converted

_NOISE = "Noise, for tools that want it"


@dataclass(frozen=True)
class FormOptions:
    """What another tool's file leaves open.

    Attributes
    ----------
    frame : Frame of corrected vectors, where the form leaves it open.
    at_temperature : Take a calibration with temperature at this one.
    largest_loss : Refuse what loses more than this of a vector's length.
    ros_topic : ROS topic, for forms that name one (the bag's, else /imu0).
    """

    frame: str | None = option(ADVANCED, "NAME")
    at_temperature: float | None = option(ADVANCED, "CELSIUS")
    largest_loss: float = option(ADVANCED, "PPM", default=20000.0, show_default=True)
    ros_topic: str | None = option(ADVANCED, "NAME")


@dataclass(frozen=True)
class NoiseOptions:
    """Noise that is written beside a calibration.

    Attributes
    ----------
    consumer_rate : Rate that the consumer runs at, for per-sample noise.
    """

    noise: NoiseFile = None
    consumer_rate: float | None = option(_NOISE, "HZ")


def convert_command(
    form: FormOptions,
    noise: NoiseOptions,
    printed: PrintOptions,
    calibration: Path | None = argument("[CALIBRATION]", default=None),
    to: str | None = option(FIRST, "TARGET", complete="target"),
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
    calibration : calibration.json, or the folder that holds it; with --from another tool's file.
    to : Write it in this tool's form.
    source : Read this tool's file and write calibration.json.
    output : The file (default: the tool's own name for it).
    units : With --from: raw units where the file does not say them, as g,deg/s.
    """
    if to is not None and source is not None:
        raise UsageError(
            "--to and --from exclude each other: read into calibration.json first, then write from it."
        )
    if to is None and source is None and calibration is None:
        _list(printed.as_json)
        return
    if to is not None:
        if units is not None:
            raise UsageError("--units is about reading: leave it out with --to.")
        done = _write(calibration, to, output, form, noise)
    elif calibration is None:
        raise UsageError("Name the file to read: tumble convert FILE --from TARGET.")
    elif source is not None:
        from tumble.workflows.convert import convert_from

        done = convert_from(calibration, source, output=output or Path("calibration.json"), units=units)
    else:
        done = _turn(calibration, output, form)
    results_stand()
    _say(done, printed)


def _write(
    calibration: Path | None, target: str, output: Path | None, form: FormOptions, noise: NoiseOptions
) -> Converted:
    from tumble.workflows.convert import convert_to

    return convert_to(
        calibration,
        target,
        output=output,
        noise=noise.noise,
        rate=noise.consumer_rate,
        largest_loss=1e-6 * form.largest_loss,
        frame=form.frame,
        temperature=form.at_temperature,
        topic=form.ros_topic,
    )


def _turn(calibration: Path, output: Path | None, form: FormOptions) -> Converted:
    from tumble.workflows.convert import Converted, turn

    if form.frame is None:
        raise UsageError(
            "Say where to: --to TARGET or --from TARGET; `tumble convert` alone lists the targets."
        )
    file, document = turn(calibration, form.frame, output or Path("turned.json"))
    return Converted([file], document.remarks[-1:])


def _say(done: Converted, printed: PrintOptions) -> None:
    if printed.as_json:
        say_json({"files": [str(f.resolve()) for f in done.files], "remarks": done.remarks})
        return
    if not printed.quiet:
        say(*(f"• {remark}" for remark in done.remarks))
    say_written(done.files)


def _list(as_json: bool) -> None:
    from tumble.workflows.convert import list_targets

    rows = list_targets()
    if as_json:
        say_json(
            [{"name": r.name, "title": r.title, "directions": r.directions, "holds": r.holds} for r in rows]
        )
        return
    heads = ("target", "tool and file", "direction", "holds")
    console().print(table(heads, [(r.name, r.title, r.directions, r.holds) for r in rows]))
