"""Gyros' means at rest are no more uncertain than they differ by: what trembles within a hold suggests far more."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np


def test_parts_that_tremble_do_not_make_means_as_uncertain(play: Callable[..., Any]) -> None:
    """An uncertainty of 1 rad/s is claimed, where twelve means differ by milliradians a second."""
    tumbled = play()
    means = tumbled.means
    trembling = replace(
        tumbled, means=replace(means, angular_rate_covariance=np.tile(np.eye(3), (len(means), 1, 1)))
    )
    variance = np.diagonal(trembling.data().rate_covariance, axis1=1, axis2=2)
    scatter = np.var(means.angular_rate, axis=0, ddof=1)
    assert np.all(variance > scatter)
    assert np.all(variance < 10.0 * scatter)


def test_right_uncertainties_stay(play: Callable[..., Any]) -> None:
    tumbled = play()
    np.testing.assert_array_equal(tumbled.data().rate_covariance, tumbled.means.angular_rate_covariance)
