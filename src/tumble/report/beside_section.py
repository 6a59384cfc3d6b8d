"""The joint estimate and the procedure's own, side by side: values, uncertainties, what became smaller."""

from __future__ import annotations

import html
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tumble.report.figure import BLUE, GREY, Figure, Plot, Section, base_layout, plain
from tumble.report.rounding import fixed, with_uncertainty

if TYPE_CHECKING:
    from tumble.calibration.estimate import Estimate
    from tumble.report.parameters import ParameterRow

# Differences beyond so many of the procedure's standard uncertainties are worth a sentence.
FAR = 3.0


@dataclass(frozen=True, slots=True)
class Beside:
    """One parameter as both ways have it, in the joint one's unit for readers.

    Attributes
    ----------
    row : of the joint estimate.
    value, sigma : the procedure's own.
    difference : joint minus the procedure's, in standard uncertainties of the procedure's.
    ratio : the joint standard uncertainty over the procedure's.
    """

    row: ParameterRow
    value: float
    sigma: float
    difference: float
    ratio: float


def parameters_beside(estimate: Estimate, rows: list[ParameterRow]) -> list[Beside]:
    """Return the parameters that both ways have with an uncertainty; none where nothing stands beside.

    Parameters
    ----------
    estimate : the joint one, with the procedure's own in `beside`.
    rows : the joint parameters for readers.
    """
    if estimate.beside is None:
        return []
    others = {p.name: p for p in estimate.beside.parameters}
    found: list[Beside] = []
    for own, row in zip(estimate.parameters, rows, strict=False):
        other = others.get(own.name)
        if other is None or not (own.standard_uncertainty > 0.0 and other.standard_uncertainty > 0.0):
            continue
        factor = row.shown.sigma / own.standard_uncertainty
        found.append(
            Beside(
                row,
                factor * other.value,
                factor * other.standard_uncertainty,
                (own.value - other.value) / other.standard_uncertainty,
                own.standard_uncertainty / other.standard_uncertainty,
            )
        )
    return found


def beside_table(estimate: Estimate, rows: list[ParameterRow]) -> str:
    """Return both ways as an HTML table; nothing where nothing stands beside.

    Parameters
    ----------
    estimate, rows : as for `parameters_beside`.
    """
    found = parameters_beside(estimate, rows)
    if not found or estimate.beside is None:
        return ""
    name = html.escape(estimate.beside.procedure)
    heads = (
        "parameter",
        "joint",
        name,
        "difference / uncertainty",
        "ratio",
    )
    lines = "".join(
        f"<tr><td>{html.escape(one.row.group)}: {html.escape(one.row.label)}</td><td>{_number(one.row.shown.text)}</td>"
        f"<td>{_number(f'{with_uncertainty(one.value, one.sigma)} {one.row.shown.unit}'.rstrip())}</td>"
        f"<td>{_number(_signed(one.difference))}</td><td>{fixed(one.ratio, 2)}</td></tr>"
        for one in found
    )
    return (
        f"<h2>The procedure's own estimate beside</h2>\n<p>{_words(found, name)}</p>"
        f'<div class="scroll"><table><thead><tr>{"".join(f"<th>{head}</th>" for head in heads)}</tr></thead>'
        f"<tbody>{lines}</tbody></table></div>"
    )


def _words(found: list[Beside], name: str) -> str:
    far = [one for one in found if abs(one.difference) > FAR]
    typical = math.exp(sum(math.log(one.ratio) for one in found) / len(found))
    told = (
        f"Both are made from the same recording: {name} as its paper or page has it, the joint estimate from every "
        f"sample at once. Joint standard uncertainties are {fixed(typical, 2)} times {name}'s in the (geometric) mean. "
        f"± is one standard uncertainty; differences are in those of {name}: where the model is right, below about "
        "two. The last column is the joint uncertainty over the other."
    )
    if not far:
        return told
    named = ", ".join(f"{html.escape(one.row.group.lower())} {html.escape(one.row.label)}" for one in far[:3])
    more = f" and {len(far) - 3} more" if len(far) > 3 else ""
    return f"{told} Farther apart are {named}{more}: what only one of them models has moved them."


def beside_section(estimate: Estimate, rows: list[ParameterRow]) -> Section | None:
    """Return a figure of how the uncertainties shrank; None where nothing stands beside.

    Parameters
    ----------
    estimate, rows : as for `parameters_beside`.
    """
    found = parameters_beside(estimate, rows)
    if not found or estimate.beside is None:
        return None
    name = estimate.beside.procedure
    labels = [one.row.short for one in found]
    data: list[Plot] = [
        {
            "type": "bar",
            "orientation": "h",
            "x": plain([one.ratio for one in found], 3),
            "y": labels,
            "marker": {"color": [BLUE if one.ratio <= 1.0 else GREY for one in found]},
            "text": [fixed(one.ratio, 2) for one in found],
            "textposition": "outside",
            "cliponaxis": False,
            "hovertemplate": "%{y}: %{x} of its uncertainty<extra></extra>",
        }
    ]
    largest = max(1.0, *(one.ratio for one in found))
    layout = base_layout(
        70 + 20 * len(found),
        margin={"l": 120, "r": 40, "t": 10, "b": 44},
        bargap=0.35,
        showlegend=False,
        xaxis={
            "title": {"text": f"joint standard uncertainty / that of {name}", "font": {"size": 12}},
            "range": [0.0, 1.12 * largest],
            "zeroline": True,
        },
        yaxis={"autorange": "reversed", "tickfont": {"size": 11}, "automargin": True},
        shapes=[
            {
                "type": "line",
                "x0": 1.0,
                "x1": 1.0,
                "yref": "paper",
                "y0": 0.0,
                "y1": 1.0,
                "line": {"color": GREY, "width": 1, "dash": "dash"},
            }
        ],
    )
    figure = Figure(
        "beside",
        f"Joint standard uncertainty over that of {name}, {len(found)} parameters",
        data,
        layout,
        most_width=720,
    )
    return Section(
        "What the joint estimate gains",
        [figure],
        f"Bars that end left of the dashed line are parameters that the joint estimate knows better than {name}; one "
        "that ends right of it (grey) has an uncertainty of which that procedure does not know.",
    )


def _signed(value: float) -> str:
    text = fixed(value, 1)
    return text if text.startswith("-") or text == "0.0" else f"+{text}"


def _number(value: str) -> str:
    return html.escape(value).replace("-", "−")
