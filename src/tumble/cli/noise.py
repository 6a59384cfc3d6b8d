"""`tumble noise`: what a sensor at rest shows, by Allan deviation and spectrum."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from tumble.cli.options import Columns, Json, Quiet, Rate, Recordings, Topics, Units
from tumble.cli.progress import progress, results_stand

_LETTERS = (
    "Letters as in IEEE Std 952. B: flicker of two-sided density B²/(2πf); the curve's floor is 0.664 B. "
    "N: two-sided; a one-sided noise density is √2 N."
)


def noise_command(
    recording: Recordings,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder for noise.json and noise.html.")
    ] = None,
    kind: Annotated[
        str,
        typer.Option(
            metavar="overlapping|modified|hadamard|haar",
            help="Which deviation is printed and drawn. The terms are of the overlapping Allan deviation always.",
        ),
    ] = "overlapping",
    taus: Annotated[
        str,
        typer.Option(
            metavar="octave|decade|log|all|LIST",
            help="Its averaging times: doubling, 1 2 4 a decade, ten a decade, every one, or a list in s as 0.1,1,10.",
        ),
    ] = "log",
    fit: Annotated[
        str,
        typer.Option(
            metavar="curve|moments",
            help="How the terms are found: a weighted fit of the whole curve, or the generalized method of wavelet "
            "moments.",
        ),
    ] = "curve",
    skip: Annotated[float, typer.Option(help="Seconds at the start to leave out, such as warm-up.")] = 0.0,
    remove_temperature: Annotated[
        bool,
        typer.Option("--remove-temperature", help="Take a straight line in the temperature off first."),
    ] = False,
    stream: Annotated[
        bool | None,
        typer.Option(
            "--stream/--whole",
            help="Read block by block, twice, in little memory; by default above half a gigabyte of numbers.",
        ),
    ] = None,
    units: Units = None,
    columns: Columns = None,
    rate: Rate = None,
    topic: Topics = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Noise of a unit at rest: white noise, bias instability and random walks of every channel.

    Record the unit lying still, warm, for hours. What is not rest (motion, steps, gaps, dead channels) is
    said and left out.
    """
    from tumble.workflows.noise import analyse_noise

    with progress(quiet or as_json) as say:
        analysis = analyse_noise(
            recording,
            output=output,
            columns=columns,
            units=units,
            rate=rate,
            topics=topic,
            skip=skip,
            remove_temperature=remove_temperature,
            kind=kind,
            taus=taus,
            fit=fit,
            stream=stream,
            progress=say,
        )
    if analysis.files:
        results_stand()
    if as_json:
        typer.echo(json.dumps(analysis.document, indent=1, ensure_ascii=False))
        return
    from tumble.report.noise_words import KINDS, curve_lines, noise_lines, triad_lines

    noise = analysis.noise
    if not quiet:
        for sentence in noise.sentences:
            typer.echo(f"• {sentence}")
        typer.echo("")
    for line in noise_lines(noise.channels, seen_only=quiet):
        typer.echo(line)
    if not quiet:
        for line in triad_lines(noise.channels):
            typer.echo(line)
        typer.echo(f"\n{KINDS[noise.kind]}:")
        for line in curve_lines(noise.channels, every="," in taus or taus in ("octave", "decade")):
            typer.echo(line)
        typer.echo(f"\n{_LETTERS}")
    for file in analysis.files:
        typer.echo(f"written: {file.resolve()}")
