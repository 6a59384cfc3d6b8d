"""The noise of a recording: curves, spectra, levels, numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.report.figures.record import AXIS_COLOURS, Axis, Band, Curve, Figure, Look, Mark, Points, plain
from tumble.report.noise_words import (
    DEFINITIONS,
    FORMULA,
    NoiseRow,
    noise_rows,
    practical_unit,
    triad_lines,
)
from tumble.report.page import Block, Figures, Page, Sentences, Table, section

if TYPE_CHECKING:
    from tumble.arrays import Series
    from tumble.noise.characterisation import Channel, Characterisation

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
            look = [*(["first"] if k == 0 else []), *([] if row.seen else ["unseen"])]
            looks[len(cells)] = " ".join(look)
            cells.append([channel.name if k == 0 else "", _term(row), row.practical, row.si])
    return Table(("", "term", "± standard uncertainty", "SI"), cells, looks)


def _term(row: NoiseRow) -> str:
    return f"{row.name} ({row.letter})" if len(row.letter) == 1 else row.name


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
        curve, colour = channel.curve, AXIS_COLOURS[channel.name[1]]
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
    across = _log_axis("averaging time τ, s", channels[0].curve.tau)
    return Figure(name, label, marks, across, _log_axis(f"Allan deviation, {unit}", shown), 430)


def _spectrum(
    noise: Characterisation, letter: str, channels: list[Channel], factor: float, unit: str
) -> Figure:
    spectrum = noise.spectra[letter]
    root = factor * np.sqrt(spectrum.density)
    marks: list[Mark] = [
        Curve(spectrum.frequency, root[:, k], c.name, AXIS_COLOURS[c.name[1]], hover=_HOVER, width=1.5)
        for k, c in enumerate(channels)
    ]
    marks += [_lines(c, spectrum.frequency, root[:, k]) for k, c in enumerate(channels) if c.lines]
    across = _log_axis("frequency, Hz", spectrum.frequency)
    upright = _log_axis(f"root of the density, {unit}/√Hz", root)
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
        AXIS_COLOURS[channel.name[1]],
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
        y, colour = factor * (level - np.nanmean(level)), AXIS_COLOURS[channel.name[1]]
        marks.append(Curve(plain(elapsed / scale, 7), y, channel.name, colour, hover=_HOVER, width=1))
    label = f"Level over time, {_TRIADS[letter][1]}s"
    return Figure(f"level-{letter}", label, marks, Axis(f"time, {word}"), Axis(f"level, {unit}"), 280)


def _log_axis(title: str, values: Any) -> Axis:
    """A logarithmic axis, marked at each power of ten, or at 1, 2 and 5 where there are few of them."""
    known = np.asarray(values, dtype=float)
    known = known[np.isfinite(known) & (known > 0.0)]
    span = float(known.max() / known.min()) if known.size else 1.0
    return Axis(title, "log", every=1 if span >= _WIDE else "D2" if span > _NARROW else "D1")
