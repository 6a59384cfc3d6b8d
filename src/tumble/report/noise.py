"""The noise of a recording on a page and a terminal: curves, spectra, levels, numbers, and what each of them is."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tumble.arrays import Series
from tumble.noise import (
    ACCELEROMETER,
    GYRO,
    Channel,
    Characterisation,
    practical_noise_unit,
    si_noise_unit,
    triad_terms,
)
from tumble.parameters import with_uncertainty
from tumble.records import dataclass
from tumble.report.figures import record
from tumble.report.figures.record import Axis, Band, Curve, Figure, Look, Mark, Points, plain
from tumble.report.page import Block, Figures, Page, Sentences, Table, aligned, section

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
_SLOPES = "dashed: the fitted terms together. Slope −1/2: random walk (N); flat: B; +1/2: K."
_TRIADS = {"g": ("Gyros", "gyro"), "a": ("Accelerometers", "accelerometer")}
_WIDE = 150.0  # range that has powers of ten enough for an axis
_NARROW = 8.0
_HOVER = "%{x:.3g}: %{y:.3g}"


def noise_page(noise: Characterisation, command: str) -> Page:
    """Return what is said of a recording's noise.

    Parameters
    ----------
    noise : what was found.
    command : how to make it again.
    """
    names = ", ".join(source.name for source in noise.sources) or "a recording"
    facts = (
        f"{noise.suitability.samples} samples at {noise.rate:.6g} Hz at rest, "
        f"{_duration(noise.suitability.samples / noise.rate)}, of {_duration(noise.duration)} recorded."
    )
    triads = [f"{line[0].upper()}{line[1:]}." for line in triad_lines(noise.channels)]
    letters = [f"`{letter}` {words}" for letter, words in DEFINITIONS.items()]
    again = f"Coefficients and letters as in IEEE Std 952. Again: `{command}`"
    blocks: list[Block] = [Sentences([facts], "paragraphs")]
    if noise.suitability.remarks:
        blocks.append(Sentences(noise.suitability.remarks))
    blocks += _figures(noise)
    blocks += section("What was found", Sentences(noise.remarks))
    blocks += section("Numbers", _table(noise.channels), Sentences(triads, "paragraphs"))
    blocks += section("What the letters are", Sentences([FORMULA], "paragraphs"), Sentences(letters))
    return Page(f"Noise of {names}", [*blocks, Sentences([again], "paragraphs")])


def _duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.3g} s"
    return f"{seconds / 60.0:.3g} min" if seconds < 7200.0 else f"{seconds / 3600.0:.3g} h"


def _table(channels: tuple[Channel, ...]) -> Table:
    cells: list[list[str]] = []
    looks: dict[int, str] = {}
    for channel in channels:
        for k, row in enumerate(noise_rows(channel)):
            looks[len(cells)] = f"{'' if k else 'first'} {'' if row.seen else 'unseen'}".strip()
            term = f"{row.name} ({row.letter})" if len(row.letter) == 1 else row.name
            cells.append(["" if k else channel.name, term, row.practical, row.si])
    return Table(("", "term", "± standard uncertainty", "SI"), cells, looks)


def _figures(noise: Characterisation) -> list[Block]:
    blocks: list[Block] = []
    for letter, (title, word) in _TRIADS.items():
        channels = [channel for channel in noise.channels if channel.name.startswith(letter)]
        if not channels:
            continue
        factor, unit = practical_unit(channels[0], "B")
        curves = _curves(f"allan-{letter}", f"Allan deviation of the {word}s", channels, factor, unit)
        band = f"Band: {100.0 * channels[0].curve.confidence:.0f} % interval"
        spectrum = _spectrum(noise, letter, channels, factor, unit)
        levels = _levels(noise, letter, channels, factor, unit)
        lines = "Triangles: lines, of a motor say; flat: √2 N."
        trend = "A trend at the start is warm-up, a step a restart."
        blocks += [
            Figures([curves], f"{title}: Allan deviation. {band}; {_SLOPES}"),
            Figures([spectrum], f"{title}: root of the spectral density, one-sided. {lines}"),
            Figures([levels], f"{title}: level over time, less its mean. {trend}"),
        ]
    return blocks


def _curves(name: str, label: str, channels: list[Channel], factor: float, unit: str) -> Figure:
    marks: list[Mark] = []
    for channel in channels:
        curve, colour = channel.curve, record.AXIS_COLOURS[channel.name[1]]
        deviation, group = curve.deviation[:, 0], channel.name
        # An upper limit at infinity has no place in a drawing.
        known = np.isfinite(curve.high[:, 0]) & (deviation > 0.0)
        high = np.where(known, np.minimum(curve.high[:, 0], 5.0 * deviation), np.nan)
        low = np.where(known, np.maximum(curve.low[:, 0], 0.2 * deviation), np.nan)
        look: Look = {"hover": _HOVER, "symbol": "circle", "size": 4}
        marks += [
            Band(curve.tau, (factor * low, factor * high), group, colour, legend=False, group=group),
            Curve(curve.tau, factor * deviation, group, colour, group=group, **look),
        ]
        if channel.terms:
            fitted = factor * channel.fitted(curve.tau)
            look = {"legend": False, "group": group, "hover": "", "width": 1, "dash": "dash"}
            marks.append(Curve(curve.tau, fitted, f"{group} fitted", colour, **look))
    shown = np.concatenate([factor * channel.curve.deviation[:, 0] for channel in channels])
    across = _log_axis("averaging time τ / s", channels[0].curve.tau)
    return Figure(
        name, label, marks, across, _log_axis(f"Allan deviation / {record.in_brackets(unit)}", shown), 430
    )


def _spectrum(
    noise: Characterisation, letter: str, channels: list[Channel], factor: float, unit: str
) -> Figure:
    spectrum = noise.spectra[letter]
    root = factor * np.sqrt(spectrum.density)
    marks: list[Mark] = [
        Curve(spectrum.frequency, root[:, k], c.name, record.AXIS_COLOURS[c.name[1]], hover=_HOVER, width=1.5)
        for k, c in enumerate(channels)
    ]
    marks += [_lines(c, spectrum.frequency, root[:, k]) for k, c in enumerate(channels) if c.lines]
    across = _log_axis("frequency / Hz", spectrum.frequency)
    upright = _log_axis(f"root of the density / ({unit}/√Hz)", root)
    return Figure(
        f"spectrum-{letter}", f"Spectral density, {_TRIADS[letter][1]}s", marks, across, upright, 340
    )


def _lines(channel: Channel, frequency: Series, root: Series) -> Points:
    """The lines that were found, each over its place in the spectrum."""
    factor, unit = practical_unit(channel, "B")
    at = np.array([line.frequency for line in channel.lines])
    return Points(
        at,
        1.15 * np.interp(at, frequency, root),
        f"{channel.name}, line",
        record.AXIS_COLOURS[channel.name[1]],
        hover=_HOVER,
        words=[f"{x.frequency:.5g} Hz, amplitude {factor * x.amplitude:.3g} {unit}" for x in channel.lines],
        symbol="triangle-down",
        size=9,
    )


def _levels(
    noise: Characterisation, letter: str, channels: list[Channel], factor: float, unit: str
) -> Figure:
    index = {channel.name: k for k, channel in enumerate(noise.channels)}
    # From the first instant on: stamps that count from 1970 leave no digits for the seconds.
    elapsed = noise.level_time - noise.level_time[0]
    scale, word = (3600.0, "h") if elapsed[-1] > 7200.0 else (1.0, "s")
    marks: list[Mark] = []
    for channel in channels:
        level = noise.levels[:, index[channel.name]]
        y, colour = factor * (level - np.nanmean(level)), record.AXIS_COLOURS[channel.name[1]]
        marks.append(Curve(plain(elapsed / scale, 7), y, channel.name, colour, hover=_HOVER, width=1))
    label = f"Level over time, {_TRIADS[letter][1]}s"
    return Figure(
        f"level-{letter}",
        label,
        marks,
        Axis(f"time / {word}"),
        Axis(f"level / {record.in_brackets(unit)}"),
        280,
    )


def _log_axis(title: str, values: Any) -> Axis:
    """A logarithmic axis, marked at each power of ten, or at 1, 2 and 5 where there are few of them."""
    known = np.asarray(values, dtype=float)
    known = known[np.isfinite(known) & (known > 0.0)]
    span = float(known.max() / known.min()) if known.size else 1.0
    return Axis(title, "log", every=1 if span >= _WIDE else "D2" if span > _NARROW else "D1")


@dataclass(frozen=True)
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
            mean = with_uncertainty(factor * term.mean, factor * term.mean_sigma)
            worst = with_uncertainty(factor * term.worst, factor * term.worst_sigma)
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
    units = [practical_unit(c, "B") for c in channels]
    heads = ["τ, s", *(f"{c.name}, {unit}" for c, (_, unit) in zip(channels, units, strict=True))]
    rows = [[*heads, f"{100.0 * curve.confidence:.0f} % interval"]]
    low, high, deviation = (
        np.column_stack([getattr(c.curve, side)[:, 0] for c in channels])
        for side in ("low", "high", "deviation")
    )
    below, above = (np.max(np.abs(side / deviation - 1.0), axis=1) for side in (low, high))
    shown = deviation * [factor for factor, _ in units]
    for k in _thinned(curve.tau):
        up = f"+{100.0 * above[k]:.2g} %" if above[k] < 1.0 else f"× {1.0 + above[k]:.2g}"
        cells = [f"{size:.4g}" for size in shown[k]]
        rows.append([f"{curve.tau[k]:.4g}", *cells, f"−{100.0 * below[k]:.2g} % {up}"])
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
        rows.append(_row(channel, "N", "N", _label(channel, "N", ""), part.value, part.sigma))
    for letter, name in {**NAMES, **others}.items():
        factor, unit = practical_unit(channel, letter)
        term, label = channel.term(letter), _label(channel, letter, name)
        key = letter
        if letter == "N" and part is not None:
            key, label = "N alone", "of it white from sample to sample"
        if term is not None:
            rows.append(_row(channel, letter, key, label, term.value, term.sigma))
        elif letter in channel.unseen and letter in _ASKED_FOR:
            limit = channel.unseen[letter]
            text = f"not seen, < {_upwards(factor * limit)} {unit}"
            si = f"< {_upwards(limit)} {si_unit(channel, letter)}"
            rows.append(NoiseRow(channel.name, key, label, text, si, False))
    for line in channel.lines[:_MOST_LINES]:
        name = f"line at {with_uncertainty(line.frequency, line.frequency_sigma)} Hz, amplitude"
        rows.append(_row(channel, "B", "line", name, line.amplitude, line.amplitude_sigma))
    return rows


def _row(channel: Channel, letter: str, key: str, name: str, value: float, sigma: float) -> NoiseRow:
    """A coefficient that is seen, in the units of a letter."""
    factor, unit = practical_unit(channel, letter)
    text = f"{with_uncertainty(factor * value, factor * sigma)} {unit}"
    si = f"{with_uncertainty(value, sigma)} {si_unit(channel, letter)}"
    return NoiseRow(channel.name, key, name, text, si, True)


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
