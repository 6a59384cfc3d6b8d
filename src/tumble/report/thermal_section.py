"""The figures of a thermal calibration: biases against temperature on both branches, residuals, the span covered."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.report.figure import (
    AXIS_COLOURS,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    RED,
    Figure,
    Plot,
    Section,
    base_layout,
    plain,
    text_axis,
)

if TYPE_CHECKING:
    from tumble.arrays import Series, Vectors
    from tumble.calibration.estimate import Estimate
    from tumble.calibration.thermal.evidence import ThermalCurves
    from tumble.document.result import Calibration

# A state of the hysteresis beyond this is a branch, heating or cooling.
_BRANCH = 0.5
_DOMAINS = ([0.70, 1.0], [0.35, 0.65], [0.0, 0.30])
_TRIADS = {"accelerometer": ("Accelerometers", "force"), "gyroscope": ("Gyros", "rate")}


def thermal_sections(estimate: Estimate, calibration: Calibration) -> list[Section]:
    """Return the sections of a thermal calibration, none for another procedure.

    Parameters
    ----------
    estimate : with its evidence.
    calibration : for the raw units.
    """
    evidence = estimate.thermal_evidence
    if evidence is None:
        return []
    units = {
        "accelerometer": _shown_unit(calibration.raw_units.specific_force),
        "gyroscope": _shown_unit(calibration.raw_units.angular_rate),
    }
    sections: list[Section] = []
    for triad in ("gyroscope", "accelerometer"):
        if triad in evidence.curves:
            sections.append(_bias_section(evidence, triad, *units[triad]))
    sections.append(_sigma_section(evidence, units))
    sections.append(_residual_section(evidence))
    sections.append(_span_section(evidence))
    if evidence.candidates:
        sections.append(_candidate_section(evidence))
    return sections


def _shown_unit(raw: str) -> tuple[str, float]:
    """Return the unit of the figures and its factor from the raw one."""
    if raw == "m/s^2":
        return "mm/s²", 1e3
    if raw == "rad/s":
        return "°/s", float(np.degrees(1.0))
    return raw, 1.0


def _seen(evidence: ThermalCurves, triad: str) -> tuple[Vectors, Vectors]:
    """Return what the rests show of the biases, with sigmas; of accelerometers the soaks' own tests."""
    if triad == "gyroscope":
        return evidence.rate, evidence.rate_sigma
    return evidence.force, evidence.force_sigma


def _bias_section(evidence: ThermalCurves, triad: str, unit: str, factor: float) -> Section:
    curve = evidence.curves[triad]
    seen, _ = _seen(evidence, triad)
    whole: list[Plot] = []
    rest: list[Plot] = []
    branches = (
        ("heating", RED, evidence.hysteresis > _BRANCH, curve.heating),
        ("cooling", BLUE, evidence.hysteresis < -_BRANCH, curve.cooling),
        ("neither", GREY, np.abs(evidence.hysteresis) <= _BRANCH, None),
    )
    for axis in range(3):
        place = {"xaxis": "x", "yaxis": "y" if axis == 0 else f"y{axis + 1}", "showlegend": axis == 0}
        settled = np.interp(evidence.celsius, curve.celsius, curve.bias[:, axis])
        band = 2.0 * curve.sigma[:, axis] * factor
        rest.append(_band(curve.celsius, -band, band, place))
        for name, colour, here, line in branches:
            if np.any(here & np.isfinite(seen[:, axis])):
                points = {"name": name, **place, "marker": {"color": colour, "size": 5, "opacity": 0.7}}
                whole.append(_points(evidence.celsius[here], factor * seen[here, axis], points, unit))
                off = factor * (seen[here, axis] - settled[here])
                rest.append(_points(evidence.celsius[here], off, points, unit))
            if line is not None and np.any(line != curve.bias):
                off = factor * (line[:, axis] - curve.bias[:, axis])
                rest.append(_line(curve.celsius, off, colour, name, place))
        whole.append(_line(curve.celsius, factor * curve.bias[:, axis], "#444a55", "model, settled", place))
        if triad == "accelerometer":
            whole += _separate(evidence, axis, factor, 0.0, place, unit)
            rest += _separate(evidence, axis, factor, 1.0, place, unit)
    title, _ = _TRIADS[triad]
    figures = [
        Figure(f"{triad}-bias", f"{title}: bias against temperature", whole, _stacked(f"bias / {unit}")),
        Figure(
            f"{triad}-loop",
            f"{title}: bias beside the settled curve, both branches",
            rest,
            _stacked(f"Δ / {unit}"),
        ),
    ]
    caption = (
        f"{title}' biases against the sensors' temperature. Above or left, the whole of them; the other figure has the "
        "settled curve taken off, so that heating (red) and cooling (blue) stand apart by the hysteresis, which is the "
        "lines of their colours, and by what the rate of temperature does: in a sweep of one speed that is a constant "
        "distance from them. A trend that both branches share is a curve that bends more than the model. The grey band "
        "is twice the standard uncertainty."
    )
    if triad == "accelerometer" and not np.any(np.isfinite(seen)):
        caption = (
            "Accelerometer biases against the sensors' temperature. A rest alone does not show a bias: the crosses are "
            "multi-position tests of each soak alone, with one standard uncertainty; the line is the one adjustment of "
            "all, and the grey band twice its standard uncertainty."
        )
    return Section(f"{title}: bias against temperature", figures, caption)


def _separate(
    evidence: ThermalCurves, axis: int, factor: float, off: float, place: Plot, unit: str
) -> list[Plot]:
    if not evidence.separate:
        return []
    curve = evidence.curves["accelerometer"]
    celsius = np.array([s.celsius for s in evidence.separate])
    values = np.array([s.bias[axis] for s in evidence.separate])
    values = values - off * np.interp(celsius, curve.celsius, curve.bias[:, axis])
    sigma = np.array([s.sigma[axis] for s in evidence.separate])
    plot = _points(
        celsius,
        factor * values,
        {"name": "each soak alone", **place, "marker": {"color": ORANGE, "size": 8, "symbol": "x"}},
        unit,
    )
    plot["error_y"] = {"type": "data", "array": plain(factor * sigma), "color": ORANGE, "thickness": 1}
    return [plot]


def _points(x: Series, y: Series, more: Plot, unit: str) -> Plot:
    hovered = f"%{{x:.2f}} °C: %{{y:.4g}} {unit}<extra></extra>"
    return {
        "type": "scatter",
        "mode": "markers",
        "x": plain(x),
        "y": plain(y),
        "hovertemplate": hovered,
        **more,
    }


def _line(x: Series, y: Series, colour: str, name: str, place: Plot) -> Plot:
    return {
        "type": "scatter",
        "mode": "lines",
        "name": f"{name}",
        "x": plain(x),
        "y": plain(y),
        "line": {"color": colour, "width": 1.5},
        "hoverinfo": "skip",
        **place,
        "showlegend": bool(place["showlegend"]) and name.startswith("model"),
    }


def _band(x: Series, low: Series, high: Series, place: Plot) -> Plot:
    return {
        "type": "scatter",
        "mode": "lines",
        "x": plain(np.concatenate([x, x[::-1]])),
        "y": plain(np.concatenate([high, low[::-1]])),
        "fill": "toself",
        "fillcolor": "rgba(139,145,156,0.25)",
        "line": {"width": 0},
        "hoverinfo": "skip",
        **place,
        "showlegend": False,
    }


def _stacked(title: str) -> Plot:
    """Return the layout of three panels, one an axis of the unit, over one axis of temperature."""
    axes = {
        f"yaxis{'' if k == 0 else k + 1}": text_axis(
            f"{'xyz'[k]}: {title}", domain=_DOMAINS[k], zeroline=True
        )
        for k in range(3)
    }
    return base_layout(640, xaxis=text_axis("temperature of the sensors / °C", anchor="y3"), **axes)


def _sigma_section(evidence: ThermalCurves, units: dict[str, tuple[str, float]]) -> Section:
    figures: list[Figure] = []
    for triad, curve in evidence.curves.items():
        unit, factor = units[triad]
        data: list[Plot] = [
            {
                "type": "scatter",
                "mode": "lines",
                "name": axis,
                "x": plain(curve.celsius),
                "y": plain(factor * curve.sigma[:, k]),
                "line": {"color": AXIS_COLOURS[axis]},
            }
            for k, axis in enumerate("xyz")
        ]
        layout = base_layout(
            300,
            xaxis=text_axis("temperature of the sensors / °C"),
            yaxis=text_axis(f"σ of the {triad} bias / ({unit})", rangemode="tozero"),
        )
        figures.append(Figure(f"{triad}-sigma", f"Standard uncertainty of the {triad} bias", data, layout))
    caption = (
        "Standard uncertainty of the bias over the span that was calibrated, in the pose of the test where there was "
        "one alone. Beyond its ends the calibration is not used, unless asked to."
    )
    if "accelerometer" in evidence.curves and float(
        evidence.curves["accelerometer"].sigma.min()
    ) < 1e-3 * float(evidence.curves["accelerometer"].sigma.max()):
        caption += " The accelerometers' is of the change from the reference temperature, and zero there."
    return Section("How well the biases are known", figures, caption)


def _residual_section(evidence: ThermalCurves) -> Section:
    figures: list[Figure] = []
    for name, columns in (("specific force", slice(0, 3)), ("angular rate", slice(3, 6))):
        residuals = evidence.residuals[:, columns]
        if not np.any(np.isfinite(residuals)):
            continue
        data: list[Plot] = []
        for k, axis in enumerate("xyz"):
            if np.any(np.isfinite(residuals[:, k])):
                alone = name == "specific force" and not np.any(np.isfinite(residuals[:, 1]))
                marker = {"color": GREY if alone else AXIS_COLOURS[axis], "size": 5, "opacity": 0.7}
                mixed = k == 0 and name == "specific force" and np.any(~np.isfinite(residuals[:, 1]))
                label = "norm" if alone else ("x, or the norm" if mixed else axis)
                data.append(
                    _points(evidence.celsius, residuals[:, k], {"name": label, "marker": marker}, "σ")
                )
        layout = base_layout(
            300,
            xaxis=text_axis("temperature of the sensors / °C"),
            yaxis=text_axis(f"{name}, residual / σ", zeroline=True),
        )
        figures.append(Figure(f"residuals-{columns.start}", f"Residuals of {name}", data, layout))
    caption = (
        "What each rest shows beyond the model, in standard deviations of its own noise and of the wander of biases "
        "that was found: nearly all lie between −3 and 3. Neighbours stay together where biases wander, which is in "
        "the stated uncertainties. A wave that comes on both branches alike is a curve that the functions of "
        "temperature do not follow; two levels are branches that the hysteresis does not describe."
    )
    return Section("Residuals over temperature", figures, caption)


def _span_section(evidence: ThermalCurves) -> Section:
    minutes = 1.0 / 60.0
    data: list[Plot] = [
        {
            "type": "scatter",
            "mode": "lines",
            "name": "recorded",
            "x": plain(minutes * evidence.path_time),
            "y": plain(evidence.path_celsius),
            "line": {"color": GREY, "width": 1},
        },
        {
            "type": "scatter",
            "mode": "markers",
            "name": "rests used, at the sensors' temperature",
            "x": plain(minutes * 0.5 * (evidence.start + evidence.stop)),
            "y": plain(evidence.celsius),
            "marker": {"color": GREEN, "size": 5},
        },
    ]
    if evidence.rejected:
        start = np.array([r[0] for r in evidence.rejected])
        stop = np.array([r[1] for r in evidence.rejected])
        x = np.column_stack([start, stop, np.full(len(start), np.nan)]).ravel()
        low = float(np.min(evidence.path_celsius)) - 0.04 * float(np.ptp(evidence.path_celsius))
        data.append(
            {
                "type": "scatter",
                "mode": "lines",
                "name": "rests left out: not settled"
                if evidence.kind == "soak"
                else "rests left out: too fast",
                "x": plain(minutes * x),
                "y": [low if np.isfinite(value) else None for value in x],
                "line": {"color": ORANGE, "width": 6},
            }
        )
    layout = base_layout(
        320, xaxis=text_axis("time / min"), yaxis=text_axis("temperature / °C"), hovermode="closest"
    )
    ends = float(np.min(evidence.celsius)), float(np.max(evidence.celsius))
    caption = (
        f"The way of the temperature, and the {evidence.celsius.size} stretches of rest that were used, from "
        f"{ends[0]:.1f} to {ends[1]:.1f} °C. At temperatures between the green points nothing was measured."
    )
    notes = [f"Left out: {why}." for _, _, why in evidence.rejected[:8]]
    return Section(
        "The span covered", [Figure("span", "Temperature over time", data, layout)], caption, notes
    )


def _candidate_section(evidence: ThermalCurves) -> Section:
    names = [f"{c.name} ({c.unknowns} unknowns)" for c in evidence.candidates]
    data: list[Plot] = [
        {
            "type": "bar",
            "orientation": "h",
            "y": names,
            "x": plain([c.score for c in evidence.candidates]),
            "marker": {"color": [GREEN if c.chosen else GREY for c in evidence.candidates]},
            "error_x": {
                "type": "data",
                "array": plain([c.spread for c in evidence.candidates]),
                "thickness": 1,
            },
            "hovertemplate": "%{y}: %{x:.3g}<extra></extra>",
        }
    ]
    layout = base_layout(
        60 + 34 * len(names),
        xaxis=text_axis("mean square of what was predicted wrongly / σ²", type="log"),
        yaxis=text_axis("", autorange="reversed"),
    )
    left = "soaks" if evidence.kind == "soak" else "bands of temperature"
    caption = (
        f"Each candidate was fitted without some {left} and predicted them: 1 is as good as the noise. The green one "
        "was taken: of those that predict alike, the one with the fewest unknowns."
    )
    return Section("The choice of the functions", [Figure("candidates", "Candidates", data, layout)], caption)
