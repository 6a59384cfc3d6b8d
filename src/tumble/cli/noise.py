"""`tumble noise`: what a sensor at rest shows, by Allan deviation and spectrum."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from tumble.cli.groups import ADVANCED, FIRST, option
from tumble.cli.options import (
    FiguresOption,
    FileOptions,
    PrintOptions,
    Recordings,
    check_figures,
    draw_figures,
    output_option,
)
from tumble.cli.terminal import progress, results_stand, say, say_json, say_written
from tumble.records import dataclass

_LETTERS = (
    "Letters as in IEEE Std 952. B: flicker of two-sided density B²/(2πf); the curve's floor is 0.664 B. "
    "N: two-sided; a one-sided noise density is √2 N."
)


@dataclass(frozen=True)
class AnalysisOptions:
    """What is analysed, and how."""

    skip: Annotated[float, option(FIRST, "S", "Seconds at the start to leave out, such as warm-up.")] = 0.0
    remove_temperature: Annotated[
        bool, option(FIRST, "", "Take a straight line in the temperature off first.", "--remove-temperature")
    ] = False
    fit: Annotated[
        str,
        option(
            ADVANCED,
            "WAY",
            "How the terms are found: curve, a weighted fit of the whole curve (default), or moments, the "
            "generalized method of wavelet moments.",
        ),
    ] = "curve"


def noise_command(
    recording: Recordings,
    file: FileOptions,
    analysis: AnalysisOptions,
    printed: PrintOptions,
    output: Annotated[Path | None, output_option("Folder for noise.json and noise.html.")] = None,
    figures: FiguresOption = None,
) -> None:
    """Noise of a unit at rest: white noise, bias instability and random walks of every channel.

    tumble noise still.csv -o noise

    Record the unit lying still, warm, for hours. What is not rest (motion, steps, gaps, dead channels) is
    said and left out.
    """
    from tumble.workflows.noise import analyse_noise

    check_figures(figures, output)
    with progress(printed.silent) as tell:
        found = analyse_noise(recording, output=output, progress=tell, **file.given(), **asdict(analysis))
    files = [*found.files, *draw_figures(figures, found.page, found.files)]
    if files:
        results_stand()
    if printed.as_json:
        say_json(found.document, indent=1)
        return
    from tumble.report.noise import curve_lines, noise_lines, triad_lines

    noise, long = found.noise, not printed.quiet
    if long:
        say(*(f"• {sentence}" for sentence in noise.sentences), "")
    say(*noise_lines(noise.channels, seen_only=printed.quiet))
    if long:
        say(*triad_lines(noise.channels), "\nAllan deviation:")
        say(*curve_lines(noise.channels), f"\n{_LETTERS}")
    say_written(files)
