"""Gauss-Newton that takes a bad step back, on one number whose equation bends too much for a whole step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tumble.arrays import Series, Square
from tumble.errors import ConvergenceError
from tumble.estimation.chain import Eliminated
from tumble.estimation.equations import Equations, Linear
from tumble.estimation.gauss_helmert import Prior
from tumble.estimation.solve import ITERATIONS, solve
from tumble.estimation.unknowns import Block, Layout, Unknowns

LAYOUT = Layout((Block("place", ("the place",), ("a look at it",)),))
SIGMA = 1e-3


class Bent(Equations):
    """``atan(x - 2)`` seen as nothing: beyond 1.39 from there a Newton step goes further away."""

    kind, cause, place = "bent", "noise", np.array([0])

    def linearise(self, state: Any) -> list[Linear]:
        off = float(state.unknowns.values[0]) - 2.0
        covariance = np.full((1, 1, 1), SIGMA**2)
        return [Linear(np.array([[np.arctan(off)]]), covariance, np.full((1, 1, 1), 1.0 / (1.0 + off**2)))]


class Apart(Equations):
    """``x + 1`` and ``x - 1 + bend x²`` seen as nothing: zero is nearest, and a step from x leads to ``bend x``."""

    kind, cause, place = "apart", "noise", np.arange(2)

    def __init__(self, bend: float) -> None:
        self.bend = bend

    def linearise(self, state: Any) -> list[Linear]:
        x = float(state.unknowns.values[0])
        residual = np.array([[x + 1.0], [x - 1.0 + self.bend * x**2]])
        slope = np.array([1.0, 1.0 + 2.0 * self.bend * x])
        return [Linear(residual, np.full((2, 1, 1), SIGMA**2), slope[:, None, None])]


class One:
    """A recording of one kind of equations."""

    nodes, size, own = 0, 1, 0

    def __init__(self, seen: Equations) -> None:
        self.equations: list[Equations] = [seen]
        self.within: list[Any] = []

    def undetermined(self, node: int) -> str:
        return "nowhere"

    def move(self, nodes: Any, own: Series) -> None:
        """Nothing is its own."""


class Task:
    """Where the number is."""

    def __init__(self, start: float, seen: Equations | None = None) -> None:
        self.seen = seen or Bent()
        self.unknowns = Unknowns(LAYOUT, np.array([start]), np.array([0]))
        self.prior: Prior | None = None
        self.asked = 0

    @property
    def state(self) -> Task:
        return self

    def stretch(self) -> One:
        self.asked += 1
        return One(self.seen)

    def stepped(self, chain: Eliminated, cofactor: Square) -> bool:
        return False

    def snapshot(self) -> Callable[[], None]:
        now = self.unknowns

        def back() -> None:
            self.unknowns = now

        return back


@pytest.mark.parametrize("start", [2.5, 4.0, -8.0])
def test_it_settles_where_a_whole_step_goes_astray(start: float) -> None:
    task = Task(start)
    settled = solve(task)
    assert task.unknowns.values[0] == pytest.approx(2.0, abs=1e-6)
    assert np.sqrt(settled.cofactor[0, 0]) == pytest.approx(SIGMA, rel=1e-6)
    assert settled.square_sum == pytest.approx(0.0, abs=1e-6)
    assert settled.redundancy == 0
    assert task.asked < ITERATIONS / 2


@pytest.mark.parametrize("bend", [-0.5, -1.04, -2.0])
def test_it_settles_where_every_step_goes_back_over_the_last_one(bend: float) -> None:
    """Madsen's problem: whole steps from x go to ``bend x``, and round in circles beyond -1."""
    task = Task(0.01, Apart(bend))
    solve(task)
    assert task.unknowns.values[0] == pytest.approx(0.0, abs=0.01 * SIGMA)
    assert task.asked < 15


def test_one_step_is_a_whole_one() -> None:
    task = Task(2.5)
    settled = solve(task, once=True)
    assert task.unknowns.values[0] == pytest.approx(2.5 - np.arctan(0.5) * 1.25)
    assert settled.start_sum == pytest.approx((np.arctan(0.5) / SIGMA) ** 2)
    assert settled.square_sum == pytest.approx(0.0, abs=1e-9)


def test_what_goes_away_for_ever_is_said() -> None:
    """Seen where it cannot be: the square sum falls all the way to infinity."""

    class Away(Bent):
        def linearise(self, state: Any) -> list[Linear]:
            value = float(np.exp(-state.unknowns.values[0]))
            return [Linear(np.array([[value]]), np.full((1, 1, 1), 1e-300), np.full((1, 1, 1), -value))]

    with pytest.raises(ConvergenceError, match=r"^The adjustment "):
        solve(Task(0.0, Away()))
