"""Where north and what latitude the starts of sequences show."""

from __future__ import annotations

import numpy as np
import pytest

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


def starts(turned: float, upwards: float, *, unknown: float = 0.0, count: int = 17) -> list[RecordedSequence]:
    """Starts whose gyros see north `turned` clockwise of what was told, and `upwards` more of the Earth rate."""
    found: list[RecordedSequence] = []
    for row in SEQUENCES[:count]:
        rotation_nb = fixture_rotation(row.inner, row.outer)
        c, s = np.cos(turned), np.sin(turned)
        # clockwise from above: north goes towards east
        seen_n = np.array([c * EARTH_N[0], s * EARTH_N[0], EARTH_N[2] - upwards])
        rate = MATRIX @ rotation_nb.inv().apply(seen_n) + BIAS
        found.append(
            RecordedSequence(
                row.name, list(row.rotations), start_down(row), rotation_nb.inv().apply(EARTH_N), unknown, 0.0,
                0.02, np.zeros((500, 3)), np.tile(rate, (500, 1)), (0, 500), (0, 500),
            )
        )  # fmt: skip
    return found


@pytest.mark.parametrize(("turned", "upwards"), [(0.3, 0.0), (-2.5, 1e-5), (np.pi / 2, -2e-5)])
def test_north_and_the_upward_rate_come_back_with_their_signs(turned: float, upwards: float) -> None:
    """Bias and counts do not matter; the search ends within 1e-7 rad."""
    seen = find_earth(starts(turned, upwards), MODEL, 1e-12)
    assert seen is not None
    assert seen.heading == pytest.approx(turned, abs=1e-6)
    assert seen.vertical == pytest.approx(upwards, abs=1e-11)


def test_uncertainties_are_the_noise_over_what_it_is_seen_against() -> None:
    """North: 17 starts of 10 s against the horizontal Earth rate; noise of 1e-12 rad²/s."""
    seen = find_earth(starts(0.0, 0.0), MODEL, 1e-12)
    assert seen is not None
    expected = np.sqrt(1e-12 / (17 * 10.0)) / (EARTH_RATE * np.cos(LATITUDE))
    assert seen.heading_sigma == pytest.approx(expected, rel=1e-6)
    assert 0.0 < seen.vertical_sigma < 1e-6


def test_nothing_is_said_where_nothing_was_told_or_too_little_is_seen() -> None:
    assert find_earth(starts(0.3, 0.0, unknown=1e-5), MODEL, 1e-12) is None
    assert find_earth(starts(0.3, 0.0, count=3), MODEL, 1e-12) is None


def test_an_earth_rate_that_was_not_told_looks_alike_to_all_three_gyros() -> None:
    """Upwards by one rate, the specific force by g: their ratio on the diagonal, fully correlated."""
    found = earth_as_sensitivity(EARTH_RATE, 9.8)
    size = (EARTH_RATE / 9.8) ** 2
    np.testing.assert_allclose(
        found[np.ix_([0, 4, 8], [0, 4, 8])], size * (1.0 + 0.5 * np.eye(3)), rtol=1e-12
    )
    np.testing.assert_array_equal(earth_as_sensitivity(0.0, 9.8), 0.0)
