"""Products of two errors, which the first-order formulas of the strapdown rotation test leave out."""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Series, Table
from tumble.design.error_budget import ErrorSource
from tumble.design.strapdown_effects import after_play_back
from tumble.design.strapdown_play import SENSORS, SHARED, error_count, play_exactly
from tumble.design.strapdown_sequences import TimedSequence
from tumble.design.strapdown_setup import StrapdownSetup


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
    shared = np.concatenate([left, np.full(3, fixture.mounting), np.full(2, fixture.installation)])
    variance = np.zeros((SENSORS, 3))
    common_pairs, common_squares = np.zeros((4, SENSORS, SHARED, SHARED)), np.zeros((SENSORS, SHARED))
    means = np.zeros((SENSORS, 3))
    for sequence, one_gain in zip(sequences, gain, strict=True):
        sizes = np.concatenate([shared, np.full(error_count(sequence.row) - SHARED, fixture.execution)])
        pairs, squares = _interactions(sequence, sizes, setup)
        carried, own = np.einsum("pm,sjkm->spjk", one_gain, pairs), one_gain @ squares.T
        common_pairs += carried[:, :, :SHARED, :SHARED]
        common_squares += own[:, :SHARED]
        # A sequence's own errors, which no other has: the fixture's stops.
        for k in range(SHARED, len(sizes)):
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
    angle = max(float(np.sqrt(np.mean(shared[SENSORS:] ** 2))), fixture.execution)
    after = after_play_back(setup)
    left_rms = float(np.sqrt(np.mean(left[:9] ** 2)))
    vertical = "the vertical is projected on the nominal one: half the angle's square is lost"
    sources = [
        ErrorSource(
            "fixture × sensor errors",
            "sensors with errors on a fixture that is off" + after,
            angle,
            "rad",
            "fixture",
        ),
        ErrorSource(
            "sensor errors × each other",
            "products that the formulas leave out" + after,
            left_rms,
            "1",
            "method",
        ),
        ErrorSource("fixture, squared", vertical, 0.0 if setup.norm else angle, "rad", "fixture"),
    ]
    return np.sqrt(variance), sources


def _interactions(sequence: TimedSequence, sizes: Series, setup: StrapdownSetup) -> tuple[AnyArray, Table]:
    """(4, n, n, 5) of pairs by combination of signs, upper triangle, and (n, 5) of each error with itself."""
    count = len(sizes)
    first, second = np.triu_indices(count, 1)
    signs = ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
    alone = np.concatenate([np.diag(sizes), -np.diag(sizes)])
    both: list[Table] = []
    for one, other in signs:
        errors = np.zeros((len(first), count))
        at = np.arange(len(first))
        errors[at, first], errors[at, second] = one * sizes[first], other * sizes[second]
        both.append(errors)
    played = play_exactly(sequence.row, np.concatenate([alone, *both]), setup.site.gravity, norm=setup.norm)
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
