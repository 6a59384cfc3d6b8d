"""Noise coefficients in the units that people use, and what each of them is, in words."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tumble.noise.triads import triad_terms
from tumble.noise.units import ACCELEROMETER, GYRO, practical_noise_unit, si_noise_unit
from tumble.records import dataclass
from tumble.report.rounding import decimals_of, fixed
from tumble.report.terminal import aligned

if TYPE_CHECKING:
    from tumble.arrays import Series
    from tumble.noise.channel import Channel
    from tumble.noise.lines import FoundLine
    from tumble.noise.white_part import WhitePart

NAMES = {
    "Q": "quantisation",
    "N": "random walk",
    "B": "bias instability",
    "K": "rate random walk",
    "R": "ramp",
    "sigma": "Gauss-Markov, standard deviation",
    "correlation time": "Gauss-Markov, correlation time",
}
DEFINITIONS = {
    "Q": "quantisation: Allan variance 3 Q²/τ²; white noise of the integrated signal.",
    "N": (
        "angle or velocity random walk: Allan variance N²/τ, two-sided density N². A sample scatters by N √rate; a "
        "noise density that a data sheet states one-sided is √2 N."
    ),
    "B": (
        "bias instability: Allan variance (2 ln 2/π) B², two-sided density B²/(2πf). The curve's floor is 0.664 B; "
        "some programs give the floor itself."
    ),
    "K": "rate random walk: Allan variance K² τ/3; the bias is the integral of white noise of two-sided density K².",
    "R": "ramp: Allan variance R² τ²/2; a steady drift of the bias.",
    "random walk": (
        "N as a filter takes it: √(N² + Σ 2 σ² T) over the Gauss-Markov processes of up to 0.1 s (or "
        "four samples). Over longer times they are white noise. Where they do not make the curve's "
        "shape, it is N of the curve beyond them."
    ),
    "line": "sine in the signal, a vibration or the mains: its peak amplitude and its frequency.",
    "sigma": "first-order Gauss-Markov process: autocovariance σ² exp(-|t|/T); tried where the letters do not fit.",
    "correlation time": "T of the same process.",
}
FORMULA = "σ²(τ) = 3 Q²/τ² + N²/τ + (2 ln 2/π) B² + K² τ/3 + R² τ²/2"
_COUNTS = {"Q": "counts·s", "N": "counts/√Hz", "B": "counts", "K": "counts/√s", "R": "counts/s"}
CURVE = "overlapping Allan deviation: root of half the mean square of the difference of neighbouring means"
"""What the curve is."""

# Where they are not seen, it is said how large they may be.
_ASKED_FOR = "NBK"
_MOST_LINES = 5  # of a channel that are printed; the document has all


@dataclass(frozen=True, slots=True)
class NoiseRow:
    """One coefficient of one channel for people.

    Attributes
    ----------
    channel, letter, name : such as gx, N, random walk.
    practical : value with its uncertainty and unit, as people use it; "< ..." where it is not seen.
    si : the value in SI, or in counts.
    seen : whether the curve shows it.
    """

    channel: str
    letter: str
    name: str
    practical: str
    si: str
    seen: bool


def _letter_of(name: str) -> str:
    """Return the letter whose unit a term's value has; nothing for a time or a frequency."""
    if name in _COUNTS:
        return name
    return "" if name.startswith(("correlation time", "frequency")) else "B"


def definition_of(name: str) -> str:
    """Return what a term is, in words.

    Parameters
    ----------
    name : of a term.
    """
    return next(
        (text for key, text in DEFINITIONS.items() if name == key or name.startswith(f"{key} ")), name
    )


def si_unit(channel: Channel, name: str) -> str:
    """Return the name of the unit that a coefficient's value has.

    Parameters
    ----------
    channel : determines the kind of sensor, and whether it is in counts.
    name : of the term.
    """
    letter = _letter_of(name)
    if not letter:
        return "Hz" if name.startswith("frequency") else "s"
    if channel.unit == "counts":
        return _COUNTS[letter]
    return si_noise_unit(GYRO if channel.is_gyro else ACCELEROMETER, letter).sign


def practical_unit(channel: Channel, name: str) -> tuple[float, str]:
    """Return the factor to the unit that people use for a coefficient, and its name.

    Parameters
    ----------
    channel : determines the kind of sensor, and whether it is in counts.
    name : of the term.
    """
    letter = _letter_of(name)
    if channel.unit == "counts" or not letter:
        return 1.0, si_unit(channel, name)
    unit = practical_noise_unit(GYRO if channel.is_gyro else ACCELEROMETER, letter)
    return 1.0 / unit.factor, unit.sign


def triad_lines(channels: tuple[Channel, ...]) -> list[str]:
    """Return one line for each triad of three axes: each coefficient as the mean of variances, and the worst axis.

    Parameters
    ----------
    channels : in order.
    """
    lines: list[str] = []
    for start, title in (("a", "accelerometers"), ("g", "gyros")):
        axes = [channel for channel in channels if channel.name.startswith(start)]
        parts: list[str] = []
        for term in triad_terms(axes) if len(axes) > 1 else ():
            factor, unit = practical_unit(axes[0], term.letter)
            mean = _rounded(factor * term.mean, factor * term.mean_sigma)
            worst = _rounded(factor * term.worst, factor * term.worst_sigma)
            parts.append(f"{term.letter} {mean} {unit} (worst axis {term.worst_axis}: {worst})")
        if parts:
            lines.append(f"{title}, mean of variances: {'; '.join(parts)}")
    return lines


def curve_lines(channels: tuple[Channel, ...]) -> list[str]:
    """Return the curves, two averaging times a decade down, channels across, and how well they are known.

    Parameters
    ----------
    channels : with their curves at the same averaging times.
    """
    curve = channels[0].curve
    chosen = _thinned(curve.tau)
    units = [practical_unit(c, "B") for c in channels]
    heads = ["τ, s", *(f"{c.name}, {unit}" for c, (_, unit) in zip(channels, units, strict=True))]
    rows = [[*heads, f"{100.0 * curve.confidence:.0f} % interval"]]
    for k in chosen:
        cells = [
            f"{factor * float(c.curve.deviation[k, 0]):.4g}"
            for c, (factor, _) in zip(channels, units, strict=True)
        ]
        low, high = (
            max(abs(float(side[k, 0] / c.curve.deviation[k, 0]) - 1.0) for c, side in sides)
            for sides in ([(c, c.curve.low) for c in channels], [(c, c.curve.high) for c in channels])
        )
        known = (
            f"−{100.0 * low:.2g} % +{100.0 * high:.2g} %"
            if high < 1.0
            else f"−{100.0 * low:.2g} % × {1.0 + high:.2g}"
        )
        rows.append([f"{curve.tau[k]:.4g}", *cells, known])
    return aligned(rows)


def _thinned(tau: Series) -> list[int]:
    """Indices of averaging times at least a factor of three apart."""
    found: list[int] = []
    for k, each in enumerate(tau):
        if not found or each >= 3.0 * tau[found[-1]]:
            found.append(k)
    return found


def noise_rows(channel: Channel) -> list[NoiseRow]:
    """Return the coefficients of a channel: what is seen, and upper limits of N, B and K that are not.

    Parameters
    ----------
    channel : with its terms.
    """
    rows: list[NoiseRow] = []
    others = {term.letter: term.letter for term in channel.terms if term.letter not in NAMES}
    part = channel.white
    if part is not None:
        rows.append(_whole_row(channel, part))
    for letter, name in {**NAMES, **others}.items():
        factor, unit = practical_unit(channel, letter)
        term, label = channel.term(letter), _label(channel, letter, name)
        key = letter
        if letter == "N" and part is not None:
            key, label = "N alone", "of it white from sample to sample"
        if term is not None:
            text = f"{_rounded(factor * term.value, factor * term.sigma)} {unit}"
            si = f"{_rounded(term.value, term.sigma)} {si_unit(channel, letter)}"
            rows.append(NoiseRow(channel.name, key, label, text, si, True))
        elif letter in channel.unseen and letter in _ASKED_FOR:
            limit = channel.unseen[letter]
            text = f"not seen, < {_upwards(factor * limit)} {unit}"
            si = f"< {_upwards(limit)} {si_unit(channel, letter)}"
            rows.append(NoiseRow(channel.name, key, label, text, si, False))
    rows += [_line_row(channel, line) for line in channel.lines[:_MOST_LINES]]
    return rows


def _whole_row(channel: Channel, part: WhitePart) -> NoiseRow:
    """N with what is white but for the shortest times."""
    factor, unit = practical_unit(channel, "N")
    text = f"{_rounded(factor * part.value, factor * part.sigma)} {unit}"
    si = f"{_rounded(part.value, part.sigma)} {si_unit(channel, 'N')}"
    return NoiseRow(channel.name, "N", _label(channel, "N", ""), text, si, True)


def _line_row(channel: Channel, line: FoundLine) -> NoiseRow:
    factor, unit = practical_unit(channel, "B")
    name = f"line at {_rounded(line.frequency, line.frequency_sigma)} Hz, amplitude"
    text = f"{_rounded(factor * line.amplitude, factor * line.amplitude_sigma)} {unit}"
    si = f"{_rounded(line.amplitude, line.amplitude_sigma)} {si_unit(channel, 'B')}"
    return NoiseRow(channel.name, "line", name, text, si, True)


def noise_lines(channels: tuple[Channel, ...], *, seen_only: bool = False) -> list[str]:
    """Return the coefficients of all channels as lines of plain text with aligned columns.

    Parameters
    ----------
    channels : in order.
    seen_only : whether to leave out upper limits.
    """
    cells = [["", "term", "", "± standard uncertainty", "in SI"]]
    for channel in channels:
        rows = [row for row in noise_rows(channel) if row.seen or not seen_only]
        for k, row in enumerate(rows):
            letter = row.letter if len(row.letter) == 1 else ""
            cells.append([row.channel if k == 0 else "", row.name, letter, row.practical, row.si])
    return aligned(cells)


def _label(channel: Channel, letter: str, name: str) -> str:
    if letter != "N":
        return name
    return "angle random walk" if channel.is_gyro else "velocity random walk"


def _upwards(limit: float) -> str:
    """A limit with two digits, rounded up, without a power of ten where that reads better."""
    if not (math.isfinite(limit) and limit > 0.0):
        return f"{limit:g}"
    unit = 10.0 ** (math.floor(math.log10(limit)) - 1)
    # A last digit that is only rounding is none.
    up = unit * math.ceil(limit / unit * (1.0 - 1e-9))
    return f"{float(f'{up:.2g}'):g}"


def _rounded(value: float, spread: float) -> str:
    """Value and uncertainty to two digits of the uncertainty, with a power of ten where that reads better."""
    if not (math.isfinite(spread) and spread > 0.0 and value != 0.0):
        return f"{value:.3g}"
    if 1e-2 <= abs(value) < 1e5:
        decimals = decimals_of(spread)
        return f"{fixed(value, decimals)} ± {fixed(spread, decimals)}"
    power = math.floor(math.log10(abs(value)))
    decimals = decimals_of(spread * 10.0**-power)
    return f"({fixed(value * 10.0**-power, decimals)} ± {fixed(spread * 10.0**-power, decimals)})e{power}"
