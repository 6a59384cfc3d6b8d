"""The magnetometer in a report: its sphere before and after, and the field's norm and dip in each hold.

A magnetometer's calibration in a few lines: its parameters with uncertainties, its verdict.
"""

from __future__ import annotations

from itertools import groupby

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.calibration import Magnetometer
from tumble.document import MagnetometerBlock
from tumble.parameters import with_uncertainty
from tumble.report.figures.record import BLUE, GREY, RED, Axis, Curve, Figure, Look, Mark, Points, plain
from tumble.report.page import Block, Figures, Sentences, Table, section
from tumble.report.parameters import rows_of
from tumble.report.subject import Subject

MICRO = 1e6


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
    rows: list[list[str]] = []
    for kind, members in groupby(rows_of(block.parameters), key=lambda row: row.kind):
        own = list(members)
        # Heads name x, y and z; a pair of axes names itself.
        texts = [
            row.shown.number if len(axes := row.parameter.axes) == 1 else f"{axes} {row.shown.number}"
            for row in own
        ]
        if len(own) == 3:
            rows.append(["bias (hard iron)" if kind == "bias" else kind, *texts, own[0].shown.unit])
    return rows


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
# What is seen along z, y and x: the axes to the right and up.
_PLANES = ((0, 1), (0, 2), (1, 2))


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
    circle = np.linspace(0.0, 2.0 * np.pi, 91)
    marks: list[Mark] = []
    for panel, (i, j) in enumerate(_PLANES):
        for name, points, colour in (("raw", raw, GREY), ("corrected", true, BLUE)):
            look: Look = {"panel": panel, "legend": panel == 0, "group": name, "hover": "", "size": 3}
            marks.append(Points(points[:, i], points[:, j], name, colour, **look))
        look = {"panel": panel, "legend": panel == 0, "group": "circle", "hover": "", "width": 1}
        marks.append(Curve(np.cos(circle), np.sin(circle), "radius one", RED, **look))
    shares = [(k / 3.0 + (0.03 if k else 0.0), (k + 1) / 3.0 - 0.02) for k in range(3)]
    across = [Axis("xyz"[i], share=share) for (i, _), share in zip(_PLANES, shares, strict=True)]
    caption = (
        "All samples before correction (grey, divided by the mean scale factor) and after it (blue), in units of the "
        "field's norm, seen along z, y and x. After correction they lie within the circle of radius one, the outline "
        f"of the sphere. The norm of all samples scatters by {100 * told.before:.2g} % before and "
        f"{100 * told.after:.2g} % after."
    )
    label = "Samples of the magnetometer before and after correction"
    upright = [Axis("xyz"[j]) for _, j in _PLANES]
    drawn = Figure("magnetometer-sphere", label, marks, across, upright, 340, square=True, least_width=720)
    return [drawn], caption


def _holds(told: Magnetometer) -> tuple[list[Figure], str] | None:
    """Norm and dip of the corrected field in each hold."""
    if not told.holds:
        return None
    number = [hold.hold + 1 for hold in told.holds]
    colours = [RED if hold.left_out else BLUE for hold in told.holds]
    factor, unit = (MICRO, "µT") if told.field_unit == "T" else (1.0, "local field")
    norms: Series = factor * np.array([hold.norm for hold in told.holds])
    dips: Series = np.degrees(np.array([hold.dip for hold in told.holds]))
    ends = [number[0], number[-1]]
    level: Look = {"legend": False, "hover": "", "width": 1, "dash": "dash"}
    dip = float(np.degrees(told.dip))
    hovers = f"hold %{{x}}: %{{y:.4g}} {unit}<extra></extra>", "hold %{x}: %{y:.2f}°<extra></extra>"
    marks = [
        Points(number, norms, "norm", colours, legend=False, hover=hovers[0]),
        Points(number, dips, "dip", colours, panel=1, legend=False, hover=hovers[1]),
        Curve(ends, plain([factor * told.norm] * 2), colour=GREY, **level),
        Curve(ends, plain([dip] * 2), colour=GREY, panel=1, **level),
    ]
    panels = [Axis(f"norm / {unit}", share=(0.55, 1.0)), Axis("dip / °", share=(0.0, 0.45))]
    caption = (
        "The corrected field in each hold: norm and dip should be the same in all of them (lines). What differs from "
        f"hold to hold beyond noise is {100 * told.scatter:.2g} % of the norm, one sigma; holds in red take no part."
    )
    label = "Norm and dip of the corrected field in each hold"
    return [Figure("magnetometer-holds", label, marks, Axis("hold"), panels, 380)], caption
