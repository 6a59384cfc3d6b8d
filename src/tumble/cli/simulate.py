"""`tumble simulate`: play a protocol on a simulated unit."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from tumble.cli.options import PrintOptions, SiteOptions
from tumble.cli.terminal import progress, results_stand, say, say_json, say_written
from tumble.workflows import SimulateRequest

if TYPE_CHECKING:
    from tumble.workflows import Simulated


def simulate_command(asked: SimulateRequest, site: SiteOptions, printed: PrintOptions) -> None:
    """Play a protocol on a simulated unit: try a test before you do it, or check what a calibration finds.

    tumble simulate turntable-9 --imu tactical --site 48.1 -o table

    Writes recording.csv, protocol.yaml and truth.json. `tumble calibrate --protocol
    DIR/protocol.yaml` needs nothing else; the truth, with the keys of calibration.json, is for you to
    compare. The same seed gives the same files, bit for bit.
    """
    from tumble.workflows import simulate

    with progress(printed.silent) as tell:
        done = simulate(**vars(replace(asked, site=site.place, progress=tell)))
    results_stand()
    if printed.as_json:
        files = [str(file.resolve()) for file in done.files]
        say_json({"files": files, "remarks": done.remarks, "next": _next(done), "truth": done.truth})
        return
    _print(done, printed.quiet)


def _next(done: Simulated) -> str:
    if done.truth["protocol"] == "rest":
        return f"tumble noise {done.files[0]} -o {done.folder / 'noise'}"
    return f"tumble calibrate --protocol {done.folder / 'protocol.yaml'} -o {done.folder / 'calibration'}"


def _print(done: Simulated, quiet: bool) -> None:
    if not quiet:
        truth = done.truth
        say(
            *done.remarks,
            f"Protocol {truth['protocol']}, {len(truth['steps'])} steps, {truth['samples']} samples at "
            f"{truth['rate_hz']:g} Hz, by a unit of the grade {truth['imu']['grade']} (seed {truth['unit_seed']}).",
            *(_true_noise(truth) if truth["protocol"] == "rest" else _true_lines(truth)),
        )
        say_written(done.files)
    say(f"Next: {_next(done)}")


def _true_noise(truth: dict[str, Any]) -> list[str]:
    """The true coefficients of noise in the units of `tumble noise`, a triad a line."""
    from tumble.noise import ACCELEROMETER, GYRO, practical_noise_unit

    if truth["noise"] is None:
        return ["", "No noise was added."]
    names = {"N": "random_walk", "B": "bias_instability", "K": "rate_random_walk"}
    lines = ["", "True noise of each axis, as `tumble noise` states it:"]
    for triad, quantity in (("accelerometer", ACCELEROMETER), ("gyroscope", GYRO)):
        units = {letter: practical_noise_unit(quantity, letter) for letter in names}
        parts = [
            f"{letter} {float(truth['noise'][triad][key]['value']) / units[letter].factor:.4g} {units[letter].sign}"
            for letter, key in names.items()
        ]
        lines.append(f"  {triad}: {', '.join(parts)}")
    return lines


def _true_lines(truth: dict[str, Any]) -> list[str]:
    """The true parameters, three to a line, in the convention and frame of the table of `tumble calibrate`."""
    from tumble.calibration import find_procedure
    from tumble.parameters import said_unit

    procedure = str(truth["procedure"])
    frame = find_procedure(procedure).frame
    other = "" if frame == "accelerometer-x" else f"_in_{frame.replace('-', '_')}"
    parameters: list[dict[str, object]] = truth[f"parameters{other}"]
    lines = ["", f"True parameters, as `tumble calibrate` names them ({procedure}, in the frame {frame}):"]
    for first in range(0, len(parameters), 3):
        three = parameters[first : first + 3]
        names = [str(parameter["name"]) for parameter in three]
        stem = names[0].rsplit(" ", 1)[0]
        tails = " ".join(name.rsplit(" ", 1)[1] for name in names)
        numbers = [float(str(parameter["value"])) for parameter in three]
        factor, unit = said_unit(str(three[0]["unit"]), map(abs, numbers))
        values = "".join(f"{factor * number:>14.6g}" for number in numbers)
        lines.append(f"  {stem + ' ' + tails:<44}{values} {unit}")
        if "session_value" in three[0]:
            session = "".join(f"{factor * float(str(p['session_value'])):>14.6g}" for p in three)
            lines.append(f"  {'  its mean in this session':<44}{session} {unit}")
    return [*lines, ""]
