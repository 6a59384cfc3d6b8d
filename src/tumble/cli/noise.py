"""`tumble noise`: what a sensor at rest shows, by Allan deviation and spectrum."""

from __future__ import annotations

from dataclasses import replace

from tumble.cli.options import FiguresOption, PrintOptions, check_figures, draw_figures
from tumble.cli.terminal import progress, results_stand, say, say_json, say_written
from tumble.workflows import NoiseRequest

_LETTERS = (
    "Letters as in IEEE Std 952. B: flicker of two-sided density B²/(2πf); the curve's floor is 0.664 B. "
    "N: two-sided; a one-sided noise density is √2 N."
)


def noise_command(asked: NoiseRequest, printed: PrintOptions, figures: FiguresOption = None) -> None:
    """Noise of a unit at rest: white noise, bias instability and random walks of every channel.

    tumble noise still.csv -o noise

    Record the unit lying still, warm, for hours. What is not rest (motion, steps, gaps, dead channels) is
    said and left out.
    """
    from tumble.workflows import analyse_noise

    check_figures(figures, asked.output)
    with progress(printed.silent) as tell:
        found = analyse_noise(**vars(replace(asked, progress=tell)))
    files = [*found.files, *draw_figures(figures, found.page, found.files)]
    if files:
        results_stand()
    if printed.as_json:
        say_json(found.document, indent=1)
        return
    from tumble.report import curve_lines, noise_lines, triad_lines

    noise, long = found.noise, not printed.quiet
    if long:
        say(*(f"• {sentence}" for sentence in noise.sentences), "")
    say(*noise_lines(noise.channels, seen_only=printed.quiet))
    if long:
        say(*triad_lines(noise.channels), "\nAllan deviation:")
        say(*curve_lines(noise.channels), f"\n{_LETTERS}")
    say_written(files)
