"""What a study hands over: a table beside the paper's numbers with a verdict a row, figures, notes."""

from __future__ import annotations

from dataclasses import field

from tumble.arrays import Series
from tumble.records import dataclass

INSIDE, OUTSIDE, UNJUDGED = "inside", "outside", ""

Value = float | str | None


@dataclass(frozen=True)
class Row:
    """One line of a table.

    Attributes
    ----------
    label : what it is.
    unit : of the numbers; empty where they have none.
    cells : one for each column of the outcome.
    verdict : `INSIDE` or `OUTSIDE` of the range that the outcome's `criterion` names, or `UNJUDGED`.
    reason : why, where it is outside or needs a word.
    """

    label: str
    unit: str
    cells: tuple[Value, ...]
    verdict: str = UNJUDGED
    reason: str = ""


@dataclass(frozen=True)
class Curve:
    """A line of a figure with its band: the mean `y` over `x`, between `low` (5 % of the runs) and `high` (95 %).

    A plot whose line or band is something else says so.
    """

    name: str
    x: Series
    y: Series
    low: Series
    high: Series


@dataclass(frozen=True)
class Marks:
    """The paper's own numbers in a figure: points without a line."""

    name: str
    x: Series
    y: Series


@dataclass(frozen=True)
class Plot:
    """A figure with logarithmic or linear axes.

    Attributes
    ----------
    name : identifier.
    title, x_label, y_label : words with units.
    curves : what is drawn.
    marks : the paper's own numbers, where it prints any.
    linear : both axes; else both are logarithmic, and what is not positive is left out.
    line, band : what the line and its band are, in words.
    """

    name: str
    title: str
    x_label: str
    y_label: str
    curves: tuple[Curve, ...]
    marks: Marks | None = None
    linear: bool = False
    line: str = "mean"
    band: str = "5 % to 95 %"


@dataclass
class Outcome:
    """A table or figure of a paper, made anew.

    Attributes
    ----------
    item : the name that it is asked for by.
    title, source : what it is, and where it is printed.
    columns : heads of the rows' cells.
    rows : the table.
    criterion : what the verdicts mean, in a sentence.
    plots : the figures.
    notes : sentences.
    repetitions, seed : how often, and from what, it was simulated.
    simulated : whether anything was; if not, the two before mean nothing.
    seconds : how long it took.
    """

    item: str
    title: str
    source: str
    columns: tuple[str, ...]
    rows: list[Row]
    criterion: str = ""
    plots: list[Plot] = field(default_factory=list[Plot])
    notes: list[str] = field(default_factory=list[str])
    repetitions: int = 1
    seed: int = 0
    seconds: float = 0.0
    simulated: bool = True

    @property
    def command(self) -> str:
        """What to type to have it again."""
        options = f" --repetitions {self.repetitions} --seed {self.seed}"
        return f"tumble reproduce {self.item}{options if self.simulated else ''}"

    @property
    def counts(self) -> tuple[int, int]:
        """How many rows are inside, and how many are judged."""
        judged = [row for row in self.rows if row.verdict != UNJUDGED]
        return sum(row.verdict == INSIDE for row in judged), len(judged)
