"""What holds, turns and spins still show after the calibration, beside what they showed before it."""

from __future__ import annotations

from typing import Any

import numpy as np

from tumble.arrays import Series
from tumble.attitude import Inverse, integrate_turns
from tumble.calibration import (
    BIAS,
    SCALE,
    Holds,
    Spins,
    ThermalCurves,
    Turns,
    gather,
    rough_triad,
    window_directions,
)
from tumble.parameters import two_digits
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.report.figures import record
from tumble.report.page import Block, Figures, Sentences, Table, section
from tumble.report.subject import Subject
from tumble.segmentation import HoldMeans, Timeline
from tumble.sensor import ImuModel
from tumble.units import angular_rate_factor, specific_force_factor


def holds(told: Holds, subject: Subject) -> list[Block]:
    """Return the figure of the holds' norms and the table of those that sway; nothing without holds.

    Parameters
    ----------
    told : what the estimate rests on.
    subject : of a thermal test the residuals are the rests', and stand elsewhere.
    """
    found: list[Block] = []
    if told.norms.size and subject.estimate.shown(ThermalCurves) is None:
        before = nominal_hold_norms(subject.recording, subject.means, subject.calibration.site.gravity)
        figures = Figures([_drawn(told, subject, before)], _caption(told, subject, before))
        found += section("Holds: norm against gravity", figures)
    return found + restless(told)


def _caption(told: Holds, subject: Subject, before: Uncalibrated | None) -> str:
    caption = (
        f"After calibration the norm of each hold differs from gravity by {two_digits(rms(1e3 * told.norms))} mm/s² "
        "rms; the points should scatter within the band (one and two expected standard deviations) without a trend"
    )
    if subject.estimate.degrees_of_freedom <= 0:
        caption = (
            "With as many unknowns as holds the norms are fitted whatever they are: the points show nothing"
        )
    if before is None:
        return f"{caption}."
    earlier = rms(1e3 * before.residuals)
    return f"{caption}. Before (above, another scale) it was {earlier:.3g} mm/s² rms, with {before.words}."


def _drawn(told: Holds, subject: Subject, before: Uncalibrated | None) -> record.Figure:
    number = np.arange(1, told.norms.size + 1)
    colours = [record.RED if k in subject.holds_left_out else record.BLUE for k in range(number.size)]
    hover = "hold %{x}: %{y:.2f} mm/s²<br>%{text}<extra></extra>"
    marks: list[record.Mark] = _band(number, 1e3 * told.sigmas)
    marks.append(
        record.Points(number.tolist(), 1e3 * told.norms, "after", colours, hover=hover, words=subject.poses)
    )
    panels = [record.Axis("norm − g, after / (mm/s²)")]
    if before is not None:
        hover = "hold %{x}: %{y:.1f} mm/s²<br>%{text}<extra></extra>"
        look: record.Look = {"panel": 1, "hover": hover, "words": subject.poses}
        marks.append(record.Bars(number.tolist(), 1e3 * before.residuals, "before", record.GREY, **look))
        panels = [
            record.Axis("after / (mm/s²)", share=(0.0, 0.55)),
            record.Axis("before / (mm/s²)", share=(0.63, 1.0)),
        ]
    label = "Norm of the specific force in each hold minus gravity, before and after"
    return record.Figure(
        "holds", label, marks, numbered("hold", number), panels, 340 if before is None else 460
    )


def _band(number: np.ndarray, sigma: Series) -> list[record.Mark]:
    """Return the band of two and of one standard deviation, a step for each hold."""
    x = np.append(number - 0.5, number[-1] + 0.5)
    y = np.append(sigma, sigma[-1])
    return [
        record.Band(
            x,
            (-factor * y, factor * y),
            "expected ± 1 and 2 sigma",
            record.GREY,
            opacity=opacity,
            legend=factor == 1.0,
            steps="post",
        )
        for factor, opacity in ((2.0, 0.16), (1.0, 0.3))
    ]


def rms(values: Series) -> float:
    """Return the root mean square of what is finite."""
    return float(np.sqrt(np.nanmean(values**2)))


def numbered(title: str, number: np.ndarray) -> record.Axis:
    """Return an axis of whole numbers, marked as often as there is room for.

    Parameters
    ----------
    title : of the axis.
    number : (n,) ascending.
    """
    count = int(number[-1])
    step = 1 if count <= 15 else 5 if count <= 80 else 10 ** int(np.ceil(np.log10(count / 10.0)))
    span = (float(number[0]) - 0.8, float(number[-1]) + 0.8)
    return record.Axis(title, every=step, span=span, zero=False)


def restless(told: Holds) -> list[Block]:
    """Return the holds that sway more than the others as a table; nothing without such.

    Parameters
    ----------
    told : with the holds that the procedure found restless.
    """
    if not told.restless:
        return []
    rows = [
        [
            str(one.hold + 1),
            f"{one.start:.1f} to {one.stop:.1f}",
            two_digits(1e3 * one.sway),
            two_digits(1e3 * one.others),
        ]
        for one in told.restless
    ]
    words = (
        "One sigma about each axis, from a hold's start to its middle and from there to its end. These holds count "
        "for less. Support the unit firmly and record them again."
    )
    heads = ("hold", "s", "sways by, mrad", "the others, mrad")
    return section("Holds that do not rest", Sentences([words], "paragraphs"), Table(heads, rows))


def turns(told: Turns, subject: Subject) -> list[Block]:
    """Return the figure of the turns' angles before and after; nothing without turns.

    Parameters
    ----------
    told : what the estimate rests on.
    subject : of the report.
    """
    estimate, poses = subject.estimate, subject.poses
    at = np.flatnonzero(np.isfinite(told.angles))
    if at.size == 0:
        return []
    before = nominal_turn_angles(subject.recording, subject.timeline, subject.means, estimate.model)
    after = np.degrees(told.angles[at])
    words = [
        f"turned {size:.0f}°, from {poses[k]} to {poses[k + 1]}"
        for k, size in zip(at, np.degrees(told.sizes[at]), strict=True)
    ]
    shown: dict[str, Any] = {"words": words, "hover": "turn %{x}: %{y:.3f}°<br>%{text}<extra></extra>"}
    x, expected = (at + 1).tolist(), np.degrees(told.sigmas[at])
    marks: list[record.Mark] = []
    caption = (
        f"Gravity carried over a turn by the corrected gyro ends {two_digits(rms(after))}° rms from where it "
        "is seen afterwards. The blue points should lie around the grey line of expected standard "
        "deviations, not above"
    )
    if before is not None:
        earlier = np.degrees(before.residuals[at])
        marks.append(record.Points(x, earlier, "before", record.GREY, symbol="circle-open", **shown))
        caption += f". Before it was {two_digits(rms(earlier))}° rms, with {before.words}"
    gone = {int(np.searchsorted(at, left.index)) for left in estimate.left_out if left.kind == "turn"}
    colours = [record.RED if k in gone else record.BLUE for k in range(at.size)]
    marks.append(record.Points(x, after, "after", colours, size=8, **shown))
    hover = "expected %{y:.3f}°<extra></extra>"
    marks.append(record.Curve(x, expected, "expected", record.GREY, hover=hover, width=1.5, steps="mid"))
    every = np.concatenate([mark.y for mark in marks])
    angles = record.Axis("angle / °", "log", ticks=_decades(every[every > 0.0]))
    label = "Angle between gravity carried over each turn and gravity seen, before and after"
    across = numbered("turn (from hold n to the next)", at + 1)
    figure = record.Figure("turns", label, marks, across, angles, 380)
    return section("Turns: gravity carried by the gyro", Figures([figure], f"{caption}."))


def _decades(values: Series) -> list[float]:
    """Return ticks of a logarithmic axis that are plain numbers: 1, 2, 5 or 1 only over many decades."""
    if not values.size:
        return []
    low, high = values.min(), values.max()
    steps = (1, 2, 5) if np.log10(high / low) < 2.5 else (1,)
    first, last = int(np.floor(np.log10(low))), int(np.ceil(np.log10(high)))
    return [step * 10.0**decade for decade in range(first, last + 1) for step in steps]


def spins(told: Spins, subject: Subject) -> list[Block]:
    """Return the figure of each spin's residual against its rate; nothing without spins.

    Parameters
    ----------
    told : what the estimate rests on.
    subject : of the report.
    """
    if told.rates.size == 0:
        return []
    rates = record.plain(np.degrees(told.rates), 7)
    residuals, sigmas = (1e3 * np.degrees(a) for a in (told.residuals, told.sigmas))
    marks = [
        record.Points(
            rates,
            residuals[:, axis],
            f"gyro {name}",
            record.AXIS_COLOURS[name],
            sigma=sigmas[:, axis],
            words=told.names,
            size=8,
            hover="%{text}: %{y:.3g} m°/s<extra></extra>",
        )
        for axis, name in enumerate("xyz")
        if np.any(np.isfinite(residuals[:, axis]))
    ]
    left = rms(told.residuals)
    largest = float(np.max(np.abs(told.rates)))
    across, upright = record.Axis("reference rate of the spin / (°/s)"), record.Axis("residual / (m°/s)")
    caption = (
        f"After calibration the spins leave {two_digits(1e3 * np.degrees(left))} m°/s rms over all "
        f"three gyros, {two_digits(1e6 * left / largest)} ppm of the fastest spin. The gyros that are "
        "not spun show a placement that is off. Points that follow a curve would be a nonlinear "
        "scale factor, a kink at zero an asymmetry. Bars are one standard deviation."
    )
    label = "Residual of each gyro in each spin against the reference rate"
    figure = record.Figure("spins", label, marks, across, upright, 360)
    return section("Spins: residual against the rate", Figures([figure], caption))


@dataclass(frozen=True)
class Uncalibrated:
    """Residuals with nominal values: one per hold (nan where there is none), and what "nominal" is."""

    residuals: Series
    words: str


def nominal_hold_norms(recording: Recording, means: HoldMeans, gravity: float) -> Uncalibrated | None:
    """Return the norm of each hold's raw mean minus `gravity`, m/s².

    Counts have no nominal unit: there the rough six-position values stand for it.
    """
    if means.specific_force is None:
        return None
    factor = specific_force_factor(recording.specific_force_unit)
    if factor is not None:
        return Uncalibrated(
            np.linalg.norm(factor * means.specific_force, axis=1) - gravity, "the raw values in their unit"
        )
    rough = rough_triad(means.specific_force, gravity)
    corrected = (means.specific_force - rough[BIAS]) / rough[SCALE]
    return Uncalibrated(
        np.linalg.norm(corrected, axis=1) - gravity,
        "rough six-position values of bias and scale, because counts alone mean nothing",
    )


def nominal_turn_angles(
    recording: Recording, timeline: Timeline, means: HoldMeans, model: ImuModel
) -> Uncalibrated | None:
    """Return the angle between gravity carried over each turn and gravity seen after it, rad.

    The gyro's matrix is nominal (diagonal), its bias and the accelerometers are the calibration's, so
    that the difference is what scale and misalignment of the gyro do. The Earth's rotation over a turn
    is left aside.
    """
    gyro, force = model.gyroscope, model.accelerometer
    if gyro is None or force is None or recording.angular_rate is None or recording.specific_force is None:
        return None
    factor = angular_rate_factor(recording.angular_rate_unit)
    inverse = np.diag(1.0 / np.diag(gyro.matrix)) if factor is None else factor * np.eye(3)
    data = gather(recording, timeline, means)
    turns = np.flatnonzero(data.turn_start >= 0)
    angles = np.full(data.holds, np.nan)
    head, tail = window_directions(data, force.matrix, force.bias, inverse)
    forward = np.asarray(np.linalg.inv(force.matrix), dtype=np.float64)
    of_turns = data.turn_start[turns], data.turn_stop[turns]
    both = Inverse(inverse, gyro.bias, forward, force.bias)
    integrated = integrate_turns(*data.samples, *of_turns, both)
    carried = np.einsum("tab,tb->ta", integrated.C_start_end, head[turns + 1])
    angles[turns] = np.arctan2(
        np.linalg.norm(np.cross(carried, tail[turns]), axis=1), np.einsum("ta,ta->t", carried, tail[turns])
    )
    words = "the gyro's nominal scale factor on axes taken as perpendicular"
    if factor is None:
        words = (
            "the gyro's estimated scale factors on axes taken as perpendicular (counts have no nominal ones)"
        )
    return Uncalibrated(angles, words)
