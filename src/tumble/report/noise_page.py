"""The noise of a recording as one HTML page that works offline: curves, spectra, levels, numbers."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.report.figure import AXIS_COLOURS, GREY, Figure, Plot, base_layout, plain, text_axis
from tumble.report.noise_words import (
    DEFINITIONS,
    FORMULA,
    KINDS,
    NoiseRow,
    noise_rows,
    practical_unit,
    triad_lines,
)

if TYPE_CHECKING:
    from tumble.arrays import Series
    from tumble.noise.characterisation import Channel, Characterisation

_STYLE = """
main { max-width: 1100px; }
table.noise td, table.noise th { padding-right: 1.2rem; text-align: left; }
table.noise tr.first td { border-top: 1px solid var(--line, #ccc); }
table.noise td.unseen { color: var(--soft); }
"""
_DASHED = "dashed: the fitted terms together. "
_SLOPES = {
    "overlapping": f"{_DASHED}Slope −1/2: random walk (N); flat: B; +1/2: K.",
    "haar": f"{_DASHED}Slope −1/2: random walk (N); flat: B; +1/2: K. It is the Allan deviation over √2.",
    "modified": "slope −1/2: random walk (N), −3/2: quantisation (Q); flat: B; +1/2: K.",
    "hadamard": "slope −1/2: random walk (N); flat: B; +1/2: K; a ramp is not in it.",
}
_TRIADS = {"g": ("Gyros", "gyro"), "a": ("Accelerometers", "accelerometer")}


def render_noise(noise: Characterisation, command: str) -> str:
    """Return the page.

    Parameters
    ----------
    noise : what was found.
    command : how to make it again.
    """
    from tumble.report.html import standalone_page

    figures = _figures(noise)
    names = ", ".join(source.name for source in noise.sources) or "a recording"
    title = f"Noise of {names}"
    seconds = noise.suitability.samples / noise.rate
    facts = (
        f"{noise.suitability.samples} samples at {noise.rate:.6g} Hz at rest, {_duration(seconds)}, of "
        f"{_duration(noise.duration)} recorded."
    )
    body = (
        f"<style>{_STYLE}</style><h1>{html.escape(title)}</h1><p>{html.escape(facts)}</p>"
        + _listed(noise.suitability.remarks)
        + "".join(_place(figure, caption) for figure, caption in figures)
        + f"<h2>What was found</h2>{_listed(noise.remarks)}"
        + f'<h2>Numbers</h2><div class="scroll">{_table(noise.channels)}</div>'
        + "".join(
            f"<p>{html.escape(line[0].upper() + line[1:])}.</p>" for line in triad_lines(noise.channels)
        )
        + f"<h2>What the letters are</h2><p>{html.escape(FORMULA)}</p><ul>"
        + "".join(f"<li><b>{letter}</b> {html.escape(text)}</li>" for letter, text in DEFINITIONS.items())
        + f"</ul><p>Coefficients and letters as in IEEE Std 952. Again: <code>{html.escape(command)}</code></p>"
    )
    return standalone_page(title, body, [figure.as_dict() for figure, _ in figures])


def _listed(sentences: tuple[str, ...]) -> str:
    return f"<ul>{''.join(f'<li>{_marked(text)}</li>' for text in sentences)}</ul>" if sentences else ""


def _duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.3g} s"
    return f"{seconds / 60.0:.3g} min" if seconds < 7200.0 else f"{seconds / 3600.0:.3g} h"


def _table(channels: tuple[Channel, ...]) -> str:
    lines: list[str] = []
    for channel in channels:
        for k, row in enumerate(noise_rows(channel)):
            kind = "" if row.seen else ' class="unseen"'
            lines.append(
                f"<tr{' class=first' if k == 0 else ''}><td>{channel.name if k == 0 else ''}</td>"
                f"<td>{html.escape(_term(row))}</td><td{kind}>{_signs(row.practical)}</td>"
                f"<td{kind}>{_signs(row.si)}</td></tr>"
            )
    heads = "<tr><th></th><th>term</th><th>± standard uncertainty</th><th>SI</th></tr>"
    return f'<table class="noise"><thead>{heads}</thead><tbody>{"".join(lines)}</tbody></table>'


def _term(row: NoiseRow) -> str:
    return f"{row.name} ({row.letter})" if len(row.letter) == 1 else row.name


def _signs(text: str) -> str:
    return html.escape(text).replace("-", "−")


def _marked(text: str) -> str:
    """Escaped, and what stands between backticks as code."""
    parts = html.escape(text).split("`")
    return "".join(f"<code>{part}</code>" if k % 2 else part for k, part in enumerate(parts))


def _place(figure: Figure, caption: str) -> str:
    return (
        f"<figure><figcaption>{html.escape(caption)}</figcaption>"
        f'<div id="{figure.name}" role="img" aria-label="{html.escape(figure.label)}" '
        f'style="height:{figure.height}px"></div></figure>'
    )


def _figures(noise: Characterisation) -> list[tuple[Figure, str]]:
    figures: list[tuple[Figure, str]] = []
    for letter, (title, word) in _TRIADS.items():
        channels = [channel for channel in noise.channels if channel.name.startswith(letter)]
        if not channels:
            continue
        factor, unit = practical_unit(channels[0], "B")
        figures.append(
            (
                _curves(f"allan-{letter}", f"{KINDS[noise.kind]} of the {word}s", channels, factor, unit),
                f"{title}: {KINDS[noise.kind]}. Band: {100.0 * channels[0].curve.confidence:.0f} % interval; "
                + _SLOPES[noise.kind],
            )
        )
        figures.append(
            (
                _spectrum(noise, letter, channels, factor, unit),
                f"{title}: root of the spectral density, one-sided. Triangles: lines, of a motor say; flat: √2 N.",
            )
        )
        figures.append(
            (
                _levels(noise, letter, channels, factor, unit),
                f"{title}: level over time, less its mean. A trend at the start is warm-up, a step a restart.",
            )
        )
    return figures


def _curves(name: str, label: str, channels: list[Channel], factor: float, unit: str) -> Figure:
    data: list[Plot] = []
    for channel in channels:
        curve, colour = channel.curve, AXIS_COLOURS[channel.name[1]]
        x, group = plain(curve.tau), {"legendgroup": channel.name}
        # An upper limit at infinity has no place in a drawing.
        known = np.isfinite(curve.high[:, 0]) & (curve.deviation[:, 0] > 0.0)
        high = np.where(known, np.minimum(curve.high[:, 0], 5.0 * curve.deviation[:, 0]), np.nan)
        low = np.where(known, np.maximum(curve.low[:, 0], 0.2 * curve.deviation[:, 0]), np.nan)
        data.append(_line(x, factor * low, colour, channel.name, line={"width": 0}, **_HIDDEN, **group))
        fill = {"fill": "tonexty", "fillcolor": _faint(colour)}
        data.append(
            _line(x, factor * high, colour, channel.name, line={"width": 0}, **fill, **_HIDDEN, **group)
        )
        look = {"mode": "lines+markers", "marker": {"size": 4, "color": colour}}
        data.append(
            _line(
                x,
                factor * curve.deviation[:, 0],
                colour,
                channel.name,
                line={"color": colour},
                **look,
                **group,
            )
        )
        if channel.terms:
            fitted = factor * channel.fitted(curve.tau)
            dashes = {"color": colour, "dash": "dash", "width": 1}
            data.append(_line(x, fitted, colour, f"{channel.name} fitted", line=dashes, **_HIDDEN, **group))
    layout = base_layout(
        430,
        xaxis=_log_axis("averaging time τ, s", channels[0].curve.tau),
        yaxis=_log_axis(
            f"{KINDS[channels[0].curve.kind]}, {unit}",
            np.concatenate([factor * channel.curve.deviation[:, 0] for channel in channels]),
        ),
    )
    return Figure(name, label, data, layout)


def _spectrum(
    noise: Characterisation, letter: str, channels: list[Channel], factor: float, unit: str
) -> Figure:
    spectrum = noise.spectra[letter]
    data = [
        _line(
            plain(spectrum.frequency),
            factor * np.sqrt(spectrum.density[:, k]),
            AXIS_COLOURS[channel.name[1]],
            channel.name,
            line={"color": AXIS_COLOURS[channel.name[1]], "width": 1.5},
        )
        for k, channel in enumerate(channels)
    ]
    data += [
        _marks(channel, spectrum.frequency, factor * np.sqrt(spectrum.density[:, k]))
        for k, channel in enumerate(channels)
        if channel.lines
    ]
    layout = base_layout(
        340,
        xaxis=_log_axis("frequency, Hz", spectrum.frequency),
        yaxis=_log_axis(f"root of the density, {unit}/√Hz", factor * np.sqrt(spectrum.density)),
    )
    return Figure(f"spectrum-{letter}", f"Spectral density, {_TRIADS[letter][1]}s", data, layout)


def _marks(channel: Channel, frequency: Series, root: Series) -> Plot:
    """The lines that were found, each over its place in the spectrum."""
    factor, unit = practical_unit(channel, "B")
    colour = AXIS_COLOURS[channel.name[1]]
    at = np.array([line.frequency for line in channel.lines])
    return _line(
        plain(at),
        1.15 * np.interp(at, frequency, root),
        colour,
        f"{channel.name}, line",
        mode="markers",
        marker={"color": colour, "symbol": "triangle-down", "size": 9},
        text=[f"{x.frequency:.5g} Hz, amplitude {factor * x.amplitude:.3g} {unit}" for x in channel.lines],
        hovertemplate="%{text}",
    )


def _levels(
    noise: Characterisation, letter: str, channels: list[Channel], factor: float, unit: str
) -> Figure:
    index = {channel.name: k for k, channel in enumerate(noise.channels)}
    scale, word = (3600.0, "h") if noise.level_time[-1] - noise.level_time[0] > 7200.0 else (1.0, "s")
    data = [
        _line(
            plain(noise.level_time / scale, 7),
            factor * _centred(noise.levels[:, index[channel.name]]),
            AXIS_COLOURS[channel.name[1]],
            channel.name,
            line={"color": AXIS_COLOURS[channel.name[1]], "width": 1},
        )
        for channel in channels
    ]
    layout = base_layout(280, xaxis=text_axis(f"time, {word}"), yaxis=text_axis(f"level, {unit}"))
    return Figure(f"level-{letter}", f"Level over time, {_TRIADS[letter][1]}s", data, layout)


_WIDE = 150.0  # range that has powers of ten enough for an axis
_NARROW = 8.0
_HIDDEN: dict[str, Any] = {"showlegend": False, "hoverinfo": "skip"}


def _centred(level: Series) -> Series:
    return level - np.nanmean(level)


def _log_axis(title: str, values: Any) -> Plot:
    """A logarithmic axis, marked at each power of ten, or at 1, 2 and 5 where there are few of them."""
    known = np.asarray(values, dtype=float)
    known = known[np.isfinite(known) & (known > 0.0)]
    span = float(known.max() / known.min()) if known.size else 1.0
    marks: Plot = {"exponentformat": "power", "dtick": 1}
    if span < _WIDE:
        marks = {"dtick": "D2" if span > _NARROW else "D1", "tickformat": "~g"}
    return text_axis(title, type="log", **marks)


def _faint(colour: str) -> str:
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red},{green},{blue},0.15)"


def _line(x: Any, y: Series, colour: str, name: str, **look: Any) -> Plot:
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "x": x,
        "y": plain(y),
        "marker": {"color": colour or GREY},
        "hovertemplate": "%{x:.3g}: %{y:.3g}",
        **look,
    }
