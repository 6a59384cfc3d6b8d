"""What a thermal calibration rests on: biases against temperature on both branches, residuals, the span covered."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series
from tumble.calibration import BiasCurve, ThermalCurves
from tumble.parameters import said_unit
from tumble.recording import Recording
from tumble.report.figures import record
from tumble.report.page import Block, Figures, Sentences, section
from tumble.report.subject import Subject

# A state of the hysteresis beyond this is a branch, heating or cooling.
_BRANCH = 0.5
_SHARES = ((0.70, 1.0), (0.35, 0.65), (0.0, 0.30))
_TITLES = {"accelerometer": "Accelerometers", "gyroscope": "Gyros"}
_CELSIUS = "temperature of the sensors / °C"
_BIASES = (
    "{title}' biases against the sensors' temperature. The upper or left figure shows the whole of "
    "them. The other figure has the settled curve taken off. Heating (red) and cooling (blue) are "
    "then apart by the hysteresis, which is the lines of their colours. The rate of temperature adds "
    "to that: in a sweep of one speed, a constant distance from the lines. A trend that both "
    "branches share is a curve that bends more than the model. The grey band is twice the standard "
    "uncertainty."
)
_NO_REST_ALONE = (
    "Accelerometer biases against the sensors' temperature. A rest alone does not show a bias. The line is the "
    "adjustment of all soaks, and the grey band twice its standard uncertainty."
)
_RESIDUALS = (
    "What each rest shows beyond the model, in standard deviations of its own noise and of the wander of biases "
    "that was found: nearly all lie between −3 and 3. Neighbours stay together where biases wander, which is in "
    "the stated uncertainties. A wave that comes on both branches alike is a curve that the functions of "
    "temperature do not follow; two levels are branches that the hysteresis does not describe."
)


def thermal(evidence: ThermalCurves, subject: Subject) -> list[Block]:
    """Return the sections of a thermal calibration.

    Parameters
    ----------
    evidence : what the estimate rests on.
    subject : of the report.
    """
    raw = subject.calibration.raw_units
    raws = {"accelerometer": raw.specific_force, "gyroscope": raw.angular_rate}
    units = {triad: _shown_unit(raws[triad], curve) for triad, curve in evidence.curves.items()}
    blocks: list[Block] = []
    for triad in ("gyroscope", "accelerometer"):
        if triad in evidence.curves:
            blocks += _biases(evidence, triad, *units[triad])
    blocks += _sigmas(evidence, units) + _residuals(evidence) + _span(evidence, subject.recording)
    return blocks + (_candidates(evidence) if evidence.candidates else [])


def _shown_unit(raw: str, curve: BiasCurve) -> tuple[str, float]:
    """The unit of the figures and its factor from the raw one."""
    factor, unit = said_unit(raw, np.abs(curve.bias).ravel().tolist())
    return unit, factor


def _biases(evidence: ThermalCurves, triad: str, unit: str, factor: float) -> list[Block]:
    # What the rests show of the biases; of accelerometers the soaks' own tests.
    seen = evidence.rate if triad == "gyroscope" else evidence.force
    whole: list[record.Mark] = []
    beside: list[record.Mark] = []
    for axis in range(3):
        panels = _panel(evidence, triad, axis, factor * seen[:, axis], factor, unit)
        whole += panels[0]
        beside += panels[1]
    title, shown = _TITLES[triad], record.in_brackets(unit)
    figures = [
        record.Figure(
            f"{triad}-{name}",
            f"{title}: bias {label}",
            marks,
            record.Axis(_CELSIUS),
            [record.Axis(f"{'xyz'[k]}: {word} / {shown}", share=_SHARES[k]) for k in range(3)],
            640,
        )
        for name, label, marks, word in (
            ("bias", "against temperature", whole, "bias"),
            ("loop", "beside the settled curve, both branches", beside, "Δ"),
        )
    ]
    alone = triad == "accelerometer" and not np.any(np.isfinite(seen))
    caption = _NO_REST_ALONE if alone else _BIASES.format(title=title)
    return section(f"{title}: bias against temperature", Figures(figures, caption))


def _panel(
    evidence: ThermalCurves, triad: str, axis: int, seen: Series, factor: float, unit: str
) -> tuple[list[record.Mark], list[record.Mark]]:
    """Return what an axis has: the whole biases, and what is beside the settled curve."""
    curve = evidence.curves[triad]
    x, settled = curve.celsius, factor * curve.bias[:, axis]
    half = 2.0 * factor * curve.sigma[:, axis]
    whole: list[record.Mark] = []
    beside: list[record.Mark] = [record.Band(x, (-half, half), "", record.GREY, 0.25, axis, legend=False)]
    branches = (
        ("heating", record.RED, evidence.hysteresis > _BRANCH, curve.heating),
        ("cooling", record.BLUE, evidence.hysteresis < -_BRANCH, curve.cooling),
        ("neither", record.GREY, np.abs(evidence.hysteresis) <= _BRANCH, None),
    )
    for name, colour, here, line in branches:
        if np.any(here & np.isfinite(seen)):
            at = evidence.celsius[here]
            for marks, y in ((whole, seen[here]), (beside, seen[here] - np.interp(at, x, settled))):
                marks.append(_points(at, y, unit, name, colour, axis))
        if line is not None and np.any(line != curve.bias):
            along = factor * line[:, axis] - settled
            beside.append(record.Curve(x, along, name, colour, 1.0, axis, legend=False, hover="", width=1.5))
    model = "model, settled"
    whole.append(record.Curve(x, settled, model, "#7a8290", 1.0, axis, legend=axis == 0, hover="", width=1.5))
    return whole, beside


def _points(x: Series, y: Series, unit: str, name: str, colour: str, panel: int = 0) -> record.Points:
    hover = f"%{{x:.2f}} °C: %{{y:.4g}} {unit}<extra></extra>"
    return record.Points(x, y, name, colour, 0.7, panel, legend=panel == 0, hover=hover, size=5)


def _sigmas(evidence: ThermalCurves, units: dict[str, tuple[str, float]]) -> list[Block]:
    figures: list[record.Figure] = []
    for triad, curve in evidence.curves.items():
        unit, factor = units[triad]
        marks = [
            record.Curve(curve.celsius, factor * curve.sigma[:, k], axis, record.AXIS_COLOURS[axis])
            for k, axis in enumerate("xyz")
        ]
        highest = 1.05 * factor * float(np.nanmax(curve.sigma))
        words = f"σ of the {triad} bias / {record.in_brackets(unit)}"
        upright = record.Axis(words, span=(0.0, highest or 1.0))
        label = f"Standard uncertainty of the {triad} bias"
        figures.append(record.Figure(f"{triad}-sigma", label, marks, record.Axis(_CELSIUS), upright, 300))
    caption = (
        "Standard uncertainty of the bias over the span that was calibrated, in the pose of the test where there was "
        "one alone. Beyond its ends the calibration is not used, unless asked to."
    )
    force = evidence.curves.get("accelerometer")
    if force is not None and float(force.sigma.min()) < 1e-3 * float(force.sigma.max()):
        caption += " The accelerometers' is of the change from the reference temperature, and zero there."
    return section("How well the biases are known", Figures(figures, caption))


def _residuals(evidence: ThermalCurves) -> list[Block]:
    figures: list[record.Figure] = []
    for name, columns in (("specific force", slice(0, 3)), ("angular rate", slice(3, 6))):
        residuals = evidence.residuals[:, columns]
        known = np.isfinite(residuals)
        if not np.any(known):
            continue
        marks: list[record.Mark] = []
        for k, axis in enumerate("xyz"):
            if np.any(known[:, k]):
                alone = name == "specific force" and not np.any(known[:, 1])
                mixed = k == 0 and name == "specific force" and not np.all(known[:, 1])
                colour = record.GREY if alone else record.AXIS_COLOURS[axis]
                label = "norm" if alone else ("x, or the norm" if mixed else axis)
                marks.append(_points(evidence.celsius, residuals[:, k], "σ", label, colour))
        label, upright = f"Residuals of {name}", record.Axis(f"{name}, residual / σ")
        figures.append(
            record.Figure(f"residuals-{columns.start}", label, marks, record.Axis(_CELSIUS), upright, 300)
        )
    return section("Residuals over temperature", Figures(figures, _RESIDUALS))


def _span(evidence: ThermalCurves, recording: Recording) -> list[Block]:
    # Stamps may count from 1970: five digits of them are no time of day.
    first = float(recording.time[0])
    recorded = (evidence.path_time - first) / 60.0
    used = (0.5 * (evidence.start + evidence.stop) - first) / 60.0
    name = "rests used, at the sensors' temperature"
    marks: list[record.Mark] = [
        record.Curve(recorded, evidence.path_celsius, "recorded", record.GREY, width=1),
        record.Points(used, evidence.celsius, name, record.GREEN, size=5),
    ]
    if evidence.rejected:
        spans = np.array([[start, stop, np.nan] for start, stop, _ in evidence.rejected])
        x = (spans.ravel() - first) / 60.0
        low = float(np.min(evidence.path_celsius)) - 0.04 * float(np.ptp(evidence.path_celsius))
        why = "rests left out: " + ("not settled" if evidence.kind == "soak" else "too fast")
        y = [low if np.isfinite(value) else None for value in x]
        marks.append(record.Curve(x, y, why, record.ORANGE, width=6))
    ends = float(np.min(evidence.celsius)), float(np.max(evidence.celsius))
    caption = (
        f"The way of the temperature, and the {evidence.celsius.size} stretches of rest that were used, from "
        f"{ends[0]:.1f} to {ends[1]:.1f} °C. At temperatures between the green points nothing was measured."
    )
    axes = record.Axis("time / min"), record.Axis("temperature / °C")
    figure = record.Figure("span", "Temperature over time", marks, *axes, 320)
    notes = [f"Left out: {why}." for _, _, why in evidence.rejected[:8]]
    return section("The span covered", Figures([figure], caption), Sentences(notes, "notes"))


def _candidates(evidence: ThermalCurves) -> list[Block]:
    names = [f"{c.name} ({c.unknowns} unknowns)" for c in evidence.candidates]
    bars = record.Bars(
        record.plain([c.score for c in evidence.candidates]),
        names,
        colour=[record.GREEN if c.chosen else record.GREY for c in evidence.candidates],
        hover="%{y}: %{x:.3g}<extra></extra>",
        lying=True,
        sigma=record.plain([c.spread for c in evidence.candidates]),
    )
    across = record.Axis("mean squared error / σ²", "log")
    upright = record.Axis(kind="names", downwards=True)
    left = "soaks" if evidence.kind == "soak" else "bands of temperature"
    caption = (
        f"Each candidate was fitted without some {left} and predicted them: 1 is as good as the noise. The green one "
        "was taken: of those that predict alike, the one with the fewest unknowns."
    )
    figure = record.Figure("candidates", "Candidates", [bars], across, upright, 60 + 34 * len(names))
    return section("The choice of the functions", Figures([figure], caption))
