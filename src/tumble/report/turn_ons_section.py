"""Several recordings of one unit in the report: biases from turn-on to turn-on, and whether the rest is stable."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

from tumble.report.figure import AXIS_COLOURS, GREY, Figure, Plot, Section, base_layout, plain
from tumble.report.parameters import OPTIONAL, Measure, ParameterRow, parameter_rows
from tumble.report.rounding import fixed, with_uncertainty

if TYPE_CHECKING:
    from rich.table import Table

    from tumble.document.result import Calibration
    from tumble.document.turn_ons_block import BiasBlock, StableBlock, TurnOnsBlock

# More recordings than this do not stand beside each other in a terminal.
MOST_COLUMNS = 4
NEXT = "for the next turn-on"


def turn_ons_table(calibration: Calibration) -> str:
    """Return the recordings, their biases and the test of what is stable as HTML; nothing of a single recording.

    Parameters
    ----------
    calibration : the document.
    """
    told = calibration.turn_ons
    if told is None:
        return ""
    rows = {row.name: row for row in parameter_rows(calibration)}
    return (
        "<h2>From turn-on to turn-on</h2>\n<p>Each recording is the unit switched on anew. Biases are each one's own; "
        "all else is common.</p>"
        + _table(["recording", "holds", "turns", "spins", "rate", "sigma0"], _recordings(told))
        + "<p>± is one standard uncertainty. The scatter is the standard deviation between recordings, with its own; "
        "what the recordings' uncertainties explain of it stands beside. For the next turn-on there is their mean, as "
        "uncertain as the scatter makes it.</p>"
        + _table(
            ["bias", NEXT, "scatter", "explained", *(r.name for r in told.recordings)],
            [_bias_cells(bias, rows[bias.parameter]) for bias in told.biases],
        )
        + "<p>What should be stable, as each recording tells it by itself. Chance makes differences as large with the "
        "probability given.</p>"
        + _table(
            ["parameter", "chi-square", "probability", *(r.name for r in told.recordings)],
            [_stable_cells(one, rows[one.parameter]) for one in told.stable],
        )
    )


def turn_ons_section(calibration: Calibration) -> Section | None:
    """Return figures of the biases by recording, about their mean; None of a single recording.

    Parameters
    ----------
    calibration : the document.
    """
    told = calibration.turn_ons
    if told is None or not told.biases:
        return None
    rows = {row.name: row for row in parameter_rows(calibration)}
    figures = [
        _figure(told, [b for b in told.biases if b.parameter.startswith(kind)], rows, kind)
        for kind in ("accelerometer", "gyro")
        if any(b.parameter.startswith(kind) for b in told.biases)
    ]
    return Section(
        "Biases by turn-on",
        figures,
        "Each recording's bias less the mean of all, with its 95 % interval; the band is where the bias of the next "
        "turn-on is expected (95 %) of the axis that scatters most.",
    )


def bias_table(calibration: Calibration, *, width: int) -> Table | None:
    """Return the biases by recording as a table for a terminal; None of a single recording, or of too many.

    Parameters
    ----------
    calibration : the document.
    width : characters of the terminal.
    """
    from rich import box
    from rich.table import Table

    told = calibration.turn_ons
    if told is None or len(told.recordings) > MOST_COLUMNS or width < 30 + 24 * len(told.recordings):
        return None
    rows = {row.name: row for row in parameter_rows(calibration)}
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False, highlight=False)
    for heading in ("bias", NEXT, *(r.name for r in told.recordings)):
        table.add_column(heading.replace("[", r"\["), overflow="fold")
    for bias in told.biases:
        name, following, _, _, *each = _bias_cells(bias, rows[bias.parameter])
        table.add_row(name, following, *each)
    return table


def _recordings(told: TurnOnsBlock) -> list[list[str]]:
    return [
        [
            r.name,
            str(r.holds),
            str(r.turns),
            str(r.spins),
            f"{r.rate_hz:g} Hz",
            "" if r.sigma0 is None else fixed(r.sigma0, 2),
        ]
        for r in told.recordings
    ]


def _bias_cells(bias: BiasBlock, row: ParameterRow) -> list[str]:
    """Cells in the unit that readers compare, one for all recordings."""
    factor, unit = _practical(row)
    each = [
        "" if value is None or sigma is None else with_uncertainty(factor * value, factor * sigma)
        for value, sigma in zip(bias.values, bias.standard_uncertainties, strict=True)
    ]
    scatter = with_uncertainty(factor * bias.scatter, factor * bias.scatter_standard_uncertainty)
    following = with_uncertainty(factor * bias.mean, factor * bias.next_standard_uncertainty)
    return [
        f"{row.group.lower()} {bias.parameter[-1]} / {unit}",
        following,
        scatter,
        f"{factor * bias.expected_scatter:.2g}",
        *each,
    ]


def _practical(row: ParameterRow) -> tuple[float, str]:
    """The factor from the raw unit to the one that readers compare, and that unit."""
    shown: Measure = row.shown if row.other is None or row.other.value != row.other.value else row.other
    return shown.sigma / row.shown.sigma, shown.unit


def _stable_cells(one: StableBlock, row: ParameterRow) -> list[str]:
    factor = row.shown.value / one.value if one.value else 1.0
    each = [
        "" if value is None or sigma is None else with_uncertainty(factor * value, abs(factor) * sigma)
        for value, sigma in zip(one.values, one.standard_uncertainties, strict=True)
    ]
    words = "" if one.agrees else f": not stable, uncertainty × {fixed(one.enlarged_by, 1)}"
    if one.degrees_of_freedom < 1:
        words = ": told by one recording only"
    unit = f" / {row.shown.unit}" if row.shown.unit else ""
    return [
        f"{row.label if row.group == OPTIONAL else f'{row.group.lower()} {row.label}'}{unit}",
        f"{one.chi_square:.1f} of {one.degrees_of_freedom}",
        f"{one.probability:.2g}{words}",
        *each,
    ]


def _figure(told: TurnOnsBlock, biases: list[BiasBlock], rows: dict[str, ParameterRow], kind: str) -> Figure:
    names = [r.name for r in told.recordings]
    data: list[Plot] = []
    widest, unit = 0.0, ""
    for number, bias in enumerate(biases):
        factor, unit = _practical(rows[bias.parameter])
        at = [k for k, value in enumerate(bias.values) if value is not None]
        values = [factor * ((bias.values[k] or 0.0) - bias.mean) for k in at]
        sigmas = [1.96 * factor * (bias.standard_uncertainties[k] or 0.0) for k in at]
        axis = bias.parameter[-1]
        widest = max(widest, bias.coverage_factor * factor * bias.next_standard_uncertainty)
        data.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": axis,
                "x": [k + 1 + 0.12 * (number - 1) for k in at],
                "y": plain(values, 6),
                "error_y": {"type": "data", "array": plain(sigmas), "thickness": 1.5, "width": 4},
                "marker": {"size": 8, "color": AXIS_COLOURS[axis]},
                "text": [names[k] for k in at],
                "hovertemplate": f"{axis}, %{{text}}: %{{y:.4g}} {unit}<extra></extra>",
            }
        )
    band: Plot = {
        "type": "rect",
        "xref": "paper",
        "x0": 0,
        "x1": 1,
        "y0": -widest,
        "y1": widest,
        "fillcolor": GREY,
        "opacity": 0.12,
        "line": {"width": 0},
        "layer": "below",
    }
    layout = base_layout(
        300,
        margin={"l": 64, "r": 12, "t": 52, "b": 48},
        title={"text": f"{kind} bias less its mean / {unit}", "font": {"size": 12}, "x": 0.02, "y": 0.98},
        xaxis={
            "tickvals": [k + 1 for k in range(len(names))],
            "range": [0.5, len(names) + 0.5],
            "zeroline": False,
            "title": {"text": "recording, in the table's order", "font": {"size": 12}},
        },
        yaxis={"zeroline": True},
        shapes=[band],
    )
    return Figure(
        f"turn-ons-{kind}", f"{kind} biases of {len(names)} recordings about their mean", data, layout
    )


def _table(heads: list[str], rows: list[list[str]]) -> str:
    head = "".join(f"<th>{html.escape(one)}</th>" for one in heads)
    body = "".join(
        f"<tr>{''.join(_cell(cell, number) for number, cell in enumerate(row))}</tr>" for row in rows
    )
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def _cell(text: str, number: int) -> str:
    """The first cell is a name, the others are numbers with a typographic minus."""
    escaped = html.escape(text)
    return f"<td>{escaped.replace('-', '−') if number else escaped}</td>"


__all__ = ["bias_table", "turn_ons_section", "turn_ons_table"]
