"""Alignment of two sequences in order, with gaps on both sides and with repetitions."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Table
from tumble.records import dataclass


@dataclass(frozen=True, slots=True)
class Alignment:
    """Which event is which step, in order.

    `pairs` are (step, event); a step that was done again has several. `cost` is the sum of all costs.
    """

    pairs: tuple[tuple[int, int], ...]
    cost: float

    def steps(self) -> set[int]:
        """Return the steps that have an event."""
        return {step for step, _ in self.pairs}


def align(cost: Table, left_out: Series, skipped: Series, again: Table) -> Alignment:
    """Find the cheapest alignment of steps with events that keeps the order of both.

    Dynamic programming (Needleman and Wunsch, J. Mol. Biol. 48 (1970) 443) with one addition: an event
    may repeat the step of an earlier event, if only left-out events lie between.

    Parameters
    ----------
    cost : (steps, events) of the event being the step; infinite where it cannot be.
    left_out : (events,) cost of an event that is no step.
    skipped : (steps,) cost of a step that has no event.
    again : (steps, events) cost, on top, of the event repeating the step; infinite to forbid it.
    """
    steps, events = cost.shape
    inf = float("inf")
    costs, more = cost.tolist(), again.tolist()
    omit = [*left_out.tolist()]
    # best[i][j]: first i steps with first j events; held[i][j]: the same with step i - 1 begun
    best = [[0.0] * (events + 1) for _ in range(steps + 1)]
    held = [[inf] * (events + 1) for _ in range(steps + 1)]
    # how each was come by: best by 's'kip, 'o'mit, or 'h'eld; held by 'm'atch, 'a'gain, or 'o'mit
    how_best = [["h"] * (events + 1) for _ in range(steps + 1)]
    how_held = [["m"] * (events + 1) for _ in range(steps + 1)]
    for j in range(1, events + 1):
        best[0][j], how_best[0][j] = best[0][j - 1] + omit[j - 1], "o"
    for i in range(1, steps + 1):
        row, row_more, skip = costs[i - 1], more[i - 1], float(skipped[i - 1])
        best[i][0], how_best[i][0] = best[i - 1][0] + skip, "s"
        for j in range(1, events + 1):
            match = row[j - 1]
            cheapest, how = best[i - 1][j - 1] + match, "m"
            repeated = held[i][j - 1] + match + row_more[j - 1]
            if repeated < cheapest:
                cheapest, how = repeated, "a"
            omitted = held[i][j - 1] + omit[j - 1]
            if omitted < cheapest:
                cheapest, how = omitted, "o"
            held[i][j], how_held[i][j] = cheapest, how
            how = "h"
            if best[i - 1][j] + skip < cheapest:
                cheapest, how = best[i - 1][j] + skip, "s"
            if best[i][j - 1] + omit[j - 1] < cheapest:
                cheapest, how = best[i][j - 1] + omit[j - 1], "o"
            best[i][j], how_best[i][j] = cheapest, how
    return Alignment(tuple(_traced(how_best, how_held, steps, events)), best[steps][events])


def _traced(how_best: list[list[str]], how_held: list[list[str]], i: int, j: int) -> list[tuple[int, int]]:
    """The pairs on the cheapest way, in order."""
    pairs: list[tuple[int, int]] = []
    inside = False
    while i > 0 or j > 0:
        if not inside:
            way = how_best[i][j]
            if way == "s":
                i -= 1
            elif way == "o":
                j -= 1
            else:
                inside = True
            continue
        way = how_held[i][j]
        j -= 1
        if way != "o":
            pairs.append((i - 1, j))
        if way == "m":
            i, inside = i - 1, False
    return pairs[::-1]


def signed_permutations() -> list[np.ndarray]:
    """Return the 48 matrices that swap and reverse axes, the identity first, the likelier ones before others.

    A single reversed axis is likelier than a swap, and a swap than both.
    """
    from itertools import permutations, product

    matrices = [
        np.eye(3)[list(order)] * np.array(signs)[:, None]
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    ]
    return sorted(matrices, key=lambda m: (float(np.trace(np.abs(m))) != 3.0, int(np.sum(m < 0))))
