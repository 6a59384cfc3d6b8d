"""A chain with a border, against dense least squares of the same residuals."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tumble.calibration.equations.stretches import RotationStretch, SectionStretch
from tumble.errors import ObservabilityError
from tumble.estimation.chain import Chain, Place, Spread
from tumble.estimation.equations import Equations, Linear
from tumble.estimation.sums import Whitened

Array = npt.NDArray[np.float64]


def white(residual: Array, by_border: Array, node=(), by_node=None, by_next=None) -> Whitened:
    """Residuals of unit variance."""
    covariance = np.broadcast_to(
        np.eye(residual.shape[1]), (len(residual), residual.shape[1], residual.shape[1])
    )
    linear = Linear(residual, covariance, by_border, np.asarray(node, dtype=int), by_node, by_next)
    return Whitened.of(Equations(), linear)


def random_chain(seed: int, nodes: int, size: int, border: int) -> tuple[Chain, Array, Array]:
    """A chain of random terms of every kind, and the same residuals with their dense derivatives."""
    rng = np.random.default_rng(seed)
    chain = Chain.zero(nodes, size, 0, border)
    dense: list[Array] = []
    residuals: list[Array] = []

    def put(residual: Array, *blocks: tuple[int, Array]) -> None:
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
def test_solution_covariances_and_decrease_are_those_of_dense_least_squares(
    seed: int, nodes: int, size: int, border: int
) -> None:
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


def test_a_node_that_nothing_determines_is_named() -> None:
    """Third of four: its diagonal has one direction too few."""
    chain, _, _ = random_chain(6, 4, 3, 2)
    chain.diagonal[2, 1, :] = chain.diagonal[2, :, 1] = 0.0
    with pytest.raises(ObservabilityError, match="Node 3 of 4"):
        chain.eliminated()


def test_own_unknowns_are_eliminated_as_nodes_are() -> None:
    """The border's first two are the chain's own: what is left is the Schur complement of the whole."""
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


def test_whitened_residuals_have_the_chi_square_of_their_covariance() -> None:
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


def test_the_covariance_of_what_is_adjusted_is_the_hat_matrix() -> None:
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


def test_people_are_told_the_hold_and_its_seconds() -> None:
    base = SimpleNamespace(
        time=100.0 + 0.5 * np.arange(60),
        head=np.array([[0, 4], [20, 24]]),
        tail=np.array([[6, 10], [40, 44]]),
    )
    task: Any = SimpleNamespace(data=SimpleNamespace(base=base))
    holds: Any = SimpleNamespace(holds=np.array([1]))
    section, rotation = SectionStretch.__new__(SectionStretch), RotationStretch.__new__(RotationStretch)
    section.task, section.section = task, holds
    rotation.task, rotation.k = task, 0
    assert "in hold 2 (10.0 to 21.5 s)" in section.undetermined(0)
    assert "in the rotation after hold 1 (5.0 to 9.5 s)" in rotation.undetermined(3)
    chain, _, _ = random_chain(6, 4, 3, 2)
    chain.stretch = section
    chain.diagonal[0, 1, :] = chain.diagonal[0, :, 1] = 0.0
    with pytest.raises(ObservabilityError, match=r"attitude in hold 2 \(10\.0 to 21\.5 s\)"):
        chain.eliminated()


class Drawn(Equations):
    """Random terms: of each node, of all pairs of neighbours, and of the border; not all of them take part."""

    def __init__(self, seed: int, nodes: int, border: int) -> None:
        rng = np.random.default_rng(seed)
        at = np.tile(np.arange(nodes), 2)
        self.made = [
            self._linear(rng, at, 4, border, 3, 0),
            self._linear(rng, np.zeros(0, int), 2, border, 0, 0),
        ]
        self.made[0].active = rng.random(at.size) < 0.7 if seed % 2 else None
        # As many residuals a term as the number of nodes says, so that not all chains have as many.
        self.made.append(self._linear(rng, np.zeros(0, int), nodes, border, 0, 0))
        if nodes > 1:
            self.made.append(self._linear(rng, np.arange(nodes - 1), 3, border, 3, 3))

    @staticmethod
    def _linear(rng: Any, node: Array, m: int, border: int, size: int, following: int) -> Linear:
        terms = node.size or border + 5
        root = rng.normal(size=(terms, m, m)) + 3.0 * np.eye(m)
        by_node, by_next = (rng.normal(size=(terms, m, n)) if n else None for n in (size, following))
        covariance, by_border = root @ np.swapaxes(root, 1, 2), rng.normal(size=(terms, m, border))
        return Linear(rng.normal(size=(terms, m)), covariance, by_border, node, by_node, by_next)

    def linearise(self, state: Any) -> list[Linear]:
        return self.made


class Held:
    """A stretch of drawn terms, and what it was moved by."""

    size = 3

    def __init__(self, seed: int, nodes: int, own: int, outside: int, within: Any = ()) -> None:
        self.nodes, self.own, self.within = nodes, own, within
        self.equations = [Drawn(seed, nodes, own + outside), Drawn(seed + 1, nodes, own + outside)]
        self.moved: list[Array] = []

    def undetermined(self, node: int) -> str:
        return f"node {node} of {self.nodes}"

    def move(self, nodes: Array, own: Array) -> None:
        self.moved = [nodes, own]


def test_chains_side_by_side_are_the_chains_alone() -> None:
    """Three of one shape and one of another lie in a chain; each as if it had been made by itself."""
    places = [Place(k, slice(0, 2), slice(1, 3)) for k in range(4)]
    shapes = [(20, 4, 2), (30, 1, 2), (41, 3, 2), (50, 2, 1)]
    inners = [Held(seed, nodes, own, 4 + 6) for seed, nodes, own in shapes]
    whole = Chain.of(Held(10, 5, 1, 5, [*zip(places, inners, strict=True)]), None, 5)
    parts = [Chain.of(inner, None, 4 + 6) for inner in inners]
    joined = Chain.of(Held(10, 5, 1, 5), None, 5)
    for place, part in zip(places, parts, strict=True):
        joined.join(place, part.eliminated())
    assert len({id(inner.chain.sums) for _, inner in whole.within}) == 2
    assert whole.checks == joined.checks
    made, expected = whole.eliminated(), joined.eliminated()
    np.testing.assert_allclose(made.matrix, expected.matrix, rtol=1e-12)
    np.testing.assert_allclose(made.right, expected.right, rtol=1e-12, atol=1e-12)
    assert whole.square_sum == pytest.approx(joined.square_sum, rel=1e-13)
    step = np.array([0.3, -0.1, 0.7, 0.2, -0.5])
    expected.move(step, 0.5)
    moved = [inner.moved for inner in inners]
    made.move(step, 0.5)
    assert whole.square_sum == pytest.approx(joined.square_sum, rel=1e-12)
    for inner, before in zip(inners, moved, strict=True):
        for now, then in zip(inner.moved, before, strict=True):
            np.testing.assert_allclose(now, then, rtol=1e-11, atol=1e-13)
    for (_, one), part in zip(whole.within, parts, strict=True):
        for term, alone in zip(one.chain.terms, part.terms, strict=True):
            np.testing.assert_array_equal(term.linear.node, alone.linear.node)
            np.testing.assert_allclose(term.residual, alone.residual, rtol=1e-11, atol=1e-12)
    with pytest.raises(ValueError, match="move together"):
        whole.within[0][1].move(np.zeros(10))
