"""A chain with a border, against dense least squares of the same residuals."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tumble.estimation.bordered import BorderedChain, whiten
from tumble.estimation.gathered import GatheringChain

from tumble.errors import ObservabilityError

Array = npt.NDArray[np.float64]


def random_chain(seed: int, nodes: int, size: int, border: int) -> tuple[BorderedChain, Array, Array]:
    """A chain of random terms of every kind, and the same residuals with their dense derivatives."""
    rng = np.random.default_rng(seed)
    chain = BorderedChain.zero(nodes, size, border)
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
    chain.add_unary(at, r, A, B)
    for t, k in enumerate(at):
        put(r[t], (k * size, A[t]), (edge, B[t]))
    if nodes > 1:
        at = np.concatenate([np.arange(nodes - 1), [0]])
        r = rng.normal(size=(at.size, 3))
        A, N = rng.normal(size=(*r.shape, size)), rng.normal(size=(*r.shape, size))
        B = rng.normal(size=(*r.shape, border))
        chain.add_links(at, r, A, N, B)
        for t, k in enumerate(at):
            put(r[t], (k * size, A[t]), ((k + 1) * size, N[t]), (edge, B[t]))
    r = rng.normal(size=(3, border))
    B = rng.normal(size=(3, border, border))
    chain.add_border(r, B)
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
    np.testing.assert_allclose(made.steps(z).ravel(), x[:edge], **close)
    inverse = np.linalg.inv(made.corner)
    np.testing.assert_allclose(inverse, S[edge:, edge:], **wide)
    covariance = made.covariance(inverse)
    for k in range(nodes):
        own = slice(k * size, (k + 1) * size)
        np.testing.assert_allclose(covariance.own[k], S[own, own], **wide)
        np.testing.assert_allclose(covariance.with_border[k], S[own, edge:], **wide)
        if k + 1 < nodes:
            following = slice((k + 1) * size, (k + 2) * size)
            np.testing.assert_allclose(covariance.following[k], S[own, following], **wide)
    # `decrease` leaves out what the border's own share of the square sum is at rest: z of zero is the nodes' alone
    fall = float(r @ r - np.sum((r + J @ x) ** 2))
    assert made.decrease(z) == pytest.approx(fall, abs=1e-13 * condition * max(1.0, fall))


@given(st.integers(0, 2**32 - 1), st.integers(2, 6))
def test_with_the_border_held_the_nodes_alone_decrease_the_square_sum(seed: int, nodes: int) -> None:
    chain, J, r = random_chain(seed, nodes, 3, 4)
    A = J[:, : 3 * nodes]
    x = -np.linalg.solve(A.T @ A, A.T @ r)
    made = chain.eliminated()
    np.testing.assert_allclose(made.steps(np.zeros(4)).ravel(), x, atol=1e-13 * np.linalg.cond(A.T @ A))
    fall = float(r @ r - np.sum((r + A @ x) ** 2))
    assert made.decrease(np.zeros(4)) == pytest.approx(fall, rel=1e-10)


def test_eliminating_leaves_the_equations_as_they_are() -> None:
    chain, _, _ = random_chain(5, 4, 3, 2)
    kept = [a.copy() for a in (chain.diagonal, chain.lower, chain.border, chain.gradient, chain.corner)]
    chain.eliminated()
    now = (chain.diagonal, chain.lower, chain.border, chain.gradient, chain.corner)
    assert all(np.array_equal(a, b) for a, b in zip(kept, now, strict=True))


def test_a_node_that_nothing_determines_is_named() -> None:
    """Third of four: its diagonal has one direction too few."""
    chain, _, _ = random_chain(6, 4, 3, 2)
    chain.diagonal[2, 1, :] = chain.diagonal[2, :, 1] = 0.0
    with pytest.raises(ObservabilityError, match="Node 3 of 4"):
        chain.eliminated()


def test_a_chain_in_a_chain_is_the_chain_of_both() -> None:
    """What is left of a chain's border may be added to another's: a table's rotation in a section of holds."""
    first, J1, r1 = random_chain(7, 3, 3, 4)
    second, J2, r2 = random_chain(8, 5, 2, 4)
    made = first.eliminated()
    second.corner += made.corner
    second.corner_gradient += made.corner_gradient
    z = second.eliminated()
    z = -np.linalg.solve(z.corner, z.corner_gradient)
    J = np.zeros((len(J1) + len(J2), 9 + 10 + 4))
    J[: len(J1), :9], J[: len(J1), 19:] = J1[:, :9], J1[:, 9:]
    J[len(J1) :, 9:19], J[len(J1) :, 19:] = J2[:, :10], J2[:, 10:]
    x = -np.linalg.lstsq(J, np.concatenate([r1, r2]), rcond=None)[0]
    np.testing.assert_allclose(z, x[19:], atol=1e-10)


def test_whitened_residuals_have_the_chi_square_of_their_covariance() -> None:
    rng = np.random.default_rng(9)
    root = rng.normal(size=(6, 3, 3)) + 2.0 * np.eye(3)
    covariance = root @ np.swapaxes(root, 1, 2)
    residual, derivative = rng.normal(size=(6, 3)), rng.normal(size=(6, 3, 4))
    white, by = whiten(covariance, residual[..., None], derivative)
    for k in range(6):
        inverse = np.linalg.inv(covariance[k])
        np.testing.assert_allclose(white[k, :, 0] @ white[k, :, 0], residual[k] @ inverse @ residual[k])
        np.testing.assert_allclose(by[k].T @ white[k, :, 0], derivative[k].T @ inverse @ residual[k])
    with pytest.raises(np.linalg.LinAlgError):
        whiten(-covariance, residual[..., None])


def test_terms_that_are_kept_one_by_one_tell_the_covariance_of_what_is_adjusted() -> None:
    """``taken`` of all terms is the diagonal of the hat matrix, whose trace is the number of unknowns."""
    nodes, size, border = 4, 3, 5
    chain, J, r = random_chain(10, nodes, size, border)
    kept = GatheringChain.of(size, border)
    rng = np.random.default_rng(10)
    at = np.tile(np.arange(nodes), 2)
    shape = rng.normal(size=(at.size, size + 1)).shape
    A, B = rng.normal(size=(*shape, size)), rng.normal(size=(*shape, border))
    kept.add_unary(at, np.zeros(shape), A, B)
    made = chain.eliminated()
    inverse = np.linalg.inv(made.corner)
    taken = kept.terms[0].taken(made.covariance(inverse), inverse)
    S = np.linalg.inv(J.T @ J)
    for t in range(at.size):
        rows = slice(t * (size + 1), (t + 1) * (size + 1))
        np.testing.assert_allclose(taken[t], J[rows] @ S @ J[rows].T, atol=1e-10)
    assert r.size == len(J)
