"""What arrays of all rooms share."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.arrays import block_means, extremes


@pytest.mark.parametrize("shape", [(23,), (23, 3), (23, 2, 4), (4, 3), (0, 3)])
def test_means_of_blocks_are_the_means_of_their_rows(shape: tuple[int, ...]) -> None:
    values = np.random.default_rng(1).normal(5.0, 1.0, shape)
    means = block_means(values, 5)
    assert means.shape == (shape[0] // 5, *shape[1:])
    for k, mean in enumerate(means):
        assert np.allclose(mean, values[5 * k : 5 * k + 5].mean(axis=0), rtol=1e-15, atol=0.0)


def test_extremes_are_of_each_axis() -> None:
    values = np.array([[1.0, -2.0, 3.0], [0.5, 7.0, -3.0]])
    low, high = extremes(values)
    assert low.tolist() == [0.5, -2.0, -3.0]
    assert high.tolist() == [1.0, 7.0, 3.0]
