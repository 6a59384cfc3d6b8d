"""The magnetometer in a report: its sphere before and after, and the field's norm and dip in each hold.

A magnetometer's calibration in a few lines: its parameters with uncertainties, its verdict.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.report.figures.plot import BLUE, GREY, RED, base_layout, plain, scatter, text_axis
from tumble.report.page import Block, Figure, Figures, Plot, Sentences, Table, section
from tumble.report.rounding import with_uncertainty
from tumble.units import magnetic_field_factor

if TYPE_CHECKING:
    from tumble.calibration.magnetometer.estimate import Magnetometer
    from tumble.document.magnetometer_block import MagnetometerBlock
    from tumble.report.subject import Subject


MICRO = 1e6
_ROWS = (
    ("bias (hard iron)", "magnetometer bias", "xyz"),
    ("scale factor", "magnetometer scale factor", "xyz"),
    ("soft iron", "magnetometer soft iron", ("yz", "xz", "xy")),
    ("rotation", "rotation of the magnetometer", "xyz"),
)


def magnetometer_table(block: MagnetometerBlock | None) -> Table | None:
    """Return the parameters, three to a line; None where there are none.

    Parameters
    ----------
    block : of the calibration.
    """
    rows = magnetometer_rows(block)
    return Table(("magnetometer", "x", "y", "z", ""), rows) if rows else None


def magnetometer_rows(block: MagnetometerBlock | None) -> list[list[str]]:
    """Return the parameters, three to a row between their name and their unit; empty where there are none.

    Parameters
    ----------
    block : of the calibration.
    """
    if block is None or not block.parameters:
        return []
    known = {p.name: p for p in block.parameters}
    scale = float(np.mean([known[f"magnetometer scale factor {a}"].value for a in "xyz"]))
    rows: list[list[str]] = []
    for label, name, ends in _ROWS:
        own = [known[f"{name} {end}"] for end in ends if f"{name} {end}" in known]
        if len(own) < 3:
            continue
        factor, unit = _practical(block, label, scale)
        texts = [with_uncertainty(factor * p.value, abs(factor) * p.standard_uncertainty) for p in own]
        # Heads name x, y and z; a pair of axes names itself.
        texts = [text if len(end) == 1 else f"{end} {text}" for end, text in zip(ends, texts, strict=True)]
        rows.append([label, *texts, unit])
    return rows


def _practical(block: MagnetometerBlock, label: str, scale: float) -> tuple[float, str]:
    """By what a parameter is multiplied, and the unit that people read."""
    if label.startswith("bias"):
        return 1.0, unit_name(block.raw_unit)
    if label.startswith("soft iron"):
        return 100.0 / scale, "%"
    if label == "rotation":
        return float(np.degrees(1.0)), "deg"
    factor = magnetic_field_factor(block.raw_unit)
    if block.unit == "T" and factor is not None:
        return factor, ""
    if block.unit == "T":
        return 1.0 / MICRO, f"{unit_name(block.raw_unit)}/µT"
    return 1.0, f"{unit_name(block.raw_unit)}/local field"


def unit_name(unit: str) -> str:
    """Return a unit as people write it.

    Examples
    --------
    >>> unit_name("uT")
    'µT'
    """
    return {"uT": "µT", "ugauss": "µgauss"}.get(unit, unit)


def magnetometer_sentences(block: MagnetometerBlock | None, *, every: bool = False) -> list[str]:
    """Return the verdict and the field in sentences; empty without a magnetometer.

    Parameters
    ----------
    block : of the calibration.
    every : all reasons and remarks, instead of the first reason.
    """
    if block is None or block.verdict is None:
        return []
    reasons = block.verdict.reasons
    first = f"Magnetometer: {block.verdict.use}. {' '.join(reasons if every else reasons[:1])}".strip()
    said = [first]
    if block.field is not None:
        said.append(f"Magnetic field: {field_words(block)}.")
    if every:
        said += [*block.remarks, *(block.quality.left_out if block.quality else [])]
    return said + [f"Not determined: {sentence}" for sentence in (block.not_determined if every else [])]


def field_words(block: MagnetometerBlock) -> str:
    """Return norm and dip with their uncertainties.

    Parameters
    ----------
    block : with a field.
    """
    field = block.field
    assert field is not None
    if block.unit == "T":
        sigma = field.norm_standard_uncertainty
        number = with_uncertainty(MICRO * field.norm, MICRO * sigma) if sigma else f"{MICRO * field.norm:.5g}"
        # What was given is one source: what the recording makes of it is as uncertain as it is stated.
        words = f"norm {number} µT ({'from the recording and ' if field.norm_given else ''}{field.source})"
    else:
        words = "norm not known (one local field)"
    if field.dip_deg is not None and field.dip_standard_uncertainty_deg is not None:
        words += f", dip {with_uncertainty(field.dip_deg, field.dip_standard_uncertainty_deg)}°"
    return words


# More points than these tell an eye nothing more.
MOST_POINTS = 1500


def magnetometer(told: Magnetometer, subject: Subject) -> list[Block]:
    """Return the section of the magnetometer: verdict, parameters, figures.

    Parameters
    ----------
    told : what the estimate rests on.
    subject : with the recording.
    """
    block = subject.calibration.magnetometer
    if block is None:
        return []
    return section("Magnetometer", *magnetometer_blocks(told, block, _samples(subject)))


def _samples(subject: Subject) -> Vectors:
    field = subject.recording.magnetic_field
    return np.zeros((0, 3)) if field is None else field.values


def magnetometer_blocks(told: Magnetometer, block: MagnetometerBlock, samples: Vectors) -> list[Block]:
    """Return what a report says of a magnetometer, without a heading.

    Parameters
    ----------
    told, block : what was found, and as the document has it.
    samples : (samples, 3) raw.
    """
    verdict = block.verdict
    blocks: list[Block] = []
    if verdict is not None:
        use = "FIT" if verdict.use == "fit" else verdict.use.upper()
        blocks += [Sentences([f"The magnetometer's calibration is {use}."], "paragraphs")]
        blocks += [Sentences(verdict.reasons)]
    table = magnetometer_table(block)
    if table is not None:
        blocks.append(table)
    if block.field is not None:
        blocks.append(Sentences([f"The field of the place: {field_words(block)}."], "paragraphs"))
    blocks += [Figures(*drawn) for drawn in (_sphere(told, samples), _holds(told)) if drawn is not None]
    more = [*block.remarks, *(block.quality.left_out if block.quality else []), *block.not_determined]
    return blocks + ([Sentences(more)] if more else [])


def _sphere(told: Magnetometer, samples: Vectors) -> tuple[list[Figure], str] | None:
    """Raw samples and corrected ones, seen along each axis, as shares of the norm."""
    if told.triad is None or not len(samples):
        return None
    chosen = samples[:: max(1, len(samples) // MOST_POINTS)]
    true = told.triad.correct(chosen) / told.norm
    # Raw numbers by the mean scale alone, so that both have one measure.
    size = float(np.cbrt(np.linalg.det(told.triad.matrix))) * told.norm
    raw = chosen / size
    data: list[Plot] = []
    layout: Plot = {}
    for at, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
        end = "" if at == 0 else str(at + 1)
        axes: Plot = {"xaxis": f"x{end}", "yaxis": f"y{end}"}
        for name, points, colour in (("raw", raw, GREY), ("corrected", true, BLUE)):
            marker: Plot = {"size": 3, "color": colour}
            look: Plot = {"name": name, "legendgroup": name, "showlegend": at == 0, "hoverinfo": "skip"}
            data.append(scatter(points[:, i], points[:, j], marker=marker, **look, **axes))
        data.append(_circle(axes, first=at == 0))
        low = at / 3.0 + (0.03 if at else 0.0)
        layout[f"xaxis{end}"] = text_axis("xyz"[i], domain=[low, (at + 1) / 3.0 - 0.02], zeroline=True)
        layout[f"yaxis{end}"] = text_axis("xyz"[j], anchor=f"x{end}", scaleanchor=f"x{end}", zeroline=True)
    caption = (
        "All samples before correction (grey, divided by the mean scale factor) and after it (blue), in units of the "
        "field's norm, seen along z, y and x. After correction they lie within the circle of radius one, the outline "
        f"of the sphere. The norm of all samples scatters by {100 * told.before:.2g} % before and "
        f"{100 * told.after:.2g} % after."
    )
    label = "Samples of the magnetometer before and after correction"
    figure = Figure("magnetometer-sphere", label, data, base_layout(340, **layout), least_width=720)
    return [figure], caption


def _circle(axes: Plot, *, first: bool) -> Plot:
    angle = np.linspace(0.0, 2.0 * np.pi, 91)
    return scatter(
        np.cos(angle),
        np.sin(angle),
        "lines",
        name="radius one",
        legendgroup="circle",
        showlegend=first,
        line={"color": RED, "width": 1},
        hoverinfo="skip",
        **axes,
    )


def _holds(told: Magnetometer) -> tuple[list[Figure], str] | None:
    """Norm and dip of the corrected field in each hold."""
    if not told.holds:
        return None
    number = [hold.hold + 1 for hold in told.holds]
    colours = [RED if hold.left_out else BLUE for hold in told.holds]
    factor, unit = (MICRO, "µT") if told.field_unit == "T" else (1.0, "local field")
    norms: Series = factor * np.array([hold.norm for hold in told.holds])
    dips: Series = np.degrees(np.array([hold.dip for hold in told.holds]))
    marker: Plot = {"size": 7, "color": colours}
    data = [
        scatter(
            number,
            norms,
            name="norm",
            marker=marker,
            showlegend=False,
            hovertemplate=f"hold %{{x}}: %{{y:.4g}} {unit}<extra></extra>",
        ),
        scatter(
            number,
            dips,
            name="dip",
            marker=marker,
            showlegend=False,
            yaxis="y2",
            hovertemplate="hold %{x}: %{y:.2f}°<extra></extra>",
        ),
        _level(number, factor * told.norm, "y"),
        _level(number, float(np.degrees(told.dip)), "y2"),
    ]
    axes: Plot = {
        "xaxis": text_axis("hold", anchor="y2"),
        "yaxis": text_axis(f"norm / {unit}", domain=[0.55, 1.0]),
        "yaxis2": text_axis("dip / deg", domain=[0.0, 0.45]),
    }
    caption = (
        "The corrected field in each hold: norm and dip should be the same in all of them (lines). What differs from "
        f"hold to hold beyond noise is {100 * told.scatter:.2g} % of the norm, one sigma; holds in red take no part."
    )
    label = "Norm and dip of the corrected field in each hold"
    return [Figure("magnetometer-holds", label, data, base_layout(380, **axes))], caption


def _level(number: list[int], at: float, axis: str) -> Plot:
    line: Plot = {"color": GREY, "width": 1, "dash": "dash"}
    look: Plot = {"line": line, "showlegend": False, "hoverinfo": "skip", "yaxis": axis}
    return scatter([number[0], number[-1]], plain([at, at]), "lines", **look)
