"""An error budget: which source of error contributes how much to each parameter of a test, before it is done.

Plain data that any procedure's accuracy analysis can fill: parameters in rows, sources in columns, one
standard uncertainty each, and beside them what drawn errors gave. It knows no procedure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tumble.arrays import Series, Table
from tumble.records import dataclass

# A source below this share of a total's variance is not named as one of its causes.
WORTH_NAMING = 0.1
# Standard deviations of an rms that the interval beside it spans either way: 95 % of the time.
_INTERVAL = 1.96
# Share of a total that an analysis to second order may be off by, beside chance.
_LEFT_OUT = 0.15


@dataclass(frozen=True, slots=True)
class ErrorSource:
    """Something that makes a test's result wrong.

    Attributes
    ----------
    name : short, unique in its budget.
    words : what it is and how it acts, one sentence.
    magnitude : one sigma that the budget was made for, in `unit`.
    unit : of the magnitude, SI.
    kind : whose it is: "sensors", "fixture", "site" or "method".
    """

    name: str
    words: str
    magnitude: float
    unit: str
    kind: str


@dataclass(frozen=True, slots=True)
class ParameterGroup:
    """Parameters of one sort, which a table shows in one row.

    Attributes
    ----------
    name : short.
    short : two or three words for a table's heading.
    words : what the parameters are.
    first, stop : range of the budget's parameters.
    unit : SI.
    practical : the unit of a table, as "ppm".
    factor : practical numbers per SI.
    """

    name: str
    short: str
    words: str
    first: int
    stop: int
    unit: str
    practical: str
    factor: float


@dataclass(frozen=True, slots=True)
class DrawnErrors:
    """What drawn errors gave: the root mean square of each parameter's error over the draws.

    Attributes
    ----------
    runs : draws.
    rms : (parameters,) SI.
    rms_sigma : (parameters,) standard uncertainty of `rms` for so many draws.
    words : how the errors were drawn and carried to the parameters.
    """

    runs: int
    rms: Series
    rms_sigma: Series
    words: str


@dataclass(frozen=True, slots=True)
class ErrorBudget:
    """Standard uncertainty of every parameter by every source.

    Attributes
    ----------
    procedure : whose it is.
    parameters : names, as the procedure's convention has them.
    groups : of the parameters, in order and without gaps.
    sources : what makes the result wrong.
    contributions : (parameters, sources) one sigma, SI; never negative.
    drawn : the same total by Monte Carlo, or None.
    settings : what was assumed of unit, fixture, site and timing, for a file.
    remarks : sentences: what is left out, what was approximated.
    """

    procedure: str
    parameters: tuple[str, ...]
    groups: tuple[ParameterGroup, ...]
    sources: tuple[ErrorSource, ...]
    contributions: Table
    drawn: DrawnErrors | None
    settings: Mapping[str, Any]
    remarks: tuple[str, ...]

    @property
    def totals(self) -> Series:
        """(parameters,) the sources together, taken as independent of each other."""
        return np.sqrt(np.sum(self.contributions**2, axis=1))

    def group_rms(self, kinds: Sequence[str] | None = None) -> Series:
        """Return (groups,) SI: the root mean square over each group's parameters of the total.

        Parameters
        ----------
        kinds : count only the sources of these kinds; None for all.
        """
        take = [kinds is None or source.kind in kinds for source in self.sources]
        variance = np.sum(self.contributions[:, take] ** 2, axis=1)
        return self._of_groups(variance)

    def group_contributions(self) -> Table:
        """Return (groups, sources) SI: the root mean square over each group's parameters."""
        squares = self.contributions**2
        rows = [np.mean(squares[group.first : group.stop], axis=0) for group in self.groups]
        return np.sqrt(np.array(rows))

    def group_drawn(self) -> Series | None:
        """Return (groups,) SI of the drawn errors; None if none were drawn."""
        if self.drawn is None:
            return None
        return self._of_groups(self.drawn.rms**2)

    def _of_groups(self, variance: Series) -> Series:
        """Root mean squares over each group's parameters."""
        means = [float(np.mean(variance[group.first : group.stop])) for group in self.groups]
        return np.sqrt(np.array(means))

    def main_sources(self, group: int) -> list[tuple[ErrorSource, float]]:
        """Return the sources that matter to a group, with their shares of its variance, the largest first.

        Parameters
        ----------
        group : index of the group.
        """
        squares = self.group_contributions()[group] ** 2
        whole = float(np.sum(squares))
        if whole == 0.0:
            return []
        shares = squares / whole
        order = np.argsort(-shares)
        return [(self.sources[k], float(shares[k])) for k in order if shares[k] >= WORTH_NAMING]

    def with_drawn(self, errors: Table, words: str) -> ErrorBudget:
        """Return the budget with the errors of a Monte Carlo study beside it.

        Parameters
        ----------
        errors : (runs, parameters) estimate minus truth, SI, of any simulation.
        words : how they were made.

        Raises
        ------
        ValueError
            If there are fewer than two runs, or not these parameters.
        """
        if errors.shape[0] < 2 or errors.shape[1] != len(self.parameters):
            raise ValueError(f"{errors.shape} are no errors of {len(self.parameters)} parameters over runs")
        squares = errors**2
        rms = np.sqrt(np.mean(squares, axis=0))
        spread = np.std(squares, axis=0, ddof=1) / np.sqrt(errors.shape[0])
        sigma = 0.5 * spread / np.where(rms > 0.0, rms, 1.0)
        return replace(self, drawn=DrawnErrors(errors.shape[0], rms, sigma, words))

    def disagreements(self) -> list[str]:
        """Return the groups whose analysed total is off the drawn one by more than chance, by name."""
        drawn = self.group_drawn()
        if drawn is None or self.drawn is None:
            return []
        chance = [float(np.max(self.drawn.rms_sigma[group.first : group.stop])) for group in self.groups]
        slack = _LEFT_OUT * drawn + _INTERVAL * np.array(chance)
        off = np.abs(self.group_rms() - drawn) > slack
        return [group.name for group, is_off in zip(self.groups, off.tolist(), strict=True) if is_off]

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain data for a file: SI, one sigma."""
        drawn = self.drawn
        totals = self.totals
        return {
            "format": "tumble error budget",
            "version": 1,
            "procedure": self.procedure,
            "settings": dict(self.settings),
            "sources": [
                {"name": s.name, "kind": s.kind, "words": s.words, "magnitude": s.magnitude, "unit": s.unit}
                for s in self.sources
            ],
            "parameters": [
                {
                    "name": name,
                    "group": group.name,
                    "unit": group.unit,
                    "standard_uncertainty": float(totals[k]),
                    "by_source": dict(
                        zip((s.name for s in self.sources), self.contributions[k].tolist(), strict=True)
                    ),
                    **(
                        {}
                        if drawn is None
                        else {"drawn_rms": float(drawn.rms[k]), "drawn_rms_sigma": float(drawn.rms_sigma[k])}
                    ),
                }
                for group in self.groups
                for k, name in list(enumerate(self.parameters))[group.first : group.stop]
            ],
            "monte_carlo": None if drawn is None else {"runs": drawn.runs, "how": drawn.words},
            "remarks": list(self.remarks),
        }
