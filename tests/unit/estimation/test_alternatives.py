"""Suspicions of numbers that are seen again and again: found where they are, with their size, and seldom elsewhere."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tumble.arrays import AnyArray, Square
from tumble.estimation.alternatives import Alternative, Found, Suspect, find
from tumble.estimation.equations import Equations, Linear
from tumble.estimation.unknowns import Block, Layout, Unknowns
from tumble.estimation.wander import covariance_about_the_mean

LAYOUT = Layout((Block("level", ("first level", "second level"), ("a look", "a look")),))
TIMES = 24
SIGMA = 1e-3
LATER = np.asarray([np.arange(TIMES) >= k for k in range(4, TIMES - 3)], dtype=np.float64)
FALSE_ALARM = 0.01


class Seen(Equations):
    """Two levels, each seen at all times; what is left out counts for nothing."""

    kind, cause = "seen", "noise"
    place = np.arange(TIMES)

    def __init__(self, values: AnyArray, active: np.ndarray) -> None:
        self.values, self.active = values, active

    def linearise(self, state: Any) -> list[Linear]:
        residual = state.unknowns.values - self.values
        covariance = np.broadcast_to(SIGMA**2 * np.eye(2), (TIMES, 2, 2))
        by_border = np.broadcast_to(np.eye(2), (TIMES, 2, 2))
        return [Linear(residual, covariance, by_border, active=self.active)]


class Task:
    """Two levels that were seen, from where they need not have settled: all is linear."""

    nodes, size, own = 0, 1, 0
    prior = None

    def __init__(self, values: AnyArray, gone: tuple[int, ...] = ()) -> None:
        self.unknowns = Unknowns(LAYOUT, np.array([0.3, -0.2]), np.arange(2))
        self.equations: list[Equations] = [Seen(values, ~np.isin(np.arange(TIMES), gone))]
        self.within: list[Any] = []

    @property
    def state(self) -> Task:
        return self

    def stretch(self) -> Any:
        return self

    def undetermined(self, node: int) -> str:
        return "nowhere"

    def move(self, nodes: Any, own: Any) -> None:
        """Nothing is its own."""

    def stepped(self, chain: Any, cofactor: Any) -> bool:
        return False

    def snapshot(self) -> Any:
        raise AssertionError("nobody steps")


def by_time(equations: Equations, linear: Linear) -> AnyArray:
    made = np.zeros((TIMES, 2, TIMES, 2))
    made[np.arange(TIMES), :, np.arange(TIMES)] = np.eye(2)
    return made.reshape(TIMES, 2, -1)


def suspicion(wanders: list[Square], *, apart: bool = True, all_axes: bool = False) -> Alternative:
    suspect = Suspect(by_time, TIMES, 2, wanders, apart=apart)
    return Alternative("jump", suspect, LATER, FALSE_ALARM, lambda one: f"at {one.shape + 4}", all_axes)


def flicker() -> Square:
    start = np.arange(0.0, TIMES)
    return covariance_about_the_mean(start, start + 1.0, (0.0, float(TIMES)))


def found_in(values: AnyArray, *wanders: Square, **how: bool) -> list[Found]:
    return find([Task(values)], [suspicion([*wanders], **how)])


def noise(seed: int) -> AnyArray:
    return SIGMA * np.random.default_rng(seed).standard_normal((TIMES, 2))


@pytest.mark.parametrize("apart", [True, False])
def test_a_jump_is_found_at_its_place_on_its_axis_with_its_size(apart: bool) -> None:
    values = noise(1)
    values[15:, 1] += 3e-3
    (found,) = found_in(values, flicker(), np.eye(TIMES), apart=apart)
    assert found.said == "at 15"
    assert found.axes == (1,)
    assert found.size[0] == found.sigma[0] == 0.0
    # Of sides of 15 and 9 the difference of the means is known to 0.42 of one value; nothing wanders here.
    assert found.sigma[1] == pytest.approx(SIGMA * np.sqrt(1 / 15 + 1 / 9), rel=0.3)
    assert found.size[1] == pytest.approx(3e-3, abs=4.0 * found.sigma[1])


def test_one_jump_on_each_axis_are_two_and_the_rest_is_tested_again() -> None:
    values = noise(2)
    values[8:, 0] -= 5e-3
    values[18:, 1] += 8e-3
    found = found_in(values, np.eye(TIMES))
    assert [(one.said, one.axes) for one in found] == [("at 18", (1,)), ("at 8", (0,))]


def test_what_one_axis_shows_is_sized_on_all_where_it_is_all_of_them() -> None:
    values = noise(3)
    values[10:] += [6e-3, 1e-3]
    (found,) = found_in(values, np.eye(TIMES), all_axes=True)
    assert np.all(found.sigma > 0.0)
    assert found.size == pytest.approx([6e-3, 1e-3], abs=4.0 * float(found.sigma.max()))


def test_what_was_left_out_is_looked_at_too_and_costs_a_second_chance() -> None:
    """All before the jump were left out: what is left shows none."""
    values = noise(4)
    values[5:, 0] += 5e-3
    declared = [suspicion([np.eye(TIMES)])]
    masked = Task(values, gone=(0, 1, 2, 3, 4))
    assert not find([masked], declared)
    (alone,), (found,) = find([Task(values)], declared), find([masked, Task(values)], declared)
    assert found.said == "at 5"
    assert found.probability == pytest.approx(2.0 * alone.probability)


@pytest.mark.parametrize("kind", ["white", "more", "1/f"])
def test_without_a_fault_it_is_believed_no_more_often_than_stated(kind: str) -> None:
    """Of 200 draws 2 are expected at 1 %, and 8 or more have a chance of 0.001."""
    root = np.linalg.cholesky(flicker() + 1e-9 * np.eye(TIMES))
    alarms = 0
    for seed in range(200):
        rng = np.random.default_rng(seed)
        values = SIGMA * rng.standard_normal((TIMES, 2))
        values *= 3.0 if kind == "more" else 1.0
        if kind == "1/f":
            values += 2.0 * SIGMA * root @ rng.standard_normal((TIMES, 2))
        alarms += bool(found_in(values, flicker(), np.eye(TIMES)))
    assert alarms <= 7
