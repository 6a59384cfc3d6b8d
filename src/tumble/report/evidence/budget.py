"""Where the uncertainties come from, what would go unnoticed, and a paper's own estimator beside the joint one."""

from __future__ import annotations

import math

import numpy as np

from tumble.calibration import (
    Beside,
    Budget,
    Detectable,
    Estimate,
    GlobalTest,
    ModelChoice,
    UncertaintyStatement,
)
from tumble.parameters import Measure, fixed, spaced, two_digits
from tumble.records import dataclass
from tumble.report.figures.record import PALETTE, Axis, Bars, Figure, Mark, plain
from tumble.report.page import Block, Figures, Sentences, Table, section
from tumble.report.parameters import ParameterRow
from tumble.report.subject import Subject

# Shares of the variance below a hundredth of a per cent are not worth a number.
_NOTHING = 1e-2
# Of each kind of observation so many are shown, the most harmful first.
SHOWN = 5
_KINDS = {
    "force": ("specific force in hold", 1e3, "mm/s²"),
    "rate": ("gyros in hold", 180.0 / math.pi, "°/s"),
    "turn": ("turn after hold", 180.0 / math.pi, "°"),
    "angle": ("table's angle after hold", 180.0 / math.pi, "°"),
}
_SHARES = (
    "Each bar is one parameter's variance, split by what causes it. What fills a bar is what to "
    "improve. Noise at rest asks for longer holds, noise while turning for slower or fewer turns. "
    "Wander asks for more holds in less time, reference gravity for a better value."
)


def budget(told: Budget, subject: Subject) -> list[Block]:
    """Return where the uncertainties come from as a figure and a table, and which errors would go unnoticed.

    Parameters
    ----------
    told : what the estimate rests on.
    subject : of the report.
    """
    rows = subject.rows
    detectable = [] if told.statement is None else _reliability(told.statement, rows)
    if not told.shares:
        return detectable
    known = rows[: len(subject.estimate.parameters)]
    return [
        *section("Where the uncertainties come from, in shares", Figures([_drawn(told, known)], _SHARES)),
        *section("Where the uncertainties come from", *_sources(told, subject.estimate, known)),
        *detectable,
    ]


def _drawn(told: Budget, rows: list[ParameterRow]) -> Figure:
    squares = {name: part**2 for name, part in told.shares.items()}
    whole = sum(squares.values(), np.zeros(len(rows)))
    marks: list[Mark] = []
    for at, (name, square) in enumerate(squares.items()):
        share = 100.0 * np.divide(square, whole, out=np.zeros(len(rows)), where=whole > 0.0)
        marks.append(
            Bars(
                plain(share, 4),
                [row.parameter.short for row in rows],
                name,
                PALETTE[at % len(PALETTE)],
                opacity=1.0 if at < len(PALETTE) else 0.55,
                hover="%{y}: %{x:.1f} %<extra>%{fullData.name}</extra>",
                lying=True,
            )
        )
    return Figure(
        "budget",
        "Share of each source in the variance of each parameter",
        marks,
        Axis("share of the variance / %", span=(0.0, 100.0)),
        Axis(kind="names", downwards=True),
        120 + 20 * len(rows),
        stacked=True,
    )


def _sources(told: Budget, estimate: Estimate, rows: list[ParameterRow]) -> list[Block]:
    stated = told.statement
    expanded = () if stated is None else ("expanded, 95 %", "k", "degrees of freedom")
    lines: list[list[str]] = []
    for k, row in enumerate(rows):
        whole = estimate.parameters[k].standard_uncertainty
        factor = row.said.sigma / whole if whole > 0.0 else 0.0
        parts = [float(part[k]) for part in told.shares.values()]
        lines.append(
            [
                f"{row.group}: {row.label}",
                f"{two_digits(row.said.sigma)}{spaced(row.said.unit)}",
                *([] if stated is None else _expanded(stated, k, row)),
                *(two_digits(part * factor) if part > _NOTHING * whole else "–" for part in parts),
            ]
        )
    besides = (
        ", with that of gravity and of a rotation that was not determined besides" if stated is None else ""
    )
    words = (
        "What each source adds to a parameter's standard uncertainty, in its unit; the squares add up"
        f"{besides}. A dash is less than a hundredth of the whole.{_about_expanded(stated)}"
    )
    table = Table(("parameter", "standard uncertainty", *expanded, *told.shares), lines)
    return [Sentences([words], "paragraphs"), table, Sentences(_statement(stated, estimate, rows))]


def _about_expanded(told: UncertaintyStatement | None) -> str:
    if told is None:
        return ""
    known = {name: nu for name, nu in told.source_degrees.items() if math.isfinite(nu)}
    each = ", ".join(f"{name} {nu:.0f}" for name, nu in known.items())
    return (
        " The expanded uncertainty is k times the standard uncertainty. k is Student's factor for "
        "the effective degrees of freedom after Welch and Satterthwaite. The sources' own are: "
        f"{each}, and of the others infinitely many."
    )


def _expanded(told: UncertaintyStatement, k: int, row: ParameterRow) -> list[str]:
    degrees, factor = float(told.effective_degrees[k]), float(told.coverage_factors[k])
    many = "∞" if degrees > 1e4 else f"{math.floor(degrees)}"
    return [two_digits(factor * row.said.sigma), f"{factor:.2f}", many]


def _statement(told: UncertaintyStatement | None, estimate: Estimate, rows: list[ParameterRow]) -> list[str]:
    if told is None:
        return []
    sigmas = np.array([p.standard_uncertainty for p in estimate.parameters])
    said = [] if told.test is None else _global_test_words(told.test)
    return [
        *said,
        *(_model_choice_words(choice, sigmas, rows) for choice in told.model_choice),
        *told.not_included,
    ]


def _reliability(told: UncertaintyStatement, rows: list[ParameterRow]) -> list[Block]:
    """Return which errors would go unnoticed, and what they would do; nothing where it is not known."""
    if not told.detectable:
        return []
    lines: list[list[str]] = []
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
    words = (
        "For each observation the largest error that its test would still miss (false alarm "
        f"{told.alpha:g}, found with {100.0 * told.power:.0f} %), and what it would do. It is in the "
        f"direction that does most harm. Of each kind the {SHOWN} most harmful are shown. An "
        "observation that is checked by 0 of its numbers stands alone: nothing would show a blunder "
        "in it."
    )
    return section(
        "Errors that would go unnoticed",
        Sentences([words], "paragraphs"),
        Sentences(_reliability_sentences(told, rows)),
        Table(heads, lines),
    )


def _detectable_row(found: Detectable, rows: list[ParameterRow]) -> list[str]:
    words, factor, unit = _KINDS[found.kind]
    row = rows[found.parameter]
    return [
        f"{words} {found.index + 1}",
        f"{found.redundancy:.2f} of {found.count}",
        f"{two_digits(factor * found.size)}{spaced(unit)}" if math.isfinite(found.size) else "any",
        f"{row.group}: {row.label}",
        two_digits(found.effect) if math.isfinite(found.effect) else "any",
    ]


_MOST_SAID = 3


def _reliability_sentences(told: UncertaintyStatement, rows: list[ParameterRow]) -> list[str]:
    """Return the most harmful errors that would go unnoticed, as sentences."""
    said: list[str] = []
    for found in sorted(told.detectable, key=lambda d: -d.effect)[:_MOST_SAID]:
        words, factor, unit = _KINDS[found.kind]
        parameter = f"{rows[found.parameter].group}: {rows[found.parameter].label}"
        size, end = "any size", f" ({parameter})"
        if math.isfinite(found.effect):
            size = f"{two_digits(factor * found.size)}{spaced(unit)}"
            end = f", and would move {parameter} by {two_digits(found.effect)} of its standard uncertainties"
        said.append(f"An error of {size} of the {words} {found.index + 1} would go unnoticed{end}.")
    return said


def _global_test_words(test: GlobalTest) -> list[str]:
    """Return what the square sum of all residuals says."""
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


def _model_choice_words(choice: ModelChoice, sigmas: np.ndarray, rows: list[ParameterRow]) -> str:
    """Return what the other model would change, in a sentence."""
    size = np.abs(choice.change) / np.where(sigmas > 0.0, sigmas, np.inf)
    worst = int(np.nanargmax(size))
    row = rows[worst]
    return (
        f"Model choice, not included: the term {choice.name.replace('_', '-')} was "
        f"{'kept' if choice.kept else 'left out'} near its limit (p {_probability(choice.probability)}, limit "
        f"{choice.limit:.2g}). {'Without' if choice.kept else 'With'} it {row.group}: {row.label} would move by "
        f"{two_digits(float(size[worst]))} of its standard uncertainties, the most of all."
    )


def _probability(p: float) -> str:
    return "< 0.0001" if p < 1e-4 else f"= {p:.2g}"


# Differences beyond so many of the estimator's standard uncertainties are worth a sentence.
FAR = 3.0


@dataclass(frozen=True)
class Compared:
    """One parameter as both ways have it, in the joint one's unit for readers.

    Attributes
    ----------
    row : of the joint estimate.
    value, sigma : the estimator's own.
    difference : joint minus the estimator's, in standard uncertainties of the estimator's.
    ratio : the joint standard uncertainty over the estimator's.
    """

    row: ParameterRow
    value: float
    sigma: float
    difference: float
    ratio: float


def beside(told: Beside, subject: Subject) -> list[Block]:
    """Return both ways as a table; nothing where nothing stands beside.

    Parameters
    ----------
    told : what the estimate rests on.
    subject : of the report.
    """
    found = parameters_beside(told, subject.estimate, subject.rows)
    if not found:
        return []
    name = told.estimate.procedure
    heads = ("parameter", "joint", name, "difference / uncertainty", "ratio")
    rows = [
        [
            f"{one.row.group}: {one.row.label}",
            one.row.shown.text,
            Measure(one.value, one.sigma, one.row.shown.unit).text,
            _signed(one.difference),
            fixed(one.ratio, 2),
        ]
        for one in found
    ]
    words = Sentences([_words(found, name, told.source)], "paragraphs")
    return section("A paper's own estimator beside", words, Table(heads, rows))


def parameters_beside(told: Beside, estimate: Estimate, rows: list[ParameterRow]) -> list[Compared]:
    """Return the parameters that both ways have with an uncertainty.

    Parameters
    ----------
    told : the estimator's.
    estimate : the joint one.
    rows : the joint parameters for readers.
    """
    others = {p.name: p for p in told.estimate.parameters}
    found: list[Compared] = []
    for own, row in zip(estimate.parameters, rows, strict=False):
        other = others.get(own.name)
        if other is None or not (own.standard_uncertainty > 0.0 and other.standard_uncertainty > 0.0):
            continue
        factor = row.shown.sigma / own.standard_uncertainty
        found.append(
            Compared(
                row,
                factor * other.value,
                factor * other.standard_uncertainty,
                (own.value - other.value) / other.standard_uncertainty,
                own.standard_uncertainty / other.standard_uncertainty,
            )
        )
    return found


def _words(found: list[Compared], name: str, source: str) -> str:
    far = [one for one in found if abs(one.difference) > FAR]
    typical = math.exp(sum(math.log(one.ratio) for one in found) / len(found))
    told = (
        f"Both are made from the same recording: {name} by {source}, the joint estimate from every sample at once. "
        f"Joint standard uncertainties are {fixed(typical, 2)} times {name}'s in the (geometric) mean. "
        f"± is one standard uncertainty; differences are in those of {name}: where the model is right, below about "
        "two. The last column is the joint uncertainty over the other."
    )
    if not far:
        return told
    named = ", ".join(f"{one.row.group.lower()} {one.row.label}" for one in far[:3])
    more = f" and {len(far) - 3} more" if len(far) > 3 else ""
    return f"{told} Farther apart are {named}{more}: what only one of them models has moved them."


def _signed(value: float) -> str:
    text = fixed(value, 1)
    return text if text.startswith("-") or text == "0.0" else f"+{text}"
