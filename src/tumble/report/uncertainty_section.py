"""Where the uncertainties come from, what they do not contain, and which errors would go unnoticed."""

from __future__ import annotations

import html
import math
from typing import TYPE_CHECKING

import numpy as np

from tumble.calibration.verdict import two_digits
from tumble.report.figure import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    RED,
    TEAL,
    Figure,
    Plot,
    Section,
    base_layout,
    plain,
)

if TYPE_CHECKING:
    from tumble.calibration.estimate import Estimate
    from tumble.calibration.uncertainty_statement import (
        Detectable,
        GlobalTest,
        ModelChoice,
        UncertaintyStatement,
    )
    from tumble.report.parameters import ParameterRow

# Shares of the variance below a hundredth of a per cent are not worth a number.
_NOTHING = 1e-2
_COLOURS = (BLUE, TEAL, GREEN, ORANGE, RED, PURPLE, GREY)
# Of each kind of observation so many are shown, the most harmful first.
SHOWN = 5
_KINDS = {
    "force": ("specific force in hold", 1e3, "mm/s²"),
    "rate": ("gyros in hold", 180.0 / math.pi, "°/s"),
    "turn": ("turn after hold", 180.0 / math.pi, "°"),
    "angle": ("table's angle after hold", 180.0 / math.pi, "°"),
}


def budget_table(estimate: Estimate, rows: list[ParameterRow]) -> str:
    """Return where each parameter's uncertainty comes from, as an HTML table; nothing without a budget.

    Parameters
    ----------
    estimate : with the budget, in the order of its parameters.
    rows : the same parameters for readers.
    """
    if not estimate.budget:
        return ""
    told = estimate.statement
    expanded = () if told is None else ("expanded, 95 %", "k", "degrees of freedom")
    heads = ("parameter", "standard uncertainty", *expanded, *estimate.budget)
    lines: list[str] = []
    for k, row in enumerate(rows[: len(estimate.parameters)]):
        whole = estimate.parameters[k].standard_uncertainty
        factor = row.shown.sigma / whole if whole > 0.0 else 0.0
        parts = [float(part[k]) for part in estimate.budget.values()]
        cells = [two_digits(part * factor) if part > _NOTHING * whole else "–" for part in parts]
        if told is not None:
            cells = [*_expanded(told, k, row), *cells]
        lines.append(
            f"<tr><td>{html.escape(f'{row.group}: {row.label}')}</td>"
            f"<td>{two_digits(row.shown.sigma)} {html.escape(row.shown.unit)}</td>"
            + "".join(f"<td>{html.escape(cell)}</td>" for cell in cells)
            + "</tr>"
        )
    besides = (
        "" if told is not None else ", with that of gravity and of a rotation that was not determined besides"
    )
    return (
        "<h2>Where the uncertainties come from</h2>\n<p>What each source adds to a parameter's standard uncertainty, "
        f"in that parameter's unit; the squares add up{besides}. A dash is less than a hundredth of the whole."
        f"{_about_expanded(told)}</p>"
        + _table(heads, lines)
        + ("" if told is None else _statement(told, estimate, rows))
    )


def budget_section(estimate: Estimate, rows: list[ParameterRow]) -> Section | None:
    """Return the figure of each source's share of the variances, or None without a budget.

    Parameters
    ----------
    estimate : with the budget.
    rows : its parameters for readers.
    """
    if not estimate.budget:
        return None
    shown = rows[: len(estimate.parameters)]
    squares = {name: part**2 for name, part in estimate.budget.items()}
    whole = sum(squares.values(), np.zeros(len(shown)))
    data: list[Plot] = []
    for at, (name, square) in enumerate(squares.items()):
        share = 100.0 * np.divide(square, whole, out=np.zeros(len(shown)), where=whole > 0.0)
        data.append(
            {
                "type": "bar",
                "orientation": "h",
                "name": html.escape(name, quote=False),
                "x": plain(share, 4),
                "y": [html.escape(row.short, quote=False) for row in shown],
                "marker": {
                    "color": _COLOURS[at % len(_COLOURS)],
                    "opacity": 1.0 if at < len(_COLOURS) else 0.55,
                },
                "hovertemplate": "%{y}: %{x:.1f} %<extra>%{fullData.name}</extra>",
            }
        )
    layout = base_layout(
        120 + 20 * len(shown),
        barmode="stack",
        xaxis={"title": {"text": "share of the variance / %"}, "range": [0, 100]},
        yaxis={"autorange": "reversed", "automargin": True, "type": "category"},
    )
    layout["legend"]["traceorder"] = "normal"
    caption = (
        "Each bar is one parameter's variance, split by what causes it. What fills a bar is what to improve: noise at "
        "rest asks for longer holds, noise while turning for slower or fewer turns, wander for more holds in less "
        "time, reference gravity for a better value."
    )
    figure = Figure("budget", "Share of each source in the variance of each parameter", data, layout)
    return Section("Where the uncertainties come from, in shares", [figure], caption)


def reliability_table(estimate: Estimate, rows: list[ParameterRow]) -> str:
    """Return which errors would go unnoticed, and what they would do, as HTML; nothing where it is not known.

    Parameters
    ----------
    estimate : with its statement of uncertainty.
    rows : its parameters for readers.
    """
    told = estimate.statement
    if told is None or not told.detectable:
        return ""
    lines: list[str] = []
    for kind in _KINDS:
        worst = sorted((d for d in told.detectable if d.kind == kind), key=lambda d: -d.effect)
        lines += [_detectable_row(found, rows) for found in worst[:SHOWN]]
    heads = (
        "observation",
        "checked by the others",
        "unnoticed up to",
        "moves",
        "by, in its standard uncertainty",
    )
    return (
        "<h2>Errors that would go unnoticed</h2>\n<p>For each observation the largest error that its test would still "
        f"miss (false alarm {told.alpha:g}, found with {100.0 * told.power:.0f} %), in the direction that does most "
        f"harm, and what it would do. Of each kind the {SHOWN} most harmful are shown. An observation that is checked "
        "by 0 of its numbers stands alone: nothing would tell a blunder in it.</p>"
        f"{_list(reliability_sentences(told, rows))}" + _table(heads, lines)
    )


def reliability_sentences(told: UncertaintyStatement, rows: list[ParameterRow], most: int = 3) -> list[str]:
    """Return the most harmful errors that would go unnoticed, as sentences.

    Parameters
    ----------
    told : the statement.
    rows : the parameters for readers.
    most : sentences at most.
    """
    said: list[str] = []
    for found in sorted(told.detectable, key=lambda d: -d.effect)[:most]:
        words, factor, unit = _KINDS[found.kind]
        unit = unit if unit == "°" else f" {unit}"
        parameter = f"{rows[found.parameter].group}: {rows[found.parameter].label}"
        if not math.isfinite(found.effect):
            said.append(
                f"An error of any size of the {words} {found.index + 1} would go unnoticed ({parameter})."
            )
            continue
        said.append(
            f"An error of {two_digits(factor * found.size)}{unit} of the {words} {found.index + 1} would go "
            f"unnoticed, and would move {parameter} by {two_digits(found.effect)} of its standard uncertainties."
        )
    return said


def global_test_words(test: GlobalTest) -> list[str]:
    """Return what the square sum of all residuals says.

    Parameters
    ----------
    test : against chi-square.
    """
    alone = (
        "The noise seen at rest explains all residuals"
        if test.alone > 0.05
        else "The noise seen at rest alone does not explain the residuals"
    )
    said = [f"{alone} (global test, both sides: p {_probability(test.alone)})."]
    if test.components:
        said.append(
            f"With {test.components} variance component{'s' if test.components > 1 else ''} found in them the square "
            f"sum is {test.statistic:.0f} with {test.degrees} degrees of freedom (p {_probability(test.probability)})"
            + (
                ": they fit, which after such an estimate they nearly have to."
                if test.probability > 0.01
                else ": something is still not described, and all uncertainties were enlarged by it if it is too much."
            )
        )
    return said


def model_choice_words(choice: ModelChoice, sigmas: np.ndarray, rows: list[ParameterRow]) -> str:
    """Return what the other model would change, in a sentence.

    Parameters
    ----------
    choice : a term near its limit.
    sigmas : (parameters,) standard uncertainties, in the units of the estimate's own parameters.
    rows : parameters for readers.
    """
    size = np.abs(choice.change) / np.where(sigmas > 0.0, sigmas, np.inf)
    worst = int(np.nanargmax(size))
    row = rows[worst]
    return (
        f"Model choice, not included: the term {choice.name.replace('_', '-')} was "
        f"{'kept' if choice.kept else 'left out'} near its limit (p {_probability(choice.probability)}, limit "
        f"{choice.limit:g}). {'Without' if choice.kept else 'With'} it {row.group}: {row.label} would move by "
        f"{two_digits(float(size[worst]))} of its standard uncertainties, the most of all."
    )


def _statement(told: UncertaintyStatement, estimate: Estimate, rows: list[ParameterRow]) -> str:
    sigmas = np.array([p.standard_uncertainty for p in estimate.parameters])
    said = [] if told.test is None else global_test_words(told.test)
    said += [model_choice_words(choice, sigmas, rows) for choice in told.model_choice]
    return _list([*said, *told.not_included])


def _about_expanded(told: UncertaintyStatement | None) -> str:
    if told is None:
        return ""
    known = {name: nu for name, nu in told.source_degrees.items() if math.isfinite(nu)}
    each = ", ".join(f"{html.escape(name)} {nu:.0f}" for name, nu in known.items())
    return (
        " The expanded uncertainty is k times the standard uncertainty, k Student's factor for the effective degrees "
        f"of freedom after Welch and Satterthwaite; the sources' own are: {each}, and of the others infinitely many."
    )


def _expanded(told: UncertaintyStatement, k: int, row: ParameterRow) -> list[str]:
    degrees, factor = float(told.effective_degrees[k]), float(told.coverage_factors[k])
    many = "∞" if degrees > 1e4 else f"{math.floor(degrees)}"
    return [two_digits(factor * row.shown.sigma), f"{factor:.2f}", many]


def _detectable_row(found: Detectable, rows: list[ParameterRow]) -> str:
    words, factor, unit = _KINDS[found.kind]
    size = f"{two_digits(factor * found.size)} {unit}" if math.isfinite(found.size) else "any"
    effect = two_digits(found.effect) if math.isfinite(found.effect) else "any"
    row = rows[found.parameter]
    cells = (
        f"{words} {found.index + 1}",
        f"{found.redundancy:.2f} of {found.count}",
        size,
        f"{row.group}: {row.label}",
        effect,
    )
    return "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in cells) + "</tr>"


def _probability(p: float) -> str:
    return "< 0.0001" if p < 1e-4 else f"= {p:.2g}"


def _table(heads: tuple[str, ...], lines: list[str]) -> str:
    head = "".join(f"<th>{html.escape(name)}</th>" for name in heads)
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{"".join(lines)}</tbody></table></div>'


def _list(sentences: list[str]) -> str:
    return f"<ul>{''.join(f'<li>{html.escape(s)}</li>' for s in sentences)}</ul>" if sentences else ""
