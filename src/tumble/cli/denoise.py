"""`tumble denoise`: a recording with less noise, and a statement of what that was worth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tumble.cli.groups import ADVANCED, FIRST, detail, option
from tumble.cli.options import FileOptions, PrintOptions, Recordings, output_option
from tumble.cli.terminal import progress, results_stand, say, say_json, say_written
from tumble.errors import UsageError
from tumble.records import dataclass

if TYPE_CHECKING:
    from tumble.noise.denoising.shrinkage import Shrinkage
    from tumble.workflows.denoise import ChannelOutcome, Denoised


@dataclass(frozen=True)
class WaveletOptions:
    """Thresholds of wavelet coefficients."""

    threshold: Annotated[
        str | None,
        detail(ADVANCED, "RULE", "sure (default), universal, or remove: all details go, a linear filter."),
    ] = None
    shape: Annotated[
        str | None, detail(ADVANCED, "SHAPE", "soft (default), or hard with --threshold universal.")
    ] = None
    wavelet: Annotated[str | None, detail(ADVANCED, "NAME", "haar, dbN, symN or coifN (default: sym4).")] = (
        None
    )
    stationary: Annotated[
        bool,
        detail(
            ADVANCED,
            "",
            "All shifts averaged (default), against ripples at edges; takes more memory.",
            "--stationary/--no-stationary",
        ),
    ] = True


@dataclass(frozen=True)
class FilterOptions:
    """Which filter, and on what."""

    method: Annotated[
        str,
        option(
            FIRST,
            "METHOD",
            "wavelet: thresholds at each scale; ar: autoregression and level filter, at rest only.",
            show_default=True,
        ),
    ] = "wavelet"
    motion: Annotated[
        str,
        option(
            FIRST,
            "WHAT",
            "keep: samples in motion stay exactly as they are; filter: they are de-noised too.",
            show_default=True,
        ),
    ] = "keep"
    level: Annotated[
        int | None,
        detail(ADVANCED, "N", "Levels of decomposition; by default each channel's Allan minimum decides."),
    ] = None
    order: Annotated[
        int | None, detail(ADVANCED, "P", "Order of the autoregression (default: chosen by BIC).")
    ] = None


def denoise_command(
    recordings: Recordings,
    file: FileOptions,
    chosen: FilterOptions,
    wavelets: WaveletOptions,
    printed: PrintOptions,
    output: Annotated[
        Path | None,
        output_option(
            "The file to write, .csv or .parquet (default: NAME-denoised.csv). Never an existing one.", "FILE"
        ),
    ] = None,
) -> None:
    """De-noise a recording by wavelets or an autoregressive model, and say what was gained and lost.

    Not for calibration: means of holds do not change. A filter does not know motion from noise.
    """
    from tumble.workflows.denoise import WARNING, denoise

    if chosen.motion not in ("keep", "filter"):
        raise UsageError(f"--motion {chosen.motion}: give keep or filter.")
    with progress(printed.silent) as tell:
        done = denoise(
            recordings,
            output=output,
            method=chosen.method,
            level=chosen.level,
            order=chosen.order,
            shrinkage=_shrinkage(wavelets),
            filter_motion=chosen.motion == "filter",
            progress=tell,
            **file.given(),
        )
    results_stand()
    if printed.as_json:
        say_json(done.document, indent=1)
        return
    if not printed.quiet:
        say(*(f"• {remark}" for remark in done.remarks), "", *_lines(done), "")
    say(f"Warning: {WARNING}")
    say_written(done.files)


def _shrinkage(asked: WaveletOptions) -> Shrinkage | None:
    """The thresholds that were asked for, None if none were."""
    if asked == WaveletOptions():
        return None
    from tumble.noise.denoising.shrinkage import Shrinkage
    from tumble.noise.denoising.wavelets import USUAL

    rule = asked.threshold or ("universal" if asked.shape == "hard" else "sure")
    shape = asked.shape or "soft"
    return Shrinkage(rule, shape, asked.wavelet or USUAL, asked.stationary)  # type: ignore[arg-type]


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
