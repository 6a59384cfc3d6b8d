"""Several recordings of one unit: biases from turn-on to turn-on, and whether the rest is stable."""

from __future__ import annotations

from tumble.calibration import TurnOns
from tumble.document import BiasBlock, Calibration, StableBlock, TurnOnsBlock
from tumble.parameters import OPTIONAL, fixed, parameter_of, with_uncertainty
from tumble.report.figures.record import AXIS_COLOURS, GREY, Axis, Figure, Mark, Points, Spans, plain
from tumble.report.page import Block, Figures, Sentences, Table, section
from tumble.report.parameters import ParameterRow, parameter_rows
from tumble.report.subject import Subject

# More recordings than this do not stand beside each other in a terminal.
MOST_COLUMNS = 4
NEXT = "for the next turn-on"
_SCATTER = (
    "± is one standard uncertainty. The scatter is the standard deviation between recordings, with its own; what the "
    "recordings' uncertainties explain of it stands beside. For the next turn-on there is their mean, as uncertain as "
    "the scatter makes it."
)
_STABLE = (
    "What should be stable, as each recording gives it by itself. Chance makes differences as large "
    "with the probability given."
)
_FIGURE = (
    "Each recording's bias less the mean of all, with its 95 % interval. The band is where the bias "
    "of the next turn-on is expected (95 %), for the axis that scatters most."
)


def turn_ons(_: TurnOns, subject: Subject) -> list[Block]:
    """Return the recordings, their biases and the test of what is stable; nothing of a single recording.

    Parameters
    ----------
    _ : that there is such evidence; all of it stands in the document.
    subject : of the report.
    """
    told = subject.calibration.turn_ons
    if told is None:
        return []
    rows = {row.name: row for row in subject.rows}
    names = [recording.name for recording in told.recordings]
    biases = [_bias_cells(bias, rows[bias.parameter]) for bias in told.biases]
    stable = [_stable_cells(one, rows[one.parameter]) for one in told.agreements]
    words = "Each recording is the unit switched on anew. Biases are each one's own; all else is common."
    blocks = section(
        "From turn-on to turn-on",
        Sentences([words], "paragraphs"),
        Table(("recording", "holds", "turns", "spins", "rate", "sigma0"), _recordings(told)),
        Sentences([_SCATTER], "paragraphs"),
        Table(("bias", NEXT, "scatter", "explained", *names), biases),
        Sentences([_STABLE], "paragraphs"),
        Table(("parameter", "chi-square", "probability", *names), stable),
    )
    figures = [
        _drawn(told, [b for b in told.biases if b.parameter.startswith(kind)], rows, kind)
        for kind in ("accelerometer", "gyro")
        if any(b.parameter.startswith(kind) for b in told.biases)
    ]
    return blocks + (section("Biases by turn-on", Figures(figures, _FIGURE)) if figures else [])


def bias_table(calibration: Calibration, *, width: int) -> Table | None:
    """Return the biases by recording alone; None of a single recording, or of more than stand beside each other.

    Parameters
    ----------
    calibration : the document.
    width : characters of the terminal.
    """
    told = calibration.turn_ons
    if told is None or len(told.recordings) > MOST_COLUMNS or width < 30 + 24 * len(told.recordings):
        return None
    rows = {row.name: row for row in parameter_rows(calibration)}
    biases = [_bias_cells(bias, rows[bias.parameter]) for bias in told.biases]
    names = [recording.name for recording in told.recordings]
    return Table(("bias", NEXT, *names), [[*cells[:2], *cells[4:]] for cells in biases])


def _recordings(told: TurnOnsBlock) -> list[list[str]]:
    return [
        [
            r.name,
            str(r.holds),
            str(r.turns),
            str(r.spins),
            f"{r.rate:g} Hz",
            "" if r.sigma0 is None else fixed(r.sigma0, 2),
        ]
        for r in told.recordings
    ]


def _bias_cells(bias: BiasBlock, row: ParameterRow) -> list[str]:
    """Cells in the unit that readers compare, one for all recordings."""
    factor, unit = _practical(row)
    scatter = with_uncertainty(factor * bias.scatter, factor * bias.scatter_sigma)
    following = with_uncertainty(factor * bias.mean, factor * bias.next_sigma)
    return [
        f"{row.group.lower()} {parameter_of(bias.parameter).axes} / {unit}",
        following,
        scatter,
        f"{factor * bias.measurement:.2g}",
        *_each(bias, factor),
    ]


def _each(one: BiasBlock | StableBlock, factor: float) -> list[str]:
    """What each recording has, empty where it has none."""
    return [
        "" if value is None or sigma is None else with_uncertainty(factor * value, abs(factor) * sigma)
        for value, sigma in zip(one.values, one.sigmas, strict=True)
    ]


def _practical(row: ParameterRow) -> tuple[float, str]:
    """The factor from the raw unit to the one that readers compare, and that unit."""
    return row.said.sigma / row.shown.sigma, row.said.unit


def _stable_cells(one: StableBlock, row: ParameterRow) -> list[str]:
    factor = row.shown.value / one.value if one.value else 1.0
    words = "" if one.agrees else f": not stable, uncertainty × {fixed(one.enlarged, 1)}"
    if one.degrees < 1:
        words = ": determined by one recording only"
    unit = f" / {row.shown.unit}" if row.shown.unit else ""
    return [
        f"{row.label if row.group == OPTIONAL else f'{row.group.lower()} {row.label}'}{unit}",
        f"{one.chi_square:.1f} of {one.degrees}",
        f"{one.probability:.2g}{words}",
        *_each(one, factor),
    ]


def _drawn(told: TurnOnsBlock, biases: list[BiasBlock], rows: dict[str, ParameterRow], kind: str) -> Figure:
    names = [r.name for r in told.recordings]
    marks: list[Mark] = []
    widest, unit = 0.0, ""
    for number, bias in enumerate(biases):
        factor, unit = _practical(rows[bias.parameter])
        at = [k for k, value in enumerate(bias.values) if value is not None]
        values = [factor * ((bias.values[k] or 0.0) - bias.mean) for k in at]
        sigmas = [1.96 * factor * (bias.sigmas[k] or 0.0) for k in at]
        axis = parameter_of(bias.parameter).axes
        widest = max(widest, bias.coverage_factor * factor * bias.next_sigma)
        marks.append(
            Points(
                [k + 1 + 0.12 * (number - 1) for k in at],
                plain(values, 6),
                axis,
                AXIS_COLOURS[axis],
                size=8,
                sigma=plain(sigmas),
                words=[names[k] for k in at],
                hover=f"{axis}, %{{text}}: %{{y:.4g}} {unit}<extra></extra>",
            )
        )
    marks.append(Spans([-widest], [widest], colour=GREY, opacity=0.12, lying=True))
    places, span = range(1, len(names) + 1), (0.5, len(names) + 0.5)
    return Figure(
        f"turn-ons-{kind}",
        f"{kind} biases of {len(names)} recordings about their mean",
        marks,
        Axis("recording, in the table's order", ticks=places, span=span, zero=False),
        Axis(),
        300,
        title=f"{kind} bias less its mean / {unit}",
    )
