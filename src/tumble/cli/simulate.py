"""`tumble simulate`: play a protocol on a simulated unit."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tumble.cli.options import Gravity, Json, Quiet, SiteOption
from tumble.cli.progress import progress, results_stand

if TYPE_CHECKING:
    from tumble.workflows.simulate import Simulated


def simulate_command(
    protocol: Annotated[
        str,
        typer.Argument(
            help="A protocol file, or the name of a protocol: six-position, multi-position-26 (18, 10, 9), rate-table, "
            "modified-multi-position, hand-held."
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
        int, typer.Option(help="Another seed is another unit, other placements, other noise.")
    ] = 0,
    site: SiteOption = None,
    gravity: Gravity = None,
    rate: Annotated[
        float | None, typer.Option(help="Sampling rate in Hz (default: the grade's own).")
    ] = None,
    units: Annotated[str, typer.Option(help="SI, or counts.")] = "SI",
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
    jitter: Annotated[
        float, typer.Option(help="Standard deviation of the stamps about the true instants, in ms.")
    ] = 0.0,
    dropped: Annotated[float, typer.Option(help="Share of the samples that are lost, in per cent.")] = 0.0,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Play a protocol on a simulated unit: try a test before you do it, or check what a calibration finds.

    Writes recording.csv (or a file a step), protocol.yaml and truth.json. `tumble calibrate --protocol
    DIR/protocol.yaml` needs nothing else; the truth, with the keys of calibration.json, is for you to
    compare. The same seed gives the same files.
    """
    from tumble.errors import UsageError
    from tumble.simulation import Imperfections
    from tumble.workflows.simulate import simulate
    from tumble.workflows.site import choose_site

    if not 0.0 <= dropped <= 50.0:
        raise UsageError(f"--dropped {dropped:g}: a share of the samples in per cent, from 0 to 50.")
    if not 0.0 <= jitter <= 1000.0:
        raise UsageError(f"--jitter {jitter:g}: milliseconds from 0 to 1000.")
    with progress(quiet or as_json) as say:
        done = simulate(
            protocol,
            output=output,
            grade=imu,
            seed=seed,
            site=choose_site(site, gravity),
            rate=rate,
            units=units,
            per_step=per_step,
            placement=placement,
            noise=noise,
            imperfections=Imperfections(jitter=1e-3 * jitter, dropped=1e-2 * dropped),
            progress=say,
        )
    results_stand()
    if as_json:
        files = [str(file.resolve()) for file in done.files]
        typer.echo(json.dumps({"files": files, "remarks": done.remarks, "truth": done.truth}))
        return
    _print(done, quiet)


def _print(done: Simulated, quiet: bool) -> None:
    if not quiet:
        for remark in done.remarks:
            typer.echo(remark)
        for file in done.files if len(done.files) <= 5 else [done.files[0], *done.files[-2:]]:
            typer.echo(f"written: {file.resolve()}")
        if len(done.files) > 5:
            typer.echo(f"... {len(done.files)} files in all")
    where = done.folder / "protocol.yaml"
    typer.echo(f"Next: tumble calibrate --protocol {where} -o {done.folder}/calibration")
