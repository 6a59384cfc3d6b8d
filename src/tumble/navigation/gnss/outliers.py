"""Positions that do not fit a receiver's own velocities: outliers, found before any filter."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Vectors
from tumble.navigation.gnss.track import GnssTrack
from tumble.navigation.trajectory import position_differences

# s for which all fixes may be outliers, and how many fixes that is at most and at least.
_LONGEST, _MOST, _FEWEST = 30.0, 300, 10
# By how much velocities may be off beside their noise, m/s: one in the middle of a turn stands for a whole interval.
_SLACK = 0.3
# Receivers' velocities may be late by this, s.
_LATE = 0.5
_SIGMAS = 5.0
# Of fewer fixes in one chain than this share nothing is said.
_LEAST = 0.5


def fit_velocities(track: GnssTrack) -> np.ndarray:
    """Return (fixes,) which positions fit one another by the velocities between them: the longest chain that does.

    Parameters
    ----------
    track : in time order. Without velocities, or where no chain holds half of the fixes, all are said to fit.
    """
    fixes = len(track)
    if fixes < 3 or not track.has_velocity.all():
        return np.ones(fixes, dtype=bool)
    step = np.diff(track.time)
    middle = 0.5 * (track.velocity_n[1:] + track.velocity_n[:-1]) * step[:, None]
    way = np.vstack([np.zeros((1, 3)), np.cumsum(middle, axis=0)])
    first = tuple(np.full(fixes, column[0]) for column in track.position)
    # what is left is one constant for all fixes that fit, but for the drift of the integral
    left = position_differences(track.position, (first[0], first[1], first[2])) - way
    sigma = np.sqrt(np.einsum("ijj->i", track.position_covariance_n))
    kept = np.zeros(fixes, dtype=bool)
    kept[_longest_chain(left, track, sigma)] = True
    return kept if kept.sum() >= _LEAST * fixes else np.ones(fixes, dtype=bool)


def _longest_chain(left: Vectors, track: GnssTrack, sigma: Series) -> list[int]:
    """Indices of the longest chain of which each fits the one before it."""
    fixes = len(track)
    window = min(max(_FEWEST, round(_LONGEST / max(track.interval, 1e-3))), _MOST)
    length, previous = np.ones(fixes, dtype=np.int64), np.full(fixes, -1)
    follows = _fit(left, track, sigma, slice(None, -1), slice(1, None))
    longest = 1
    for j in range(1, fixes):
        if follows[j - 1] and length[j - 1] == longest:
            # no chain is longer, and none that is as long is nearer: what most fixes of a sound track are
            longest = length[j] = longest + 1
            previous[j] = j - 1
            continue
        i = np.arange(max(0, j - window), j)
        ways = np.where(_fit(left, track, sigma, i, j), length[i], 0)
        # of chains as long the nearest: the last of the greatest
        best = len(ways) - 1 - int(np.argmax(ways[::-1]))
        if ways[best] > 0:
            length[j], previous[j] = ways[best] + 1, i[best]
            longest = max(longest, int(length[j]))
    at = int(np.argmax(length))
    chain = [at]
    while previous[at] >= 0:
        at = int(previous[at])
        chain.append(at)
    return chain


def _fit(
    left: Vectors, track: GnssTrack, sigma: Series, i: npt.NDArray[np.intp] | slice, j: int | slice
) -> npt.NDArray[np.bool_]:
    """Which fixes i fit the later fix j, or each its own."""
    time, velocity = track.time, track.velocity_n
    apart = np.sqrt(np.sum((left[i] - left[j]) ** 2, axis=1))
    change = np.sqrt(np.sum((velocity[i] - velocity[j]) ** 2, axis=1))
    return np.asarray(
        apart <= _SLACK * (time[j] - time[i]) + _LATE * change + _SIGMAS * np.hypot(sigma[i], sigma[j])
    )
