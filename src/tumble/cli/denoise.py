"""`tumble denoise`: a recording with less noise, and a statement of what that was worth."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tumble.cli.options import Columns, Json, Quiet, Rate, Recordings, Topics, Units
from tumble.cli.progress import progress, results_stand

if TYPE_CHECKING:
    from tumble.workflows.denoise import ChannelOutcome, Denoised


def denoise_command(
    recordings: Recordings,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="The file to write, .csv or .parquet (default: NAME-denoised.csv). Never an existing one.",
        ),
    ] = None,
    method: Annotated[
        str,
        typer.Option(
            help="wavelet: thresholds at each scale; ar: autoregression and level filter, at rest only."
        ),
    ] = "wavelet",
    level: Annotated[
        int | None,
        typer.Option(
            help="Levels of decomposition; by default each channel's Allan minimum decides.",
            show_default=False,
        ),
    ] = None,
    threshold: Annotated[
        str | None,
        typer.Option(
            help="sure (default), universal, or remove: all details go, a linear filter.", show_default=False
        ),
    ] = None,
    shape: Annotated[
        str | None,
        typer.Option(help="soft (default), or hard with --threshold universal.", show_default=False),
    ] = None,
    wavelet: Annotated[
        str | None, typer.Option(help="haar, dbN, symN or coifN (default: sym4).", show_default=False)
    ] = None,
    stationary: Annotated[
        bool, typer.Option(help="All shifts averaged, against ripples at edges; takes more memory.")
    ] = True,
    motion: Annotated[
        str,
        typer.Option(
            help="keep: samples in motion stay exactly as they are; filter: they are de-noised too."
        ),
    ] = "keep",
    order: Annotated[
        int | None,
        typer.Option(help="Order of the autoregression (default: chosen by BIC).", show_default=False),
    ] = None,
    units: Units = None,
    columns: Columns = None,
    rate: Rate = None,
    topic: Topics = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """De-noise a recording by wavelets or an autoregressive model, and say what was gained and lost.

    Not for calibration: means of holds do not change. A filter does not know motion from noise.
    """
    from tumble.errors import UsageError
    from tumble.workflows.denoise import WARNING, denoise

    if motion not in ("keep", "filter"):
        raise UsageError(f"--motion {motion}: give keep or filter.")
    with progress(quiet or as_json) as say:
        done = denoise(
            recordings,
            output=output,
            method=method,
            level=level,
            order=order,
            shrinkage=_shrinkage(threshold, shape, wavelet, stationary),
            filter_motion=motion == "filter",
            columns=columns,
            units=units,
            rate=rate,
            topics=topic,
            progress=say,
        )
    results_stand()
    if as_json:
        typer.echo(json.dumps(done.document, indent=1, ensure_ascii=False))
        return
    if not quiet:
        for remark in done.remarks:
            typer.echo(f"• {remark}")
        typer.echo("")
        for line in _lines(done):
            typer.echo(line)
        typer.echo("")
    typer.echo(f"Warning: {WARNING}")
    for file in done.files:
        typer.echo(f"written: {file.resolve()}")


def _shrinkage(threshold: str | None, shape: str | None, wavelet: str | None, stationary: bool):
    """The thresholds that were asked for, None if none were."""
    if threshold is None and shape is None and wavelet is None and stationary:
        return None
    from tumble.noise.denoising import Shrinkage
    from tumble.noise.wavelets import USUAL

    rule = threshold or ("universal" if shape == "hard" else "sure")
    return Shrinkage(rule, shape or "soft", wavelet or USUAL, stationary)  # type: ignore[arg-type]


def _lines(done: Denoised) -> list[str]:
    """The tables: scatter, bandwidth and delay; Allan deviations at a few averaging times."""
    head = f"{'':3} {'scatter at rest before':>26} {'after':>26}  {'bandwidth':>10} {'delay':>9}"
    rows = [head]
    for each in done.channels:
        band = "all" if each.bandwidth is None else f"{each.bandwidth:.3g} Hz"
        rows.append(
            f"{each.name:3} {_with(each.before, each.before_sigma):>26} {_with(each.after, each.after_sigma):>26}  "
            f"{band:>10} {each.delay:>7.3g} s  {each.unit or 'counts'}"
        )
    rows += [
        "",
        "What was done, and the peaks of sines that are lost (at the band's edge … in the fastest octave):",
    ]
    rows += [f"{each.name:3} {each.done}{_lost(each)}" for each in done.channels]
    rows += ["", "Allan deviation at rest, after over before:"]
    curve = max(done.channels, key=lambda each: each.tau.size)
    chosen = range(0, curve.tau.size, max(1, -(-curve.tau.size // 8)))
    rows.append(f"{'':3} " + " ".join(f"{curve.tau[k]:>7.3g} s" for k in chosen))
    for each in done.channels:
        ratios = [
            f"{each.allan_after[k] / each.allan_before[k]:>9.3g}"
            if k < each.tau.size and each.allan_before[k] > 0.0
            else f"{'–':>9}"
            for k in chosen
        ]
        rows.append(f"{each.name:3} " + " ".join(ratios))
    return rows


def _with(value: float, sigma: float) -> str:
    return f"{value:.4g} ± {sigma:.1g}"


def _lost(each: ChannelOutcome) -> str:
    low, high = each.smaller_than
    if each.bandwidth is None:
        return ""
    if low == float("inf"):
        return f": all above {each.bandwidth:.3g} Hz, of any size"
    return f": {low:.2g} … {high:.2g} {each.unit or 'counts'}"
