"""Where north and what latitude the starts of sequences show."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.arrays import Matrix, Vector
from tumble.calibration.closed_forms.rotation_sequences import SequenceModel, sequence_model
from tumble.calibration.strapdown.recorded_sequences import RecordedSequence
from tumble.calibration.strapdown.start_earth import earth_as_sensitivity, find_earth
from tumble.earth import EARTH_RATE
from tumble.protocol.strapdown_rotation import SEQUENCES, fixture_rotation, start_down
from tumble.sensor import ImuModel, Triad

LATITUDE = np.radians(40.0)
EARTH_N = EARTH_RATE * np.array([np.cos(LATITUDE), 0.0, -np.sin(LATITUDE)])
BIAS = np.array([2e-4, -1e-4, 3e-4])
MATRIX = np.array([[1000.0, 5.0, -3.0], [-4.0, 990.0, 6.0], [2.0, -7.0, 1010.0]])
MODEL = ImuModel(None, Triad(MATRIX, BIAS))


def rests(
    turned: float,
    upwards: float,
    *,
    unknown: float = 0.0,
    count: int = 17,
    sensitivity: Matrix | None = None,
    rng: np.random.Generator | None = None,
) -> tuple[list[RecordedSequence], list[SequenceModel]]:
    """Sequences whose gyros see north `turned` clockwise of what was told, and `upwards` more of the Earth rate."""
    found: list[RecordedSequence] = []
    models: list[SequenceModel] = []
    c, s = np.cos(turned), np.sin(turned)
    # clockwise from above: north goes towards east
    seen_n = np.array([c * EARTH_N[0], s * EARTH_N[0], EARTH_N[2] - upwards])
    for row in SEQUENCES[:count]:
        rotation_nb = fixture_rotation(row.inner, row.outer)
        start = rotation_nb
        for axis, angle in row.rotations:
            rotation_nb = rotation_nb * Rotation.from_rotvec(angle * np.eye(3)[axis])
        shown: list[Vector] = []
        for attitude in (start, rotation_nb):
            rate = attitude.inv().apply(seen_n)
            if sensitivity is not None:
                rate += sensitivity @ attitude.inv().apply([0.0, 0.0, -9.8])
            if rng is not None:
                rate += np.sqrt(1e-12 / 10.0) * rng.standard_normal(3)
            shown.append(MATRIX @ rate + BIAS)
        found.append(
            RecordedSequence(
                row.name, list(row.rotations), start_down(row), start.inv().apply(EARTH_N), unknown, 0.0,
                0.02, np.zeros((1000, 3)), np.repeat(shown, 500, axis=0), (0, 500), (500, 1000),
            )
        )  # fmt: skip
        models.append(sequence_model(found[-1].rotations, found[-1].down_start, 9.8, rate=1.0, seconds=10.0))
    return found, models


@pytest.mark.parametrize(("turned", "upwards"), [(0.3, 0.0), (-2.5, 1e-5), (np.pi / 2, -2e-5)])
def test_north_and_the_upward_rate_come_back_with_their_signs(turned: float, upwards: float) -> None:
    """Bias and counts do not matter; the equations are linear."""
    seen = find_earth(*rests(turned, upwards), MODEL, 1e-12)
    assert seen.heading == pytest.approx(turned, abs=1e-6)
    np.testing.assert_allclose(seen.sensitivity, upwards * np.eye(3), atol=1e-11)


def test_the_uncertainty_is_the_scatter_of_draws_with_noise() -> None:
    """34 rests of 10 s, noise of 1e-12 rad²/s: 120 draws, whose scatter is within 25 % of its own sigma."""
    rng = np.random.default_rng(5)
    headings: list[float] = []
    upwards: list[float] = []
    stated: list[list[float]] = []
    one = np.eye(3).ravel() / 3.0
    for _ in range(120):
        seen = find_earth(*rests(0.0, 0.0, rng=rng), MODEL, 1e-12)
        headings.append(seen.heading)
        upwards.append(float(one @ seen.sensitivity.ravel()))
        stated.append([seen.heading_sigma, float(np.sqrt(one @ seen.covariance @ one))])
    heading_sigma, upward_sigma = np.median(stated, axis=0)
    assert np.sqrt(np.mean(np.square(headings))) == pytest.approx(heading_sigma, rel=0.25)
    assert np.sqrt(np.mean(np.square(upwards))) == pytest.approx(upward_sigma, rel=0.25)


def test_a_g_sensitivity_is_no_heading() -> None:
    """A consumer gyro's g-sensitivity is a hundred times the Earth rate."""
    sensitivity = 1e-3 * np.array([[1.0, -0.4, 0.2], [0.3, -0.8, 0.5], [-0.6, 0.1, 0.7]])
    seen = find_earth(*rests(0.0, 0.0, sensitivity=sensitivity), MODEL, 1e-12)
    assert abs(seen.heading) < 1e-6
    np.testing.assert_allclose(seen.sensitivity, 9.8 * sensitivity, rtol=1e-9)


def test_nothing_is_said_where_nothing_was_told_or_too_little_is_seen() -> None:
    assert find_earth(*rests(0.3, 0.0, unknown=1e-5), MODEL, 1e-12) is None
    assert find_earth(*rests(0.3, 0.0, count=2), MODEL, 1e-12) is None


def test_an_earth_rate_that_was_not_told_looks_alike_to_all_three_gyros() -> None:
    """Upwards by one rate, the specific force by g: their ratio on the diagonal, fully correlated."""
    found = earth_as_sensitivity(EARTH_RATE, 9.8)
    size = (EARTH_RATE / 9.8) ** 2
    np.testing.assert_allclose(
        found[np.ix_([0, 4, 8], [0, 4, 8])], size * (1.0 + 0.5 * np.eye(3)), rtol=1e-12
    )
    np.testing.assert_array_equal(earth_as_sensitivity(0.0, 9.8), 0.0)
