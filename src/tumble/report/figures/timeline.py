"""The timeline: specific force and angular rate with holds, turns and what was rejected."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tumble.arrays import Series, Vector, Vectors
from tumble.calibration import Estimate
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.report.figures import record
from tumble.report.page import Block, Figures, Sentences, section
from tumble.report.subject import Subject
from tumble.segmentation import Timeline
from tumble.sensor import Triad
from tumble.units import angular_rate_factor, specific_force_factor

# A bin is about a pixel of a wide screen; each shows its smallest and its largest value.
BINS = 1000
# More holds than this are too narrow to shade one by one.
_MOST_SHADED = 250
# A bar narrower than this share of the recording cannot be pointed at.
_NARROWEST = 1.0 / 400.0


@dataclass(frozen=True)
class Envelope:
    """Smallest and largest value in equal bins of time, one after the other; nan where no sample is.

    `start` and `step` give the time of each entry, s from the recording's first sample.
    """

    start: float
    step: float
    values: np.ndarray


def envelope(time: Series, signal: Vectors, bins: int = BINS) -> Envelope:
    """Return (2 bins, 3) of the signal's extremes in `bins` equal intervals of time.

    Nothing that lasts a single sample is lost, however long the recording is.
    """
    count = min(bins, max(1, time.size // 2))
    elapsed = time - time[0]
    width = max(float(elapsed[-1]), 1e-9) / count
    edges = np.searchsorted(elapsed, width * np.arange(count + 1))
    edges[-1] = time.size
    filled = np.flatnonzero(np.diff(edges) > 0)
    values = np.full((2 * count, 3), np.nan)
    values[2 * filled] = np.minimum.reduceat(signal, edges[filled], axis=0)
    values[2 * filled + 1] = np.maximum.reduceat(signal, edges[filled], axis=0)
    return Envelope(0.25 * width, 0.5 * width, values)


def timeline(subject: Subject) -> list[Block]:
    """Return the figure of the whole recording, and what was rejected of it.

    Parameters
    ----------
    subject : of the report.
    """
    recording, model = subject.recording, subject.estimate.model
    spins = [] if subject.matching is None else [(spin.start, spin.stop) for spin in subject.matching.spins]
    panels = _panels(recording, model.accelerometer, model.gyroscope)
    shares = [(0.0, 0.93)] if len(panels) < 2 else [(0.49, 0.93), (0.0, 0.44)]
    axes = [
        record.Axis(title, zero=False, share=share) for (title, _), share in zip(panels, shares, strict=False)
    ]
    # The strip on top is no quantity.
    axes.append(record.Axis(span=(-0.5, 0.5), hidden=True, share=(0.95, 1.0)))
    strip = len(panels)
    marks = [
        *_shades(recording, subject.timeline, subject.holds_left_out),
        *_strip(recording, subject.timeline, subject.estimate, spins, strip),
        *(mark for number, (_, values) in enumerate(panels) for mark in _channels(values, number)),
    ]
    caption = (
        "Each numbered blue stretch is a hold and should be flat; purple is a turn that was used, "
        + ("teal a spin, " if spins else "")
        + "red was left out as an outlier. Orange was rejected, is a turn that was not used, or a numbered hold that "
        "sways and counts less. "
        "Point at the strip on top for the reason."
    )
    label = "Specific force and angular rate over time with holds and turns"
    across = record.Axis("time / s", span=(0.0, round(recording.duration, 3)))
    figure = record.Figure("timeline", label, marks, across, axes, 560)
    return section(
        "Timeline",
        Figures([figure], caption),
        Sentences(_rejection_notes(recording, subject.timeline), "notes"),
    )


def _panels(recording: Recording, force: Triad | None, gyro: Triad | None) -> list[tuple[str, Envelope]]:
    panels: list[tuple[str, Envelope]] = []
    if recording.specific_force is not None:
        factor = specific_force_factor(recording.specific_force_unit)
        scale, offset, unit = _to_si(factor, force, 1.0, "(m/s²)")
        raw = envelope(recording.time, recording.specific_force)
        panels.append((f"specific force / {unit}", _scaled(raw, scale, offset)))
    if recording.angular_rate is not None:
        factor = angular_rate_factor(recording.angular_rate_unit)
        scale, offset, unit = _to_si(factor, gyro, 180.0 / np.pi, "(°/s)")
        raw = envelope(recording.time, recording.angular_rate)
        panels.append((f"angular rate / {unit}", _scaled(raw, scale, offset)))
    return panels


def _to_si(
    factor: float | None, triad: Triad | None, practical: float, unit: str
) -> tuple[Vector, Vector, str]:
    """Return scale and offset of each channel: raw values in their unit, or counts by the estimate."""
    if factor is not None:
        return np.full(3, practical * factor), np.zeros(3), unit
    # A gyro in counts of which only the bias is known has a nominal matrix that means nothing.
    if triad is None or np.allclose(triad.matrix, np.eye(3)):
        return np.ones(3), np.zeros(3), "counts"
    return practical / np.diag(triad.matrix), triad.bias, unit


def _scaled(raw: Envelope, scale: Vector, offset: Vector) -> Envelope:
    return Envelope(raw.start, raw.step, scale * (raw.values - offset))


def _channels(values: Envelope, panel: int) -> list[record.Mark]:
    return [
        record.Curve(
            round(values.start, 6),
            values.values[:, column],
            name,
            record.AXIS_COLOURS[name],
            panel=panel,
            legend=panel == 0,
            group=name,
            hover="%{y:.3f} at %{x:.2f} s",
            width=1,
            step=round(values.step, 9),
        )
        for column, name in enumerate("xyz")
    ]


def _strip(
    recording: Recording,
    timeline: Timeline,
    estimate: Estimate,
    spins: Sequence[tuple[int, int]],
    panel: int,
) -> list[record.Mark]:
    """Return the bars on top: what each stretch of the recording was taken for."""
    why = {(left.kind, left.index): left.reason for left in estimate.left_out}
    restless = {one.hold: one.sway for one in estimate.holds.restless}
    holds: list[tuple[int, int, str, str]] = []
    turns: list[tuple[int, int, str, str]] = []
    for index, hold in enumerate(timeline.holds):
        reason = why.get(("hold", index))
        words = f"hold {index + 1}" + (f", left out: {reason}" if reason else "")
        if index in restless:
            words += f", sways by {1e3 * restless[index]:.2g} mrad"
        colour = record.RED if reason else record.ORANGE if index in restless else record.BLUE
        holds.append((hold.start, hold.stop, words, colour))
    for turn in timeline.turns:
        reason = why.get(("turn", turn.before))
        words = f"turn {turn.before + 1}: from hold {turn.before + 1} to hold {turn.after + 1}"
        if reason:
            words += f", left out: {reason}"
        elif not turn.usable:
            words += f", not used: {turn.reason}"
        colour = record.RED if reason else record.PURPLE if turn.usable else record.ORANGE
        turns.append((turn.start, turn.stop, words, colour))
    rejected = [(r.start, r.stop, f"rejected: {r.reason}", record.ORANGE) for r in timeline.rejections]
    spun = [
        (start, stop, _spin_words(estimate, index, reason), record.RED if reason else record.TEAL)
        for index, (start, stop) in enumerate(spins)
        for reason in [why.get(("spin", index))]
    ]
    # A spin lies within the turn between two holds, or within what was rejected: it is drawn over them.
    kinds = [("turns", turns), ("holds", holds), ("rejected", rejected), ("spins", spun)]
    bars = [_bars(recording, name, items, panel) for name, items in kinds if items]
    colours = {"holds": record.BLUE, "turns": record.PURPLE, "spins": record.TEAL}
    named = [(name, colours[name]) for name, items in kinds if items and name in colours]
    drawn = {colour for _, items in kinds for *_, colour in items}
    named += [(name, colour) for colour, name in _MEANINGS.items() if colour in drawn]
    # Points at no place: the bars' own entry would have the first bar's colour, which may be red.
    square: record.Look = {"panel": panel, "symbol": "square", "size": 10, "hover": ""}
    legend = [record.Points([None], [None], name, colour, **square) for name, colour in named]
    return [*bars, *legend, _hold_numbers(recording, timeline, panel)]


_MEANINGS = {record.RED: "left out", record.ORANGE: "rejected, swaying or not used"}


def _spin_words(estimate: Estimate, index: int, reason: str | None) -> str:
    name = estimate.spins.names[index] if index < len(estimate.spins.names) else ""
    words = f"spin {index + 1}" + (f": {name}" if name else "")
    return words + (f", left out: {reason}" if reason else "")


def _hold_numbers(recording: Recording, timeline: Timeline, panel: int) -> record.Points:
    """Return the numbers on the strip; the page's script shows as many as there is room for."""
    start = _elapsed(recording, [hold.start for hold in timeline.holds])
    stop = _elapsed(recording, [hold.stop for hold in timeline.holds])
    numbers = [str(k + 1) for k in range(len(timeline.holds))]
    look: record.Look = {"panel": panel, "legend": False, "hover": "", "symbol": "", "size": 11}
    return record.Points(
        record.plain(0.5 * (start + stop), 7), [0] * len(numbers), colour="#ffffff", labels=numbers, **look
    )


def _bars(recording: Recording, name: str, items: list[tuple[int, int, str, str]], panel: int) -> record.Bars:
    start = _elapsed(recording, [item[0] for item in items])
    stop = _elapsed(recording, [item[1] for item in items])
    width = np.maximum(stop - start, _NARROWEST * recording.duration)
    return record.Bars(
        width,
        [0] * len(items),
        name,
        [item[3] for item in items],
        panel=panel,
        legend=False,
        words=[f"{item[2]}\n{a:.1f} to {b:.1f} s" for item, a, b in zip(items, start, stop, strict=True)],
        lying=True,
        base=0.5 * (start + stop) - 0.5 * width,
        width=1,
    )


def _shades(recording: Recording, timeline: Timeline, gone: set[int]) -> list[record.Spans]:
    stretches = [
        (h.start, h.stop, record.RED if k in gone else record.BLUE) for k, h in enumerate(timeline.holds)
    ]
    stretches += [(r.start, r.stop, record.ORANGE) for r in timeline.rejections]
    if len(stretches) > _MOST_SHADED:
        return []
    ends = [start for start, _, _ in stretches], [stop for _, stop, _ in stretches]
    start, stop = ([round(float(at), 3) for at in _elapsed(recording, end)] for end in ends)
    return [record.Spans(start, stop, colour=[s[2] for s in stretches], opacity=0.13)]


def _elapsed(recording: Recording, samples: list[int]) -> Series:
    """Return seconds since the recording's first sample; a stop is its last sample's time."""
    index = np.minimum(np.array(samples, dtype=int), len(recording) - 1)
    return recording.time[index] - recording.time[0]


def _rejection_notes(recording: Recording, timeline: Timeline) -> list[str]:
    """Return the rejected stretches as sentences, for paper and for those who cannot point."""
    if not timeline.rejections:
        return ["No stretch was rejected."]
    start = _elapsed(recording, [r.start for r in timeline.rejections])
    stop = _elapsed(recording, [r.stop for r in timeline.rejections])
    notes = [
        f"Rejected: {a:.1f} to {b:.1f} s, {rejection.reason}."
        for a, b, rejection in zip(start, stop, timeline.rejections, strict=True)
    ]
    shown = 12
    rest = len(notes) - shown
    return notes if rest <= 0 else [*notes[:shown], f"And {rest} more: point at the strip."]
