"""Block-tridiagonal matrices, against dense ones."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tumble.errors import ConvergenceError
from tumble.estimation.block_chain import BlockChain

Array = npt.NDArray[np.float64]


def random_chain(rng: np.random.Generator, groups: int, size: int) -> tuple[Array, Array, Array]:
    """Blocks on and below the diagonal of a positive definite matrix, and the matrix itself."""
    root = np.zeros((groups * size, groups * size))
    for k in range(groups):
        root[k * size : (k + 1) * size, k * size : (k + 1) * size] = rng.standard_normal(
            (size, size)
        ) + 3.0 * np.eye(size)
        if k:
            root[k * size : (k + 1) * size, (k - 1) * size : k * size] = rng.standard_normal((size, size))
    dense = root @ root.T
    cut = [slice(k * size, (k + 1) * size) for k in range(groups)]
    diagonal = np.array([dense[cut[k], cut[k]] for k in range(groups)])
    lower = np.array([dense[cut[k + 1], cut[k]] for k in range(groups - 1)]).reshape(-1, size, size)
    return diagonal, lower, dense


@given(st.integers(0, 2**32 - 1), st.integers(1, 7), st.integers(1, 4))
def test_solving_and_inverting_agree_with_the_dense_matrix(seed: int, groups: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    diagonal, lower, dense = random_chain(rng, groups, size)
    kept = diagonal.copy(), lower.copy()
    chain = BlockChain.factor(diagonal, lower)
    inverse = np.linalg.inv(dense)
    # round-off grows with the condition of the matrix drawn
    tolerance = 1e-14 * np.linalg.cond(dense) * np.abs(inverse).max()
    right = rng.standard_normal((groups, size, 2))
    solved = chain.solve(right)
    np.testing.assert_allclose(
        solved.reshape(-1, 2), inverse @ right.reshape(-1, 2), atol=10 * groups * size * tolerance
    )
    blocks = chain.inverse_diagonal()
    for k in range(groups):
        cut = slice(k * size, (k + 1) * size)
        np.testing.assert_allclose(blocks[k], inverse[cut, cut], atol=10 * tolerance)
    # what was given is left as it was
    assert np.array_equal(diagonal, kept[0])
    assert np.array_equal(lower, kept[1])


def test_without_couplings_the_blocks_stand_alone() -> None:
    diagonal, lower, _ = random_chain(np.random.default_rng(2), 3, 2)
    for chain in (BlockChain.factor(diagonal), BlockChain.factor(diagonal, 0.0 * lower)):
        np.testing.assert_allclose(chain.inverse_diagonal(), np.linalg.inv(diagonal), rtol=1e-12)
        np.testing.assert_allclose(chain.solve(diagonal), np.tile(np.eye(2), (3, 1, 1)), atol=1e-12)


@pytest.mark.parametrize("pivot", [np.diag([1.0, -1.0]), np.zeros((2, 2)), np.full((2, 2), np.nan)])
@pytest.mark.parametrize("coupled", [False, True])
def test_what_is_no_covariance_is_refused(pivot: Array, coupled: bool) -> None:
    diagonal = np.array([pivot, 5.0 * np.eye(2)])
    lower = np.array([[[0.1, 0.2], [0.0, 0.3]]]) if coupled else None
    with pytest.raises(ConvergenceError, match="covariance of the observations is not positive definite"):
        BlockChain.factor(diagonal, lower)


def test_couplings_too_strong_for_a_covariance_are_refused() -> None:
    with pytest.raises(ConvergenceError, match="not positive definite"):
        BlockChain.factor(np.array([np.eye(2), np.eye(2)]), np.array([[[1.5, 0.0], [0.0, 0.0]]]))
