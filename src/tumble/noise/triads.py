"""One number for a triad's three axes: what a filter takes that has one coefficient for all of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from tumble.records import dataclass

if TYPE_CHECKING:
    from tumble.noise.channel import Channel
    from tumble.noise.fitting.fit import Term

COLLAPSE = (
    "mean of variances: the root of the mean of the axes' squared coefficients. An axis that does "
    "not show the term counts as zero, known to half its upper limit squared. Worst axis: the "
    "largest coefficient, and whose it is. N is that of `random_walk`, with the white part of short "
    "Gauss-Markov processes"
)
"""How three axes become one, in words."""

_LETTERS = "QNBKR"


@dataclass(frozen=True)
class TriadTerm:
    """A coefficient of a triad, in the unit of its axes.

    Attributes
    ----------
    letter : of IEEE Std 952.
    mean, mean_sigma : root of the mean of the squares over the axes, and its standard uncertainty.
    worst, worst_sigma, worst_axis : the largest of the axes, its standard uncertainty, and its name.
    seen : names of the axes that show it.
    axes : how many there are.
    """

    letter: str
    mean: float
    mean_sigma: float
    worst: float
    worst_sigma: float
    worst_axis: str
    seen: tuple[str, ...]
    axes: int


def triad_terms(channels: Sequence[Channel]) -> tuple[TriadTerm, ...]:
    """Return the coefficients of a triad that at least one of its axes shows.

    The axes' errors are taken as independent.

    Parameters
    ----------
    channels : of one triad, those that live.
    """
    found: list[TriadTerm] = []
    for letter in _LETTERS:
        shown = {channel.name: term for channel in channels if (term := _term(channel, letter)) is not None}
        if not shown:
            continue
        values = np.array([term.value for term in shown.values()])
        sigmas = np.array([term.sigma for term in shown.values()])
        mean = float(np.sqrt(np.sum(values**2) / len(channels)))
        spread = float(np.sqrt(np.sum(sigmas**2) / len(channels)))
        if mean > 0.0:
            # Half the uncertainty of each square; a square that is not seen is zero to half its upper limit.
            halves = [
                *(values * sigmas),
                *(0.25 * _limit(c, letter) ** 2 for c in channels if c.name not in shown),
            ]
            spread = float(np.sqrt(np.sum(np.square(halves))) / (len(channels) * mean))
        worst = max(shown, key=lambda name: shown[name].value)
        found.append(
            TriadTerm(
                letter,
                mean,
                spread,
                shown[worst].value,
                shown[worst].sigma,
                worst,
                tuple(shown),
                len(channels),
            )
        )
    return tuple(found)


def _limit(channel: Channel, letter: str) -> float:
    """The upper limit of a coefficient that an axis does not show; 0 where none is known."""
    limit = channel.unseen.get(letter, 0.0)
    return limit if np.isfinite(limit) else 0.0


def _term(channel: Channel, letter: str) -> Term | None:
    return channel.random_walk if letter == "N" else channel.term(letter)
