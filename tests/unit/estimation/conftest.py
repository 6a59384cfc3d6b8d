"""Small adjustments with known answers, for the tests of this folder."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from tumble.estimation import Linearisation

Array = npt.NDArray[np.float64]


class LineWithErrorsInBoth:
    """y = intercept + slope x, both coordinates observed with independent errors; one condition a point."""

    def __init__(self, x: Array, y: Array, variance_x: Array, variance_y: Array) -> None:
        self.observed = np.column_stack([x, y])
        self.variance = np.column_stack([variance_x, variance_y])
        self.adjusted = self.observed.copy()
        self.by_observed = np.zeros_like(self.observed)

    def linearise(self, parameters: Array) -> Linearisation:
        intercept, slope = parameters
        x, y = self.adjusted.T
        self.by_observed = np.column_stack([np.full(x.size, -slope), np.ones(x.size)])
        misclosure = y - intercept - slope * x
        misclosure = misclosure + np.sum(self.by_observed * (self.observed - self.adjusted), axis=1)
        design = np.column_stack([-np.ones(x.size), -x])
        variance = np.sum(self.by_observed**2 * self.variance, axis=1)
        active = np.ones((x.size, 1), dtype=bool)
        return Linearisation(misclosure[:, None], design[:, None, :], variance[:, None, None], active)

    def adjust_observations(self, multipliers: Array) -> None:
        self.adjusted = self.observed - self.variance * self.by_observed * multipliers


class LinearModel:
    """A xi - y = e, in groups: what weighted least squares solves in one step."""

    def __init__(
        self,
        design: Array,
        observed: Array,
        covariance: Array,
        active: npt.NDArray[np.bool_] | None = None,
    ) -> None:
        self.design, self.observed, self.covariance = design, observed, covariance
        self.active = np.ones(observed.shape, dtype=bool) if active is None else active

    def linearise(self, parameters: Array) -> Linearisation:
        misclosure = self.design @ parameters - self.observed
        return Linearisation.masked(misclosure, self.design, self.covariance, self.active)

    def adjust_observations(self, multipliers: Array) -> None:
        """Linear in parameters and observations: there is nothing to relinearise."""

    def dense_covariance(self) -> Array:
        groups, size = self.observed.shape
        dense = np.zeros((groups * size, groups * size))
        for k in range(groups):
            own = slice(k * size, (k + 1) * size)
            dense[own, own] = self.covariance[k]
        return dense


def draw_linear_model(seed: int, groups: int = 8, size: int = 3, parameters: int = 4) -> LinearModel:
    """A linear model whose conditions share noise within a group, with noise drawn from that covariance."""
    rng = np.random.default_rng(seed)
    own = 0.5 * rng.standard_normal((groups, size, size)) + 2.0 * np.eye(size)
    errors = np.einsum("gst,gt->gs", own, rng.standard_normal((groups, size)))
    design = rng.standard_normal((groups, size, parameters))
    truth = np.arange(1.0, parameters + 1.0)
    return LinearModel(design, design @ truth + errors, own @ np.swapaxes(own, 1, 2))


@pytest.fixture
def linear_model() -> type[LinearModel]:
    return LinearModel


@pytest.fixture
def random_linear_model() -> Callable[..., LinearModel]:
    return draw_linear_model


@pytest.fixture
def line_with_errors_in_both() -> type[LineWithErrorsInBoth]:
    return LineWithErrorsInBoth
