"""A study: how a table or figure of a paper is made anew, beside the numbers that the paper prints."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import field
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from tumble.arrays import AnyArray
from tumble.files import read_yaml
from tumble.records import dataclass
from tumble.reproduction import INSIDE, OUTSIDE, UNJUDGED, Item, Outcome, Plot, Row

_COSTS = json.loads((files("tumble_papers") / "costs.json").read_text(encoding="utf-8"))


@cache
def _printed(name: str) -> dict[str, Any]:
    return json.loads((files("tumble") / "data" / "papers" / f"{name}.json").read_text(encoding="utf-8"))


def hayal() -> dict[str, Any]:
    """Return the printed tables of Hayal (2010): ``tables``, ``position_tables`` and the abstract's claim."""
    return _printed("hayal-2010")


def zhang() -> dict[str, Any]:
    """Return the printed numbers of Zhang et al. (2010): ``tables``, ``figures``, ``simulation`` and ``claims``."""
    return _printed("zhang-2010")


def savage() -> dict[str, Any]:
    """Return the printed numbers of Savage (2018): ``tables``, equations by number, ``section_9``.

    ``another_implementation`` has figures that the paper does not print.
    """
    return _printed("savage-2018")


@dataclass
class Found:
    """What a study finds: claims with their verdicts, figures, sentences, and what stands in the declared ones.

    Attributes
    ----------
    rows, plots : the table, and the figures.
    notes : sentences after those that are declared.
    said : what the declared sentences have in braces.
    criterion : in place of the declared one; empty for that.
    few : whether the runs are too few for a range, of which another criterion is declared.
    """

    rows: list[Row]
    plots: list[Plot] = field(default_factory=list[Plot])
    notes: list[str] = field(default_factory=list[str])
    said: Mapping[str, float] = field(default_factory=dict[str, float])
    criterion: str = ""
    few: bool = False


@cache
def _declared() -> dict[str, dict[str, Any]]:
    return read_yaml(Path(str(files("tumble_papers") / "studies.yaml")))


@dataclass(frozen=True)
class Study:
    """How one item is made anew: its setting is in what makes it, its words are declared in `studies.yaml`.

    Attributes
    ----------
    name : as it is asked for.
    make : makes it from runs and a seed.
    """

    name: str
    make: Callable[[int, int], Found]

    def run(self, runs: int, seed: int) -> Outcome:
        """Return its table or figure.

        Parameters
        ----------
        runs : how many.
        seed : of all random numbers.
        """
        found, told = self.make(runs, seed), _declared()[self.name]
        said = {**found.said, "runs": runs, "sure": 100 * (1 - CHANCE), "printed_runs": PRINTED_RUNS}
        criterion = told.get("criterion_few" if found.few else "criterion", "").format(**said)
        first, last = ([note.format(**said) for note in told.get(of, ())] for of in ("notes", "last"))
        once = told.get("once", told.get("runs", 1) is None)
        return Outcome(
            self.name,
            self._words(told["title"])
            if "title" in told
            else self.item.title[0].upper() + self.item.title[1:],
            told["source"],
            tuple(told["columns"]),
            found.rows,
            found.criterion or criterion,
            found.plots,
            [*first, *found.notes, *last],
            1 if once else runs,
            seed,
            simulated=told.get("simulated", True),
        )

    @property
    def item(self) -> Item:
        """What `tumble reproduce` lists and runs."""
        told, cost = _declared()[self.name], tuple(_COSTS.get(self.name, (0.0, 0.0)))
        words = self._words(told["listed"])
        return Item(self.name, words, self.run, told.get("runs", 1), cost, told.get("dear", False))

    def _words(self, words: str) -> str:
        """Fill in the number, and the title that the paper prints."""
        paper, _, which = self.name.partition("-")
        figure, number = which.startswith("figure-"), which.removeprefix("figure-").partition("-")[0]
        printed = {"hayal": hayal, "zhang": zhang, "savage": savage}[paper]()
        tables = (
            printed.get("figures", {}) if figure else printed["tables"] | printed.get("position_tables", {})
        )
        return words.format(number=number, title=tables.get(number, {}).get("title"))


def judge(fits: bool, why: str = "", few: str | None = None) -> tuple[str, str]:
    """Return a row's verdict and its reason: why it does not fit, or why too few runs say nothing.

    Parameters
    ----------
    fits : whether the paper's number could be one of ours.
    why : it does not.
    few : why it is not judged; None where it is.
    """
    if few is not None:
        return UNJUDGED, few
    return (INSIDE, "") if fits else (OUTSIDE, why)


def generator(*key: int) -> np.random.Generator:
    """Return the random numbers of a study: the same for the same key.

    Parameters
    ----------
    key : seed, and what tells one part of a study from another.
    """
    return np.random.Generator(np.random.SFC64(key))


# Of a standard deviation that Zhang et al. print.
PRINTED_RUNS = 500
# One true row in a thousand is outside by chance; all of a paper's rows are some two hundred.
CHANCE = 0.001


def scatter_range(freedom: int) -> tuple[float, float]:
    """Return between which multiples of the true one a standard deviation lies, but for `CHANCE` (χ²).

    Parameters
    ----------
    freedom : degrees of freedom that it comes from.
    """
    from scipy.special import chdtri

    # chdtri takes the probability of more.
    low, high = (float(np.sqrt(chdtri(freedom, tail) / freedom)) for tail in (1 - CHANCE / 2, CHANCE / 2))
    return low, high


def standard_deviation(differences: AnyArray) -> AnyArray:
    """Return the standard deviation over the runs; of one run, how far it is off.

    Parameters
    ----------
    differences : (runs, ...) from the truth.
    """
    if len(differences) == 1:
        return np.abs(differences[0])
    return np.asarray(np.std(differences, axis=0, ddof=1), dtype=np.float64)


def in_threads(play: Callable[[int], None], runs: int, threads: int | None = None) -> Iterator[None]:
    """Yield after each run that was played, several at once.

    Parameters
    ----------
    play : plays a run, by its number.
    runs : how many.
    threads : at once; None for as many as the machine has.
    """
    pool = ThreadPoolExecutor(threads or os.cpu_count() or 1)
    try:
        yield from pool.map(play, range(runs))
    finally:  # who stops a long study does not wait for all of it
        pool.shutdown(cancel_futures=True)
