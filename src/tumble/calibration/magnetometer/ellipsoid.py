"""A magnetometer by itself: turned about, its raw numbers lie on an ellipsoid, and the true field on a sphere.

Nine unknowns: the centre (hard iron) and a symmetric matrix. How the sensor's axes lie against the other triads is
none of them: ``|S (raw - h)| = 1`` holds for any rotation of S.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import Matrix, Series, Square, Vector, Vectors, inverted
from tumble.errors import ObservabilityError
from tumble.records import dataclass
from tumble.segmentation import converter_step

Complex = npt.NDArray[Any]
# Samples beyond so many robust sigmas count for nothing; so many rounds.
CUT, ROUNDS, ITERATIONS = 5.0, 6, 50
# More samples than these add nothing but time: the field at neighbouring ones is the same.
LARGEST_SAMPLES = 20_000
FEWEST_SAMPLES = 30
# Lags of the residuals' correlation that are looked at, as a share of the samples.
LARGEST_LAG = 0.2
_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@dataclass(frozen=True)
class Ellipsoid:
    """The ellipsoid of a magnetometer that was turned about.

    Attributes
    ----------
    shape : (3, 3) symmetric S, 1 / raw unit: ``S (raw - centre)`` has the norm 1.
    centre : (3,) raw.
    covariance : (9, 9) of S's entries 00, 11, 22, 01, 02, 12 and the centre, widened by what neighbours share.
    scatter : of the norm, a share, one sigma: of all samples, robustly.
    noise : of the norm that neighbouring samples differ by.
    correlated : how many samples are worth one.
    left_out : share of the samples that contradict the others.
    samples : how many were used.
    gap : rad, half-angle of the largest cap of directions without a sample.
    """

    shape: Matrix
    centre: Vector
    covariance: Square
    scatter: float
    noise: float
    correlated: float
    left_out: float
    samples: int
    gap: float


def fit_ellipsoid(values: Vectors) -> Ellipsoid:
    """Return the ellipsoid that raw numbers lie on, by maximum likelihood.

    Parameters
    ----------
    values : (samples, 3) raw, in order of time; rows that are not finite are left out.

    Raises
    ------
    ObservabilityError
        If the samples are too few, do not change, or show no ellipsoid.

    Notes
    -----
    Each residual is the distance from the ellipsoid to first order, ``(|y| - 1) / |S y| |y|`` with ``y = S (r - h)``,
    which weighs noise that is alike in all directions as it should. Residuals of neighbours share what the field does
    from place to place: the covariance is widened by the time that their correlation lasts.
    """
    values = np.asarray(values[np.all(np.isfinite(values), axis=1)], dtype=np.float64)
    every = max(1, len(values) // LARGEST_SAMPLES)
    values = values[::every]
    if len(values) < FEWEST_SAMPLES:
        raise ObservabilityError(
            f"The magnetometer has {len(values)} samples: turn the unit slowly about all axes for a minute."
        )
    if constant := [axis for axis, channel in zip("xyz", values.T, strict=True) if np.ptp(channel) == 0.0]:
        raise ObservabilityError(f"Its {', '.join(constant)} never changes: a dead sensor or a wrong column.")
    centre: Vector = np.mean(values, axis=0)
    away: Vectors = values - centre
    size = float(np.linalg.norm(away)) / float(np.sqrt(away.size))
    scaled: Vectors = away / size
    taken = np.ones(len(scaled), dtype=bool)
    x = _algebraic(scaled)
    for _ in range(ROUNDS):
        x = _settle(scaled[taken], x)
        off = _residuals(scaled, x)[0]
        sigma = 1.4826 * float(np.median(np.abs(off[taken]))) + 1e-12
        now = np.abs(off) < CUT * sigma
        if np.array_equal(now, taken):
            break
        taken = now
    off, by, y = _residuals(scaled[taken], x)
    norms: Series = np.sqrt(np.sum(y**2, axis=1))
    scatter = float(np.sqrt(np.sum((norms - float(np.mean(norms))) ** 2) / norms.size))
    radius = float(np.median(1.0 / np.linalg.norm(y @ symmetric(x), axis=1)))
    step = float(np.max(converter_step(values))) / size
    variance = max(float(off @ off) / max(len(off) - 9, 1), step**2 / 12.0)
    correlated = _correlated(off)
    normal = by.T @ by
    if np.linalg.cond(normal) > 1e14:
        raise ObservabilityError(
            "The directions of the field do not show an ellipsoid: turn about other axes, too."
        )
    covariance = variance * correlated * inverted(normal)
    scale = np.concatenate([np.full(6, 1.0 / size), np.full(3, size)])
    neighbours = np.diff(off)
    return Ellipsoid(
        symmetric(x) / size,
        centre + size * x[6:],
        covariance * np.outer(scale, scale),
        scatter,
        float(np.sqrt(0.5 * np.mean(neighbours**2))) / max(radius, 1e-300),
        correlated,
        1.0 - float(np.mean(taken)),
        int(taken.sum()),
        _largest_gap(y / norms[:, None]),
    )


def symmetric(x: Complex) -> Complex:
    """Return the symmetric matrix of entries 00, 11, 22, 01, 02, 12, analytic."""
    return np.array([[x[0], x[3], x[4]], [x[3], x[1], x[5]], [x[4], x[5], x[2]]])


def entries_of(shape: Matrix) -> Series:
    """Return the entries 00, 11, 22, 01, 02, 12 of a symmetric matrix."""
    return np.array([shape[i, j] for i, j in _PAIRS])


def _algebraic(values: Vectors) -> Series:
    """Start from the quadric of least algebraic distance."""
    v = values
    design = np.column_stack(
        [v**2, 2 * v[:, 0] * v[:, 1], 2 * v[:, 0] * v[:, 2], 2 * v[:, 1] * v[:, 2], 2 * v]
    )
    q, *_ = np.linalg.lstsq(design, np.ones(len(v)), rcond=None)
    Q = symmetric(q)
    none = ObservabilityError(
        "The magnetometer's numbers do not lie on an ellipsoid: turn the unit about all axes, away from iron, and "
        "look whether the columns are those of a magnetometer."
    )
    try:
        centre: Vector = np.asarray(-np.linalg.solve(Q, q[6:]), dtype=np.float64)
        values_, vectors = np.linalg.eigh(Q / (1.0 + centre @ Q @ centre))
    except np.linalg.LinAlgError:
        raise none from None
    if not np.all(values_ > 0.0):
        raise none
    S = (vectors * np.sqrt(values_)) @ vectors.T
    return np.concatenate([entries_of(S), centre])


def _residuals(values: Vectors, x: Series) -> tuple[Series, np.ndarray, Vectors]:
    """Distances (samples,), their derivatives (samples, 9), and the corrected field (samples, 3)."""
    S, h = symmetric(x), x[6:]
    away = values - h
    y = away @ S
    norm = np.linalg.norm(y, axis=1)
    unit = y / norm[:, None]
    slope = unit @ S
    steep = np.linalg.norm(slope, axis=1)
    by = np.empty((len(values), 9))
    for at, (i, j) in enumerate(_PAIRS):
        by[:, at] = unit[:, i] * away[:, j] + (unit[:, j] * away[:, i] if i != j else 0.0)
    by[:, 6:] = -slope
    return (norm - 1.0) / steep, by / steep[:, None], y


def _settle(values: Vectors, x: Series) -> Series:
    off, by, _ = _residuals(values, x)
    damping = 0.0
    for _ in range(ITERATIONS):
        normal = by.T @ by
        step = -np.linalg.lstsq(normal + damping * np.diag(np.diag(normal)), by.T @ off, rcond=None)[0]
        moved = x + step
        made = _residuals(values, moved)
        if np.all(np.linalg.eigvalsh(symmetric(moved)) > 0.0) and made[0] @ made[0] <= off @ off * (
            1 + 1e-12
        ):
            small = bool(np.max(np.abs(step)) < 1e-10)
            x, (off, by, _), damping = moved, made, 0.1 * damping
            if small:
                return x
        elif damping > 1e6:
            return x
        else:
            damping = max(10.0 * damping, 1e-4)
    return x


def _correlated(off: Series) -> float:
    """How many residuals one after the other are worth one: twice the sum of their correlations, and one."""
    count = len(off)
    length = 1 << (2 * count - 1).bit_length()
    spectrum = np.fft.rfft(off - off.mean(), length)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2, length)[: max(2, int(LARGEST_LAG * count))]
    if not correlation[0] > 0.0:
        return 1.0
    correlation = correlation / correlation[0]
    # Of pairs of lags the sum stays positive where it is no noise (Geyer's initial positive sequence).
    pairs = correlation[: correlation.size // 2 * 2].reshape(-1, 2).sum(axis=1)
    last = np.flatnonzero(pairs <= 0.0)
    used = pairs[: last[0]] if last.size else pairs
    return max(1.0, 2.0 * float(used.sum()) - 1.0)


def _largest_gap(directions: Vectors) -> float:
    """Return the half-angle, rad, of the largest cap of directions that nothing lies in."""
    count = 500
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    across = np.sqrt(1.0 - z**2)
    cells = np.column_stack([across * np.cos(turn), across * np.sin(turn), z])
    thinned = directions[:: max(1, len(directions) // 4000)]
    nearest = np.max(cells @ thinned.T, axis=1)
    return float(np.arccos(np.clip(nearest.min(), -1.0, 1.0)))
