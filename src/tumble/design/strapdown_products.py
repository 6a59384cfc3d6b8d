"""Products of two errors, which the first-order formulas of the strapdown rotation test leave out."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from tumble.arrays import AnyArray, Series, Table
from tumble.design.error_budget import ErrorSource
from tumble.design.strapdown_effects import after_play_back
from tumble.design.strapdown_play import SENSORS, SHARED, error_count, play_exactly
from tumble.design.strapdown_sequences import TimedSequence
from tumble.design.strapdown_setup import StrapdownSetup
from tumble.protocol.strapdown_rotation import RotationSequence


def product_effects(
    setup: StrapdownSetup, sequences: list[TimedSequence], gain: list[Table], left: Series
) -> tuple[Table, list[ErrorSource]]:
    """Return (24, 3) one sigma of the parameters by products of errors that (3) to (5) leave out, and their sources.

    Two errors are played together and each alone, in all four combinations of signs: what the two together do
    beyond each alone is their product, also where an asymmetry makes it depend on signs.

    Parameters
    ----------
    setup, sequences : the test.
    gain : of `measurement_gain`.
    left : (24,) one sigma of the sensor errors in the pass.
    """
    fixture = setup.fixture
    angles = np.array([fixture.mounting] * 3 + [fixture.installation] * 2)
    spreads = setup.sensors.spreads()
    before = np.concatenate([spreads, angles])
    shrunk = np.concatenate([left / np.where(spreads > 0.0, spreads, 1.0), np.ones(len(angles))])
    variance = np.zeros((SENSORS, 3))
    common_pairs, common_squares = np.zeros((4, SENSORS, SHARED, SHARED)), np.zeros((SENSORS, SHARED))
    means = np.zeros((SENSORS, 3))
    for sequence, one_gain in zip(sequences, gain, strict=True):
        stops = np.full(error_count(sequence.row) - SHARED, fixture.execution)
        sizes = np.concatenate([before, stops])
        pairs, squares = _interactions(sequence.row, tuple(sizes.tolist()), setup.site.gravity, setup.norm)
        # Products scale with their factors: one playing serves all passes.
        scale = np.concatenate([shrunk, np.ones(len(stops))])
        carried = np.einsum("pm,sjkm,j,k->spjk", one_gain, pairs, scale, scale, optimize=True)
        own = one_gain @ (squares * scale[:, None] ** 2).T
        common_pairs += carried[:, :, :SHARED, :SHARED]
        common_squares += own[:, :SHARED]
        # A sequence's own errors, which no other has: the fixture's stops.
        for k in range(SHARED, len(scale)):
            _add_pairs(variance, carried[:, :, :k, k])
        variance[:, 2] += 2.0 * np.sum(own[:, SHARED:] ** 2, axis=1)
        means[:, 2] += np.sum(own[:, SHARED:], axis=1)
    for k in range(SHARED):
        _add_pairs(variance, common_pairs[:, :, :k, k], sensor=k < SENSORS)
    # A square d z² has the mean d and the variance 2 d²; the means of all add up.
    for kind, at in ((1, slice(0, SENSORS)), (2, slice(SENSORS, SHARED))):
        variance[:, kind] += 2.0 * np.sum(common_squares[:, at] ** 2, axis=1)
        means[:, kind] += np.sum(common_squares[:, at], axis=1)
    variance += means**2
    return np.sqrt(variance), _product_sources(setup, angles, left)


def _product_sources(setup: StrapdownSetup, angles: Series, left: Series) -> list[ErrorSource]:
    """The sources in words, with sizes."""
    angle = max(float(np.sqrt(np.mean(angles**2))), setup.fixture.execution)
    after = after_play_back(setup)
    left_rms = float(np.sqrt(np.mean(left[:9] ** 2)))
    vertical = "the vertical is projected on the nominal one: half the angle's square is lost"
    return [
        ErrorSource(
            "fixture × sensor errors",
            "sensors with errors on a fixture that is off" + after,
            angle,
            "rad",
            "fixture",
        ),
        ErrorSource(
            "sensor errors, squared",
            "products of sensor errors that the formulas leave out" + after,
            left_rms,
            "1",
            "method",
        ),
        ErrorSource("fixture, squared", vertical, 0.0 if setup.norm else angle, "rad", "fixture"),
    ]


@lru_cache(maxsize=64)
def _interactions(
    row: RotationSequence, sizes: tuple[float, ...], gravity: float, norm: bool
) -> tuple[AnyArray, Table]:
    """(4, n, n, 5) of pairs by combination of signs, upper triangle, and (n, 5) of each error with itself."""
    size, count = np.array(sizes), len(sizes)
    first, second = np.triu_indices(count, 1)
    signs = ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
    alone = np.concatenate([np.diag(size), -np.diag(size)])
    both: list[Table] = []
    for one, other in signs:
        errors = np.zeros((len(first), count))
        at = np.arange(len(first))
        errors[at, first], errors[at, second] = one * size[first], other * size[second]
        both.append(errors)
    played = play_exactly(row, np.concatenate([alone, *both]), gravity, norm=norm)
    by_sign = {1.0: played[:count], -1.0: played[count : 2 * count]}
    pairs = np.zeros((4, count, count, 5))
    for k, (one, other) in enumerate(signs):
        part = played[2 * count + k * len(first) : 2 * count + (k + 1) * len(first)]
        pairs[k, first, second] = part - by_sign[one][first] - by_sign[other][second]
    return pairs, 0.5 * (by_sign[1.0] + by_sign[-1.0])


def _add_pairs(variance: Table, products: AnyArray, *, sensor: bool = False) -> None:
    """Add products (4, 24, n) of one error with n before it, each to its source; `sensor` says what the one is."""
    squares = np.mean(products**2, axis=0)
    variance[:, 1 if sensor else 0] += np.sum(squares[:, :SENSORS], axis=1)
    variance[:, 2] += np.sum(squares[:, SENSORS:], axis=1)
