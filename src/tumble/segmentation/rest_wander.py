"""How biases wander from rest to rest (1/f noise), as the rests of a recording show it.

The scatter within a hold tells white noise well and flicker hardly: a floor that it does not show beyond doubt is
taken as none. Here the means of quarters of all rests are compared with one another, within a hold and between holds,
as far as it is known what each hold should show; the density of the wander is the one that explains them best. What
few rests leave open is filled with what data sheets give: a wander in proportion to the white noise.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from tumble.arrays import Series, Square, Table, Vector, Vectors
from tumble.estimation import covariance_about_the_mean
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.segmentation.averages import batches
from tumble.segmentation.rounding import rounding_of_each
from tumble.segmentation.timeline import Timeline

# Of a hold; and of a part, differences of neighbours within which show white noise alone.
PARTS, PIECES = 4, 8
# Density per unit of ln f over that of the white noise, 1/s: the middle of what sheets give for B² / (pi N²) with bias
# instability B and random walk N (STIM300 0.001 and 0.06 for gyros and accelerometers, HG4930 0.003 and 0.04, HG1700
# 0.006, ADIS16488 0.03, BMI160 0.03, MPU-6050 0.1), and the standard deviation of its logarithm.
USUAL, SPREAD = 0.02, 1.2
_GRID = USUAL * np.exp(np.linspace(-5.0, 5.0, 31))
# A hold whose parts differ by so many times as much as those of the others was disturbed (variances).
DISTURBED = 10.0


@dataclass(frozen=True)
class RestParts:
    """Means of the parts of all rests; raw.

    Attributes
    ----------
    hold : (parts,) index of the hold.
    start, stop : (parts,) s.
    force, rate : (parts, 3), or None without the triad.
    force_white, rate_white : (3,) raw²·s, density of the white noise.
    span : s, from the first rest to the end of the last.
    """

    hold: np.ndarray
    start: Series
    stop: Series
    force: Vectors | None
    rate: Vectors | None
    force_white: Vector
    rate_white: Vector
    span: tuple[float, float]


def observe_parts(recording: Recording, timeline: Timeline) -> RestParts:
    """Cut the rests into parts and average each.

    Parameters
    ----------
    recording, timeline : raw samples and the holds found in them.
    """
    cuts: list[tuple[int, int, int]] = []
    for k, hold in enumerate(timeline.holds):
        for a, b in hold.stretches():
            edges = np.linspace(a, b, PARTS + 1).astype(int)
            if edges[1] - edges[0] >= 2 * PIECES:
                cuts += [(k, int(i), int(j)) for i, j in pairwise(edges)]
    time, step = recording.time, 1.0 / recording.rate
    start = np.array([time[a] for _, a, _ in cuts])
    stop = np.array([time[b - 1] + step for _, _, b in cuts])
    force, force_white = _averaged(recording.specific_force, cuts, step)
    rate, rate_white = _averaged(recording.angular_rate, cuts, step)
    holds = np.array([k for k, _, _ in cuts], dtype=int)
    span = (float(start[0]), float(stop[-1])) if cuts else (0.0, 1.0)
    return RestParts(holds, start, stop, force, rate, force_white, rate_white, span)


def _averaged(
    signal: Vectors | None, cuts: list[tuple[int, int, int]], step: float
) -> tuple[Vectors | None, Vector]:
    """Return the parts' means, and the density of white noise by the differences of neighbouring pieces."""
    if signal is None or not cuts:
        return None, np.zeros(3)
    means, densities = np.zeros((len(cuts), 3)), np.zeros((len(cuts), 3))
    for at, (_, a, b) in enumerate(cuts):
        size = (b - a) // PIECES
        pieces, total = batches(signal, a, b, size)
        pieces, means[at] = pieces[:PIECES], total / (b - a)
        densities[at] = 0.5 * np.mean(np.diff(pieces, axis=0) ** 2, axis=0) * size * step
    # The median of parts, so that a knock in one does not count; of chi-square with so few degrees it is a little low.
    white = np.median(densities, axis=0) / _MEDIAN
    # A bias that drifts over the edge of a step makes parts differ by as much as rounding may do anywhere.
    rounding = np.max(rounding_of_each(signal, [[(a, b)] for _, a, b in cuts], means), axis=0)
    return means, np.maximum(white, rounding * step * float(np.median([b - a for _, a, b in cuts])))


# Median over mean of the mean square of seven differences of neighbours: 4.7 degrees of freedom.
_MEDIAN = 0.86


def find_density(
    parts: RestParts,
    signal: Table | None,
    white: Series,
    *,
    holds: np.ndarray | None = None,
    design: Table | None = None,
    spread: Table | None = None,
    alike: Square | None = None,
) -> Series:
    """Return (axes,) raw² per unit of ``ln f``: the density by which the biases of a triad wander.

    Parameters
    ----------
    parts : of the rests.
    signal, white : (parts, axes), (axes,) their means and the density of the white noise: of the one triad or the
        other, or of what it shows along some direction of each hold.
    holds : indices of the holds that are compared with one another; None for all.
    design : (holds, columns) what the mean of each depends on linearly, a one for the bias included; None where each
        may show anything, and only its own parts are compared.
    spread : (holds, axes) raw², variance of each hold's mean by what is neither noise nor wander, such as placement.
    alike : (holds, holds) correlation of what two holds show of a wander that stays; None for one: they show the same.

    Notes
    -----
    The restricted likelihood of a density in proportion to the white noise, the same for all axes of one make,
    times the prior of data sheets. Returned is its mean, for a variance is one: few rests leave the density open by
    factors, and the errors that it makes are as large as those of its larger values. Of a sensor without noise it is
    zero.
    """
    every = np.unique(parts.hold) if holds is None else np.asarray(holds)
    position = {int(k): at for at, k in enumerate(every)}
    use = np.array([int(k) in position for k in parts.hold], dtype=bool)
    if signal is None or not np.any(use) or not np.all(white > 0.0):
        return np.zeros_like(white)
    use &= ~np.isin(parts.hold, disturbed_holds(parts, signal, white))
    at = np.array([position[int(k)] for k in parts.hold[use]], dtype=int)
    columns = np.eye(len(every)) if design is None else np.asarray(design, dtype=np.float64)
    rows = columns[at][:, np.any(columns[at] != 0.0, axis=0)]
    logarithm = -0.5 * (np.log(_GRID / USUAL) / SPREAD) ** 2
    if at.size <= rows.shape[1]:
        return _mean(logarithm) * white
    seconds = parts.stop[use] - parts.start[use]
    together = covariance_about_the_mean(parts.start[use], parts.stop[use], parts.span)
    if alike is not None:
        together = together * alike[np.ix_(at, at)]
    same = (at[:, None] == at[None]).astype(np.float64)
    basis = _orthogonal(rows)
    shown = (signal[use] - signal[use].mean(axis=0)) / np.sqrt(white)
    if spread is None:
        logarithm = logarithm + _likelihoods(basis, np.diag(1.0 / seconds), together, shown)
    else:
        for axis in range(3):
            fixed = np.diag(1.0 / seconds) + same * spread[at, axis][:, None] / white[axis]
            logarithm = logarithm + _likelihoods(basis, fixed, together, shown[:, axis : axis + 1])
    return _mean(logarithm) * white


def _mean(logarithm: Series) -> float:
    """Of a density over white noise, by the logarithm of its probability on the grid."""
    weight = np.exp(logarithm - logarithm.max())
    return float(np.sum(weight * _GRID) / weight.sum())


def disturbed_holds(parts: RestParts, signal: Table, white: Series) -> np.ndarray:
    """Return the indices of holds whose parts differ far more than those of the others, and than white noise explains.

    Of white noise one hold in a hundred million does; a wander that is the same in all holds makes none.

    Parameters
    ----------
    parts, signal, white : as for `find_density`.
    """
    # Parts follow one another hold by hold.
    holds, first, own, counts = np.unique(
        parts.hold, return_index=True, return_inverse=True, return_counts=True
    )
    away = signal - (np.add.reduceat(signal, first) / counts[:, None])[own]
    squares = np.add.reduceat(away**2 * (parts.stop - parts.start)[:, None], first)
    scatter = np.max(squares / counts[:, None] / white, axis=1)
    beyond = scatter > DISTURBED * max(float(np.median(scatter)), 1.0)
    return np.asarray(holds[beyond])


def _orthogonal(rows: Table) -> Table:
    """Return (parts, parts - rank) an orthonormal basis of what no column of a design explains."""
    left, size, _ = np.linalg.svd(rows, full_matrices=True)
    return left[:, int(np.count_nonzero(size > 1e-9 * size[0])) :]


def _likelihoods(basis: Table, fixed: Square, together: Square, shown: Table) -> Series:
    """Return (grid,) logarithms of the restricted likelihood of axes (parts, axes), all by one decomposition."""
    root = np.linalg.cholesky(basis.T @ fixed @ basis)
    whiten = np.linalg.inv(root)
    values, vectors = np.linalg.eigh(whiten @ (basis.T @ together @ basis) @ whiten.T)
    square = (vectors.T @ (whiten @ (basis.T @ shown))) ** 2
    variance = 1.0 + _GRID[:, None] * np.maximum(values, 0.0)
    axes = shown.shape[1]
    return -0.5 * np.sum(axes * np.log(variance) + square.sum(axis=1) / variance, axis=1)
