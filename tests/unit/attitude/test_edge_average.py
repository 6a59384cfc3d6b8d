"""The mean of a window at the edge of a hold, every sample turned to the edge."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation

from tumble.attitude.integration import Inverse, average_at_edge

Array = npt.NDArray[np.float64]

GYRO_INVERSE = np.array([[0.9, 0.03, -0.05], [0.02, 1.1, 0.04], [-0.06, 0.01, 0.8]])
FORCE_INVERSE = np.array([[1.2, -0.02, 0.04], [0.05, 0.9, 0.01], [-0.03, 0.06, 1.1]])
FORCE_BIAS = np.array([-0.11, 0.05, 0.08])
SIZE = 400
TIME = np.arange(SIZE) / 100.0
OMEGA = np.array([0.02, -0.05, 0.03])  # rad/s: a tremor's size
GRAVITY_0 = np.array([2.0, -3.0, 9.0])


def swaying(biases: Array, windows: list[tuple[int, int]]) -> tuple[Array, Array, Array]:
    """Raw rate, raw force and true force of a unit that turns slowly in a constant field."""
    forces = Rotation.from_rotvec(TIME[:, None] * OMEGA).inv().apply(GRAVITY_0)
    raw_force = forces @ np.linalg.inv(FORCE_INVERSE).T + FORCE_BIAS
    raw_rate = np.tile(OMEGA, (SIZE, 1)) @ np.linalg.inv(GYRO_INVERSE).T
    for bias, (start, stop) in zip(biases, windows, strict=True):
        raw_rate[start:stop] += bias
    return raw_rate, raw_force, forces


def averaged(
    raw_rate: Array,
    raw_force: Array,
    windows: list[tuple[int, int]],
    edge: Literal["first", "last"] = "last",
    biases: Array | None = None,
) -> Array:
    biases = np.zeros((len(windows), 3)) if biases is None else biases
    inverse = Inverse(GYRO_INVERSE, biases, FORCE_INVERSE, FORCE_BIAS)
    return average_at_edge(TIME, raw_rate, raw_force, np.array(windows), inverse, edge)


@pytest.mark.parametrize("edge", ["first", "last"])
def test_each_window_has_its_own_bias(edge: Literal["first", "last"]) -> None:
    windows = [(0, 200), (200, 400)]
    biases = np.array([[0.3, -0.1, 0.2], [-0.2, 0.4, 0.1]])
    raw_rate, raw_force, forces = swaying(biases, windows)
    means = averaged(raw_rate, raw_force, windows, edge, biases)
    index = [start if edge == "first" else stop - 1 for start, stop in windows]
    np.testing.assert_allclose(means, forces[index], atol=1e-12)
    swapped = averaged(raw_rate, raw_force, windows, edge, biases[::-1].copy())
    assert np.all(np.linalg.norm(swapped - forces[index], axis=1) > 0.1)


def test_a_range_outside_and_a_missing_bias_are_refused() -> None:
    raw_rate, raw_force, _ = swaying(np.zeros((1, 3)), [(0, 200)])
    for window in [(-1, 5), (390, 401), (5, 5)]:
        with pytest.raises(IndexError, match="inside 0 to 400"):
            averaged(raw_rate, raw_force, [window])
    with pytest.raises(ValueError, match="2 windows want as many gyro biases"):
        averaged(raw_rate, raw_force, [(0, 5), (5, 9)], biases=np.zeros((1, 3)))
