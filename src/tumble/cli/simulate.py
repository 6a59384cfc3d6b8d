"""`tumble simulate`: play a protocol on a simulated unit."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tumble.cli.fixture import fixture_errors
from tumble.cli.options import Gravity, Json, Quiet, SiteOption
from tumble.cli.progress import progress, results_stand
from tumble.cli.table import lever_arm, table_errors

if TYPE_CHECKING:
    from tumble.workflows.simulate import Simulated

_TABLE, _FIXTURE = "Turntable", "Two-axis fixture (any of these puts the unit on one)"
# More files than this are counted instead of listed.
LISTED = 5
# What ratios and angles are shown in.
_PRACTICAL = {"1": (1e6, "ppm"), "rad": (1e3, "mrad")}


def simulate_command(
    protocol: Annotated[
        str,
        typer.Argument(
            help="A protocol file, or the name of a protocol: six-position, multi-position-26 (18, 10, 9), rate-table, "
            "modified-multi-position, turntable-9 (18), laboratory, strapdown-rotation, thermal-soak, "
            "thermal-ramp (-tumbled), thermal-fridge, hand-held; or rest, a unit that lies still, for `tumble noise`."
        ),
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder for the files (default: NAME-simulated).")
    ] = None,
    imu: Annotated[
        str,
        typer.Option(
            help="Grade of the unit: consumer-mems, industrial-mems, hg1900, hg1700, tactical, ring-laser."
        ),
    ] = "consumer-mems",
    seed: Annotated[
        int, typer.Option(help="Another seed is another session, and another unit of the grade.")
    ] = 0,
    unit: Annotated[
        int | None,
        typer.Option(help="Seed of the unit alone: the same unit in another session (default: the seed)."),
    ] = None,
    site: SiteOption = None,
    gravity: Gravity = None,
    rate: Annotated[
        float | None, typer.Option(help="Sampling rate in Hz (default: the protocol's or the grade's own).")
    ] = None,
    duration: Annotated[
        float | None, typer.Option(help="With rest: seconds to record (default: 600).")
    ] = None,
    units: Annotated[str, typer.Option(help="SI, or counts.")] = "SI",
    axes: Annotated[
        str, typer.Option(help="What the poses are of: the axes of the unit, or of its case (HG units).")
    ] = "unit",
    per_step: Annotated[
        bool, typer.Option("--per-step/--one-file", help="A file for each hold and spin, or one for all.")
    ] = False,
    placement: Annotated[
        bool,
        typer.Option(
            "--placement/--no-placement", help="Make the placement errors that the protocol allows."
        ),
    ] = True,
    noise: Annotated[
        bool, typer.Option("--noise/--no-noise", help="Add noise and the converter's steps.")
    ] = True,
    nonlinear: Annotated[
        bool, typer.Option("--nonlinear", help="Also draw quadratic terms of the sheet's linearity.")
    ] = False,
    wander: Annotated[
        bool, typer.Option("--wander", help="Also let biases wander by the sheet's in-run stability.")
    ] = False,
    asymmetry_ppm: Annotated[
        float, typer.Option(help="Standard deviation of each sensor's scale-factor asymmetry, in ppm.")
    ] = 0.0,
    turn_on: Annotated[
        str | None,
        typer.Option(
            "--turn-on",
            metavar="MG,DEG/H",
            help="By how much biases move when the unit is switched on, one sigma; drawn with the session.",
        ),
    ] = None,
    angle_pulse_arcsec: Annotated[
        float, typer.Option(help="The gyros send whole pulses of so many arc-seconds.")
    ] = 0.0,
    velocity_pulse_mm_per_s: Annotated[
        float, typer.Option(help="The accelerometers send whole pulses of so many mm/s.")
    ] = 0.0,
    jitter: Annotated[
        float, typer.Option(help="Standard deviation of the stamps about the true instants, in ms.")
    ] = 0.0,
    sampling_jitter: Annotated[
        float,
        typer.Option(help="Standard deviation of the instants themselves, which no stamp tells, in ms."),
    ] = 0.0,
    dropped: Annotated[float, typer.Option(help="Share of the samples that are lost, in per cent.")] = 0.0,
    burst: Annotated[float, typer.Option(help="How many samples are lost at a time, on average.")] = 1.0,
    table_angle_arcsec: Annotated[
        float | None,
        typer.Option(
            help="Standard deviation of each angle against the display, in arc-seconds (default: the protocol's).",
            rich_help_panel=_TABLE,
        ),
    ] = None,
    table_once_arcsec: Annotated[
        float,
        typer.Option(
            help="Systematic error of the angle, once a revolution, in arc-seconds.", rich_help_panel=_TABLE
        ),
    ] = 0.0,
    table_twice_arcsec: Annotated[
        float, typer.Option(help="The same, twice a revolution.", rich_help_panel=_TABLE)
    ] = 0.0,
    table_tilt_deg: Annotated[
        float,
        typer.Option(
            help="Standard deviation of the axes' lean from where the protocol has them, in degrees.",
            rich_help_panel=_TABLE,
        ),
    ] = 0.0,
    table_wobble_arcsec: Annotated[
        float,
        typer.Option(
            help="Half angle of the cone that the axis describes, in arc-seconds.", rich_help_panel=_TABLE
        ),
    ] = 0.0,
    table_ripple_ppm: Annotated[
        float,
        typer.Option(help="Amplitude of the rate's ripple, in ppm of the rate.", rich_help_panel=_TABLE),
    ] = 0.0,
    table_ripple_cycles: Annotated[
        int, typer.Option(help="How often it comes in a revolution.", rich_help_panel=_TABLE)
    ] = 12,
    table_ramps: Annotated[
        float,
        typer.Option(
            help="Standard deviation of the time of each ramp, in per cent of it.", rich_help_panel=_TABLE
        ),
    ] = 0.0,
    table_shake_ug: Annotated[
        float,
        typer.Option(
            help="Standard deviation that turning adds to each accelerometer sample, in millionths of g.",
            rich_help_panel=_TABLE,
        ),
    ] = 0.0,
    table_stops: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SPIN:PERCENT",
            help="A spin, counted from 1, that stops after so much of its angle; may be given again.",
            rich_help_panel=_TABLE,
            show_default=False,
        ),
    ] = None,
    fixture_azimuth_deg: Annotated[
        float | None,
        typer.Option(
            help="Where the outer axis points, in degrees clockwise from north (default: the protocol's, east).",
            show_default=False,
            rich_help_panel=_FIXTURE,
        ),
    ] = None,
    fixture_installation_mrad: Annotated[
        float | None,
        typer.Option(
            help="Standard deviation of the outer axis' heading and of both tilts, in milliradians.",
            show_default=False,
            rich_help_panel=_FIXTURE,
        ),
    ] = None,
    fixture_orthogonality_mrad: Annotated[
        float | None,
        typer.Option(
            help="Standard deviation of the angle between the axes about a right one, in milliradians.",
            show_default=False,
            rich_help_panel=_FIXTURE,
        ),
    ] = None,
    fixture_zero_mrad: Annotated[
        float | None,
        typer.Option(
            help="Standard deviation of both angles' zero, in milliradians.",
            show_default=False,
            rich_help_panel=_FIXTURE,
        ),
    ] = None,
    fixture_mounting_mrad: Annotated[
        float | None,
        typer.Option(
            help="Standard deviation of how the unit lies on the inner axis, about each axis, in milliradians.",
            show_default=False,
            rich_help_panel=_FIXTURE,
        ),
    ] = None,
    fixture_execution_mrad: Annotated[
        float | None,
        typer.Option(
            help="Standard deviation of each stop of each axis, in milliradians.",
            show_default=False,
            rich_help_panel=_FIXTURE,
        ),
    ] = None,
    fixture_rate_deg_per_s: Annotated[
        float | None,
        typer.Option(
            help="Rate of its rotations, in degrees per second (default: as long as the protocol says).",
            show_default=False,
            rich_help_panel=_FIXTURE,
        ),
    ] = None,
    fixture_ramp_s: Annotated[
        float | None,
        typer.Option(
            help="Seconds to come to the rate, and to stop (default: 0.5).",
            show_default=False,
            rich_help_panel=_FIXTURE,
        ),
    ] = None,
    fixture_pause_s: Annotated[
        float | None,
        typer.Option(
            help="Seconds of rest between the rotations of a sequence (default: 1).",
            show_default=False,
            rich_help_panel=_FIXTURE,
        ),
    ] = None,
    lever_arm_cm: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z",
            help="From the centre of table or fixture to the accelerometers, in b; nine numbers for a place of each.",
            rich_help_panel=_TABLE,
        ),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Play a protocol on a simulated unit: try a test before you do it, or check what a calibration finds.

    Writes recording.csv (or a file a step), protocol.yaml and truth.json. `tumble calibrate --protocol
    DIR/protocol.yaml` needs nothing else; the truth, with the keys of calibration.json, is for you to
    compare. The same seed gives the same files, bit for bit.
    """
    from tumble.cli.verify_drive import turn_on_of
    from tumble.errors import UsageError
    from tumble.simulation import Imperfections
    from tumble.workflows.simulate import simulate
    from tumble.workflows.site import choose_site

    if not 0.0 <= dropped <= 50.0:
        raise UsageError(f"--dropped {dropped:g}: a share of the samples in per cent, from 0 to 50.")
    if not 1.0 <= burst <= 1e6:
        raise UsageError(f"--burst {burst:g}: how many samples are lost at a time, 1 or more.")
    for name, value in (("jitter", jitter), ("sampling-jitter", sampling_jitter)):
        if not 0.0 <= value <= 1000.0:
            raise UsageError(f"--{name} {value:g}: milliseconds from 0 to 1000.")
    for name, value, largest in (
        ("asymmetry-ppm", asymmetry_ppm, 1e5),
        ("angle-pulse-arcsec", angle_pulse_arcsec, 36_000.0),
        ("velocity-pulse-mm-per-s", velocity_pulse_mm_per_s, 1000.0),
    ):
        if not 0.0 <= value <= largest:
            raise UsageError(f"--{name} {value:g}: a number from 0 to {largest:g}.")
    fixture, azimuth = fixture_errors(
        azimuth=fixture_azimuth_deg,
        installation=fixture_installation_mrad,
        orthogonality=fixture_orthogonality_mrad,
        zero=fixture_zero_mrad,
        mounting=fixture_mounting_mrad,
        execution=fixture_execution_mrad,
        rate=fixture_rate_deg_per_s,
        ramp=fixture_ramp_s,
        pause=fixture_pause_s,
    )
    table = table_errors(
        angle=table_angle_arcsec,
        once=table_once_arcsec,
        twice=table_twice_arcsec,
        tilt=table_tilt_deg,
        wobble=table_wobble_arcsec,
        ripple=table_ripple_ppm,
        cycles=table_ripple_cycles,
        ramps=table_ramps,
        shake=table_shake_ug,
        stops=table_stops or [],
    )
    with progress(quiet or as_json) as say:
        done = simulate(
            protocol,
            output=output,
            grade=imu,
            seed=seed,
            unit=unit,
            site=choose_site(site, gravity),
            rate=rate,
            duration=duration,
            units=units,
            axes=axes,
            per_step=per_step,
            placement=placement,
            noise=noise,
            nonlinear=nonlinear,
            wander=wander,
            asymmetry=1e-6 * asymmetry_ppm,
            turn_on=(0.0, 0.0) if turn_on is None else turn_on_of(turn_on),
            imperfections=Imperfections(
                jitter=1e-3 * jitter,
                sampling_jitter=1e-3 * sampling_jitter,
                dropped=1e-2 * dropped,
                burst=burst,
                angle_increment=math.radians(angle_pulse_arcsec / 3600.0),
                velocity_increment=1e-3 * velocity_pulse_mm_per_s,
            ),
            table=table,
            fixture=fixture,
            fixture_azimuth=azimuth,
            lever_arm_b=lever_arm(lever_arm_cm),
            progress=say,
        )
    results_stand()
    if as_json:
        files = [str(file.resolve()) for file in done.files]
        typer.echo(
            json.dumps(
                {"files": files, "remarks": done.remarks, "next": _next(done), "truth": done.truth},
                ensure_ascii=False,
            )
        )
        return
    _print(done, quiet)


def _next(done: Simulated) -> str:
    if done.truth["protocol"] == "rest":
        return f"tumble noise {done.files[0]} -o {done.folder / 'noise'}"
    return f"tumble calibrate --protocol {done.folder / 'protocol.yaml'} -o {done.folder / 'calibration'}"


def _print(done: Simulated, quiet: bool) -> None:
    if not quiet:
        truth = done.truth
        for remark in done.remarks:
            typer.echo(remark)
        typer.echo(
            f"Protocol {truth['protocol']}, {len(truth['steps'])} steps, {truth['samples']} samples at "
            f"{truth['rate_hz']:g} Hz, by a unit of the grade {truth['imu']['grade']} (seed {truth['unit_seed']})."
        )
        for line in _true_noise(truth) if truth["protocol"] == "rest" else _true_lines(truth):
            typer.echo(line)
        for file in done.files if len(done.files) <= LISTED else [done.files[0], *done.files[-2:]]:
            typer.echo(f"written: {file.resolve()}")
        if len(done.files) > LISTED:
            typer.echo(f"... {len(done.files)} files in all")
    typer.echo(f"Next: {_next(done)}")


def _true_noise(truth: dict[str, Any]) -> list[str]:
    """The true coefficients of noise in the units of `tumble noise`, a triad a line."""
    from tumble.noise.units import ACCELEROMETER, GYRO, practical_noise_unit

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
    from tumble.workflows.truth import FIXTURE_PROCEDURES, MEAN_GYRO_PROCEDURES

    procedure = str(truth["procedure"])
    frame, key = "accelerometer-x", "parameters"
    if procedure in FIXTURE_PROCEDURES:
        frame, key = "fixture", "parameters_in_fixture"
    elif procedure in MEAN_GYRO_PROCEDURES:
        frame, key = "mean-gyro", "parameters_in_mean_gyro"
    parameters: list[dict[str, object]] = truth[key]
    named = f"True parameters, as the procedure {procedure} of `tumble calibrate` names them in the frame {frame}:"
    lines = ["", named]
    for first in range(0, len(parameters), 3):
        three = parameters[first : first + 3]
        names = [str(parameter["name"]) for parameter in three]
        stem = names[0].rsplit(" ", 1)[0]
        tails = " ".join(name.rsplit(" ", 1)[1] for name in names)
        factor, unit = _PRACTICAL.get(str(three[0]["unit"]), (1.0, str(three[0]["unit"])))
        values = "".join(f"{factor * float(str(parameter['value'])):>14.6g}" for parameter in three)
        lines.append(f"  {stem + ' ' + tails:<44}{values} {unit}")
        if "session_value" in three[0]:
            session = "".join(f"{factor * float(str(p['session_value'])):>14.6g}" for p in three)
            lines.append(f"  {'  its mean in this session':<44}{session} {unit}")
    return [*lines, ""]
