"""What can be made anew: each item by name, with how long it takes.

Items come from installed packages, by the entry point group ``tumble.reproduction``: each entry names a dictionary of
`Item` by name. `tumble_papers`, which is installed with tumble, has those of the three papers.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import field
from functools import cache
from importlib.metadata import entry_points

from tumble.arrays import Series
from tumble.counting import time_words
from tumble.errors import UsageError
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


GROUP = "tumble.reproduction"


@dataclass(frozen=True)
class Item:
    """One table or figure.

    Attributes
    ----------
    name, title : as it is asked for, and what it is.
    run : makes it from repetitions and a seed.
    repetitions : by default; None for an item that has none.
    cost : seconds of the processor that it takes whatever the runs, and a run; as measured.
    dear : of which hundreds of runs take hours: as one of a paper's items it makes no more than its own number.
    """

    name: str
    title: str
    run: Callable[[int, int], Outcome]
    repetitions: int | None = 1
    cost: tuple[float, float] = (0.0, 0.0)
    dear: bool = False

    @property
    def effort(self) -> str:
        """How many runs it makes by itself, how long these take, and how long 500, in words."""
        own = _about(self.seconds())
        if self.repetitions is None:
            return f"no runs: {own}"
        runs = "1 run" if self.repetitions == 1 else f"{self.repetitions} runs"
        return f"{runs}: {own}" + ("" if self.repetitions == 500 else f"; 500: {_about(self.seconds(500))}")

    def seconds(self, runs: int | None = None) -> float:
        """Return how long it takes, s of the processor.

        Parameters
        ----------
        runs : None for its own number.
        """
        return self.cost[0] + self.cost[1] * (runs or self.repetitions or 0)

    def runs_among_others(self, asked: int | None) -> int | None:
        """Return how many runs it makes where all of a paper was asked for with so many.

        Parameters
        ----------
        asked : None for the item's own number.
        """
        if asked is None or not self.dear or self.repetitions is None:
            return asked
        return min(asked, self.repetitions)


def _about(seconds: float) -> str:
    """Return a time in words; what is at once, so."""
    return "at once" if seconds < 0.5 else time_words(seconds)


@cache
def all_items() -> dict[str, Item]:
    """Return every item by name, a paper after the other, each in its own order."""
    return {name: item for entry in entry_points(group=GROUP) for name, item in entry.load().items()}


def find_items(name: str) -> list[Item]:
    """Return the item of that name, or all of a paper.

    Parameters
    ----------
    name : of one item, or the beginning that a paper's items share, such as "hayal", "hayal-A" or
        "savage".

    Raises
    ------
    UsageError
        If there is none.
    """
    items = all_items()
    if name in items:
        return [items[name]]
    found = [item for key, item in items.items() if key.startswith((f"{name}-", f"{name}."))]
    if not found:
        import difflib

        near = difflib.get_close_matches(name, items, 1, 0.4)
        hint = f" Did you mean {near[0]}?" if near else ""
        raise UsageError(
            f"There is nothing to reproduce by the name of {name!r}.{hint} `tumble reproduce` lists what there is."
        )
    return found


def run_item(item: Item, repetitions: int | None, seed: int) -> Outcome:
    """Make an item anew.

    Parameters
    ----------
    item : which.
    repetitions : how many runs; None for the item's own number.
    seed : of all random numbers.
    """
    began = time.perf_counter()
    outcome = item.run(repetitions or item.repetitions or 1, seed)
    outcome.seconds = time.perf_counter() - began
    return outcome
