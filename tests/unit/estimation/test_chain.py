"""Chains of nodes with a border, steps, suspicions and crossings, against dense least squares and closed forms."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, strategies as st

from tumble.errors import ConvergenceError, ObservabilityError
from tumble.estimation import Prior
from tumble.estimation.alternatives import Alternative, Suspect, find
from tumble.estimation.chain import Chain, Spread
from tumble.estimation.crossing import crossing
from tumble.estimation.equations import Equations, Linear
from tumble.estimation.solve import ITERATIONS, solve
from tumble.estimation.sums import Whitened
from tumble.estimation.unknowns import Block, Layout, Unknowns
from tumble.estimation.wander import covariance_about_the_mean

Array = npt.NDArray[np.float64]


def white(residual, by_border, node=(), by_node=None, by_next=None):
    """Residuals of unit variance."""
    covariance = np.broadcast_to(
        np.eye(residual.shape[1]), (len(residual), residual.shape[1], residual.shape[1])
    )
    linear = Linear(residual, covariance, by_border, np.asarray(node, dtype=int), by_node, by_next)
    return Whitened.of(Equations(), linear)


def random_chain(seed, nodes, size, border):
    """A chain of random terms of every kind, and the same residuals with their dense derivatives."""
    rng = np.random.default_rng(seed)
    chain = Chain.zero(nodes, size, 0, border)
    dense: list[Array] = []
    residuals: list[Array] = []

    def put(residual, *blocks):
        row = np.zeros((residual.size, nodes * size + border))
        for at, block in blocks:
            row[:, at : at + block.shape[1]] += block
        dense.append(row)
        residuals.append(residual)

    edge = nodes * size
    # two terms of each node: what is added must be added, not put
    at = np.tile(np.arange(nodes), 2)
    r = rng.normal(size=(at.size, size + 1))
    A, B = rng.normal(size=(*r.shape, size)), rng.normal(size=(*r.shape, border))
    chain.add(white(r, B, at, A))
    for t, k in enumerate(at):
        put(r[t], (k * size, A[t]), (edge, B[t]))
    if nodes > 1:
        at = np.concatenate([np.arange(nodes - 1), [0]])
        r = rng.normal(size=(at.size, 3))
        A, N = rng.normal(size=(*r.shape, size)), rng.normal(size=(*r.shape, size))
        B = rng.normal(size=(*r.shape, border))
        chain.add(white(r, B, at, A, N))
        for t, k in enumerate(at):
            put(r[t], (k * size, A[t]), ((k + 1) * size, N[t]), (edge, B[t]))
    r = rng.normal(size=(3, border))
    B = rng.normal(size=(3, border, border))
    chain.add(white(r, B))
    for t in range(3):
        put(r[t], (edge, B[t]))
    return chain, np.vstack(dense), np.concatenate(residuals)


@given(st.integers(0, 2**32 - 1), st.integers(1, 8), st.integers(1, 9), st.integers(1, 6))
def test_solution_covariances_and_decrease_are_those_of_dense_least_squares(seed, nodes, size, border):
    chain, J, r = random_chain(seed, nodes, size, border)
    normal = J.T @ J
    S = np.linalg.inv(normal)
    x = -S @ J.T @ r
    condition = float(np.linalg.cond(normal))
    edge = nodes * size
    # round-off of normal equations grows with their condition
    close = {"rtol": 0.0, "atol": 1e-14 * condition * max(1.0, float(np.abs(x).max()))}
    wide = {"rtol": 0.0, "atol": 1e-14 * condition * float(np.abs(S).max()) * edge}

    made = chain.eliminated()
    z = -np.linalg.solve(made.corner, made.corner_gradient)
    np.testing.assert_allclose(z, x[edge:], **close)
    np.testing.assert_allclose(made.nodes_step(z).ravel(), x[:edge], **close)
    inverse = np.linalg.inv(made.corner)
    np.testing.assert_allclose(inverse, S[edge:, edge:], **wide)
    own_nodes, following_nodes, with_border = Spread(made, inverse).nodes
    for k in range(nodes):
        own = slice(k * size, (k + 1) * size)
        np.testing.assert_allclose(own_nodes[k], S[own, own], **wide)
        np.testing.assert_allclose(with_border[k], S[own, edge:], **wide)
        if k + 1 < nodes:
            following = slice((k + 1) * size, (k + 2) * size)
            np.testing.assert_allclose(following_nodes[k], S[own, following], **wide)
    made.move(z)
    left = float(np.sum((r + J @ x) ** 2))
    assert chain.square_sum == pytest.approx(left, abs=1e-13 * condition * max(1.0, float(r @ r)))


def test_own_unknowns_are_eliminated_as_nodes_are():
    """The border's first two are the chain's own: what is left is the Schur complement of the whole."""
    spoilt, _, _ = random_chain(6, 4, 3, 2)
    spoilt.diagonal[2, 1, :] = spoilt.diagonal[2, :, 1] = 0.0
    with pytest.raises(ObservabilityError, match="Node 3 of 4"):
        spoilt.eliminated()
    chain, J, r = random_chain(11, 4, 3, 5)
    chain.own = 2
    made = chain.eliminated()
    inner, outer = J[:, :14], J[:, 14:]
    Q, _ = np.linalg.qr(inner)
    rest = outer - Q @ (Q.T @ outer)
    np.testing.assert_allclose(made.matrix, rest.T @ rest, atol=1e-10)
    np.testing.assert_allclose(made.right, rest.T @ r, atol=1e-10)
    S = np.linalg.inv(J.T @ J)
    np.testing.assert_allclose(Spread(made, S[14:, 14:]).border, S[12:, 12:], atol=1e-10)
    assert chain.checks == len(J) - 14


def test_whitened_residuals_have_the_chi_square_of_their_covariance():
    rng = np.random.default_rng(9)
    root = rng.normal(size=(6, 3, 3)) + 2.0 * np.eye(3)
    covariance = root @ np.swapaxes(root, 1, 2)
    residual, derivative = rng.normal(size=(6, 3)), rng.normal(size=(6, 3, 4))
    made = Whitened.of(Equations(), Linear(residual, covariance, derivative))
    np.testing.assert_allclose(made.raw, residual)
    for k in range(6):
        inverse = np.linalg.inv(covariance[k])
        np.testing.assert_allclose(made.residual[k] @ made.residual[k], residual[k] @ inverse @ residual[k])
        np.testing.assert_allclose(
            made.by_border[k].T @ made.residual[k], derivative[k].T @ inverse @ residual[k]
        )
    with pytest.raises(np.linalg.LinAlgError):
        Whitened.of(Equations(), Linear(residual, -covariance, derivative))


def test_the_covariance_of_what_is_adjusted_is_the_hat_matrix():
    nodes, size, border = 4, 3, 5
    chain, J, _ = random_chain(10, nodes, size, border)
    made = chain.eliminated()
    spread = Spread(made, np.linalg.inv(made.corner))
    S = np.linalg.inv(J.T @ J)
    row = 0
    for term in chain.terms:
        taken, gain = spread.taken(term), spread.gain(term, border)
        for t in range(len(taken)):
            own = J[row : row + taken.shape[1]]
            np.testing.assert_allclose(taken[t], own @ S @ own.T, atol=1e-9)
            np.testing.assert_allclose(gain[t], S[-border:] @ own.T, atol=1e-9)
            row += taken.shape[1]
    assert row == len(J)


PLACE = Layout((Block("place", ("the place",), ("a look at it",)),))
LOOK = 1e-3


class Bent(Equations):
    """``atan(x - 2)`` seen as nothing: beyond 1.39 from there a Newton step goes further away."""

    kind, cause, place = "bent", "noise", np.array([0])

    def linearise(self, state):
        off = float(state.unknowns.values[0]) - 2.0
        covariance = np.full((1, 1, 1), LOOK**2)
        return [Linear(np.array([[np.arctan(off)]]), covariance, np.full((1, 1, 1), 1.0 / (1.0 + off**2)))]


class Apart(Equations):
    """``x + 1`` and ``x - 1 + bend x²`` seen as nothing: zero is nearest, and a step from x leads to ``bend x``."""

    kind, cause, place = "apart", "noise", np.arange(2)

    def __init__(self, bend):
        self.bend = bend

    def linearise(self, state):
        x = float(state.unknowns.values[0])
        residual = np.array([[x + 1.0], [x - 1.0 + self.bend * x**2]])
        slope = np.array([1.0, 1.0 + 2.0 * self.bend * x])
        return [Linear(residual, np.full((2, 1, 1), LOOK**2), slope[:, None, None])]


class Still:
    """A task of one kind of equations in one recording, where nothing is a node or its own."""

    nodes, size, own = 0, 1, 0
    prior: Prior | None = None

    def __init__(self, seen, unknowns):
        self.equations: list[Equations] = [seen]
        self.within: list[Any] = []
        self.unknowns, self.asked = unknowns, 0

    @property
    def state(self):
        return self

    def stretch(self):
        self.asked += 1
        return self

    def undetermined(self, node):
        return "nowhere"

    def move(self, nodes, own):
        """Nothing is its own."""

    def stepped(self, chain, cofactor):
        return False

    def snapshot(self):
        now = self.unknowns

        def back():
            self.unknowns = now

        return back


def at(start, seen=None):
    return Still(seen or Bent(), Unknowns(PLACE, np.array([start]), np.array([0])))


@pytest.mark.parametrize("start", [2.5, 4.0, -8.0])
def test_it_settles_where_a_whole_step_goes_astray(start):
    task = at(start)
    settled = solve(task)
    assert task.unknowns.values[0] == pytest.approx(2.0, abs=1e-6)
    assert np.sqrt(settled.cofactor[0, 0]) == pytest.approx(LOOK, rel=1e-6)
    assert settled.square_sum == pytest.approx(0.0, abs=1e-6)
    assert settled.redundancy == 0
    assert task.asked < ITERATIONS / 2


@pytest.mark.parametrize("bend", [-0.5, -1.04, -2.0])
def test_it_settles_where_every_step_goes_back_over_the_last_one(bend):
    """Madsen's problem: whole steps from x go to ``bend x``, and round in circles beyond -1."""
    task = at(0.01, Apart(bend))
    solve(task)
    assert task.unknowns.values[0] == pytest.approx(0.0, abs=0.01 * LOOK)
    assert task.asked < 15


def test_one_step_is_a_whole_one():
    task = at(2.5)
    settled = solve(task, once=True)
    assert task.unknowns.values[0] == pytest.approx(2.5 - np.arctan(0.5) * 1.25)
    assert settled.start_sum == pytest.approx((np.arctan(0.5) / LOOK) ** 2)
    assert settled.square_sum == pytest.approx(0.0, abs=1e-9)


def test_what_goes_away_for_ever_is_said():
    """Seen where it cannot be: the square sum falls all the way to infinity."""

    class Away(Bent):
        def linearise(self, state):
            value = float(np.exp(-state.unknowns.values[0]))
            return [Linear(np.array([[value]]), np.full((1, 1, 1), 1e-300), np.full((1, 1, 1), -value))]

    with pytest.raises(ConvergenceError, match=r"^The adjustment "):
        solve(at(0.0, Away()))


LAYOUT = Layout((Block("level", ("first level", "second level"), ("a look", "a look")),))
TIMES = 24
SIGMA = 1e-3
LATER = np.asarray([np.arange(TIMES) >= k for k in range(4, TIMES - 3)], dtype=np.float64)
FALSE_ALARM = 0.01


class Seen(Equations):
    """Two levels, each seen at all times; what is left out counts for nothing."""

    kind, cause = "seen", "noise"
    place = np.arange(TIMES)

    def __init__(self, values, active):
        self.values, self.active = values, active

    def linearise(self, state):
        residual = state.unknowns.values - self.values
        covariance = np.broadcast_to(SIGMA**2 * np.eye(2), (TIMES, 2, 2))
        by_border = np.broadcast_to(np.eye(2), (TIMES, 2, 2))
        return [Linear(residual, covariance, by_border, active=self.active)]


def levels(values, gone=()):
    """Two levels that were seen, from where they need not have settled: all is linear."""
    seen = Seen(values, ~np.isin(np.arange(TIMES), gone))
    return Still(seen, Unknowns(LAYOUT, np.array([0.3, -0.2]), np.arange(2)))


def by_time(equations, linear):
    made = np.zeros((TIMES, 2, TIMES, 2))
    made[np.arange(TIMES), :, np.arange(TIMES)] = np.eye(2)
    return made.reshape(TIMES, 2, -1)


def suspicion(wanders, *, apart=True, all_axes=False):
    suspect = Suspect(by_time, TIMES, 2, wanders, apart=apart)
    return Alternative("jump", suspect, LATER, FALSE_ALARM, lambda one: f"at {one.shape + 4}", all_axes)


def flicker():
    start = np.arange(0.0, TIMES)
    return covariance_about_the_mean(start, start + 1.0, (0.0, float(TIMES)))


def found_in(values, *wanders, **how):
    return find([levels(values)], [suspicion([*wanders], **how)])


def noise(seed):
    return SIGMA * np.random.default_rng(seed).standard_normal((TIMES, 2))


@pytest.mark.parametrize("apart", [True, False])
def test_a_jump_is_found_at_its_place_on_its_axis_with_its_size(apart):
    values = noise(1)
    values[15:, 1] += 3e-3
    (found,) = found_in(values, flicker(), np.eye(TIMES), apart=apart)
    assert found.said == "at 15"
    assert found.axes == (1,)
    assert found.size[0] == found.sigma[0] == 0.0
    # Of sides of 15 and 9 the difference of the means is known to 0.42 of one value; nothing wanders here.
    assert found.sigma[1] == pytest.approx(SIGMA * np.sqrt(1 / 15 + 1 / 9), rel=0.3)
    assert found.size[1] == pytest.approx(3e-3, abs=4.0 * found.sigma[1])


def test_one_jump_on_each_axis_are_two_and_the_rest_is_tested_again():
    values = noise(2)
    values[8:, 0] -= 5e-3
    values[18:, 1] += 8e-3
    found = found_in(values, np.eye(TIMES))
    assert [(one.said, one.axes) for one in found] == [("at 18", (1,)), ("at 8", (0,))]


def test_what_one_axis_shows_is_sized_on_all_where_it_is_all_of_them():
    values = noise(3)
    values[10:] += [6e-3, 1e-3]
    (found,) = found_in(values, np.eye(TIMES), all_axes=True)
    assert np.all(found.sigma > 0.0)
    assert found.size == pytest.approx([6e-3, 1e-3], abs=4.0 * float(found.sigma.max()))


def test_what_was_left_out_is_looked_at_too_and_costs_a_second_chance():
    """All before the jump were left out: what is left shows none."""
    values = noise(4)
    values[5:, 0] += 5e-3
    declared = [suspicion([np.eye(TIMES)])]
    masked = levels(values, gone=(0, 1, 2, 3, 4))
    assert not find([masked], declared)
    (alone,), (found,) = find([levels(values)], declared), find([masked, levels(values)], declared)
    assert found.said == "at 5"
    assert found.probability == pytest.approx(2.0 * alone.probability)


@pytest.mark.parametrize("kind", ["white", "more", "1/f"])
def test_without_a_fault_it_is_believed_no_more_often_than_stated(kind):
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


CROSSINGS: list[tuple[Callable[[float], float], float, float, float]] = [
    (lambda x: x**3 - 2.0, 0.0, 5.0, 2.0 ** (1.0 / 3.0)),
    (lambda x: math.exp(-x) - 0.1, 50.0, -2.0, math.log(10.0)),
    (lambda x: 1.0 if x > 0.3 else -1.0, -4.0, 4.0, 0.3),
    (lambda x: math.log(1e12 / (1.0 + math.exp(2.0 * x))), -20.0, 40.0, 0.5 * math.log(1e12)),
]


@pytest.mark.parametrize(("function", "low", "high", "answer"), CROSSINGS)
def test_a_crossing_is_where_the_sign_changes_and_the_search_ends(function, low, high, answer):
    asked: list[float] = []
    ends = (function(low), function(high))
    found = crossing(lambda x: asked.append(x) or function(x), low, high, ends, 1e-6)
    assert abs(found - answer) < 1e-6
    assert len(asked) <= math.log2(abs(high - low) / 1e-6) + 2
    asked.clear()
    crossing(lambda x: asked.append(x) or math.nan, 0.0, 1.0, (-1.0, 1.0), 1e-9)
    assert len(asked) <= 100
