"""The simulated chapter 4 of Hayal's thesis, and many norm adjustments at once.

Many norm adjustments at once, for studies: the same equations as `norm.adjust_norm`.

One set is the hold means of one triad. Beside the Gauss-Helmert adjustment stand the estimators that
are found in the field instead of it, so that their bias can be shown.

The simulation of Hayal's thesis, chapter 4: 26 attitudes of three minutes, evaluated by norms.

One run is one unit with the errors of table 4.1, its attitudes drawn anew. The samples, one a second,
are really drawn and averaged. The adjustment begins at no errors and takes up to 100 iterations, as in
the thesis.

Attitudes: each face, edge and corner of a cube down, by roll and pitch; the heading is 20° (the
thesis' offset from the main directions) plus a quarter turn drawn at random. All three angles are off
by 2° (4.2). The thesis prints the product R3 R2 R1 (4.10); ours is the usual R1 R2 R3, with which a
heading turns about the vertical.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Series, Table, Vectors
from tumble.attitude import twenty_six_directions
from tumble.earth import EARTH_RATE
from tumble.errors import UsageError
from tumble.records import dataclass
from tumble.sensor import matrix_from_shin

ESTIMATORS = {
    "gauss-helmert": "adjusted anew at the adjusted observations in every iteration (Pope 1972)",
    "corrected": "the same with K² + 2σ² for K², which takes the noise's own square out of the norm",
    "fixed": "linearised at the observed values in every iteration (Hayal 3.28)",
    "norm": "least squares of |true| - K, without weights",
    "square": "least squares of |true|² - K², without weights",
}
_NO_ERRORS = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0])


@dataclass(frozen=True)
class NormBatch:
    """The outcome of many adjustments.

    Attributes
    ----------
    parameters : (sets, 9) bias, scale factor, angles yz, zx, zy; those not estimated as they were given.
    sigmas : (sets, unknowns) standard uncertainties from the noise that was given (cofactor, 3.35).
    sigma0 : (sets,) root of the variance of unit weight (3.37); nan without redundancy.
    iterations : (sets,) how many it took.
    converged : (sets,) of bool.
    mirror : (sets,) of bool: settled with a scale factor that is not positive.
    """

    parameters: Table
    sigmas: Table
    sigma0: Series
    iterations: np.ndarray
    converged: np.ndarray
    mirror: np.ndarray

    @property
    def usable(self) -> np.ndarray:
        """(sets,) of bool: converged, and not in the mirror root."""
        return self.converged & ~self.mirror


def adjust_norms(
    observed: AnyArray,
    sigma: AnyArray | float,
    reference: Series | float,
    *,
    unknowns: int = 9,
    start: AnyArray | None = None,
    estimator: str = "gauss-helmert",
    limit: int = 100,
    tolerance: float = 1e-6,
) -> NormBatch:
    """Adjust the norm conditions of many sets of hold means.

    Parameters
    ----------
    observed : (sets, holds, 3) hold means, raw.
    sigma : standard deviation of a mean: one for all, or (holds,), or (holds, 3).
    reference : norm of the true vector; one for all, or (holds,).
    unknowns : 3 (bias), 6 (and scale factor) or 9 (and non-orthogonality).
    start : (9,) or (sets, 9) start values; None for no bias, scale factors of one, no angles.
    estimator : one of `ESTIMATORS`.
    limit : iterations after which a set has not converged.
    tolerance : converged when no parameter moves by more than this share of its sigma.

    Raises
    ------
    UsageError
        If `unknowns` or `estimator` is none of those, or there are fewer holds than unknowns.
    """
    if unknowns not in (3, 6, 9) or estimator not in ESTIMATORS:
        raise UsageError(
            f"Unknowns are 3, 6 or 9 and not {unknowns}; estimators are {', '.join(ESTIMATORS)}."
        )
    sets, holds = observed.shape[:2]
    if holds < unknowns:
        raise UsageError(f"{holds} holds cannot determine {unknowns} unknowns.")
    sigma = np.asarray(sigma, dtype=float)
    variance = np.broadcast_to(sigma[:, None] if sigma.ndim == 1 else sigma, (holds, 3)) ** 2
    norm = np.broadcast_to(np.asarray(reference, dtype=float), (holds,))
    if estimator == "corrected":
        norm = np.sqrt(norm**2 + 2.0 * np.mean(variance, axis=1))
    values = np.array(np.broadcast_to(_NO_ERRORS if start is None else start, (sets, 9)), dtype=float)
    cofactors, sigma0 = np.full((sets, unknowns, unknowns), np.nan), np.full(sets, np.nan)
    iterations, converged = np.zeros(sets, dtype=np.int64), np.zeros(sets, dtype=bool)
    adjusted, before = observed.copy(), np.full(sets, np.inf)
    left = np.arange(sets, dtype=np.int64)
    with np.errstate(all="ignore"):
        for count in range(1, limit + 1):
            iterations[left] = count
            misclosure, design, by_raw, spread = _linearised(
                observed[left], adjusted[left], values[left], norm, variance, estimator
            )
            good, cofactor, step, residual = _solved(design[..., :unknowns], misclosure, spread)
            cofactors[left[good]] = cofactor[good]
            moved = np.max(np.abs(step) / np.sqrt(np.diagonal(cofactor, axis1=1, axis2=2)), axis=1)
            good &= np.isfinite(moved)
            share = residual / spread
            settled = np.all(np.abs(step) <= 1e-13 * np.maximum(np.abs(values[left, :unknowns]), 1.0), axis=1)
            done = (moved <= tolerance) | settled | ((moved < 1e-3) & (moved >= before[left]))
            rows = left[good]
            values[rows, :unknowns] += step[good]
            sigma0[rows] = np.sqrt(np.sum(residual * share, axis=1) / ((holds - unknowns) or np.nan))[good]
            if estimator in ("gauss-helmert", "corrected"):
                adjusted[rows] = observed[rows] - (variance * by_raw * share[..., None])[good]
            converged[rows], before[rows] = done[good], moved[good]
            left = left[good & ~done]
            if not len(left):
                break
    converged &= np.all(np.isfinite(values), axis=1)
    return NormBatch(
        parameters=values,
        sigmas=np.sqrt(np.maximum(np.diagonal(cofactors, axis1=1, axis2=2), 0.0)),
        sigma0=sigma0,
        iterations=iterations,
        converged=converged,
        mirror=converged & np.any(values[:, 3:6] <= 0.0, axis=1),
    )


def _linearised(
    observed: AnyArray, adjusted: AnyArray, values: Table, norm: Series, variance: Table, estimator: str
) -> tuple[AnyArray, AnyArray, AnyArray, AnyArray]:
    """Misclosures (sets, holds) of the norms, their slopes by nine unknowns and by the raw means, and variances."""
    # Complex steps: the matrices' slopes are exact.
    moved = values[:, 3:, None] + 1e-30j * np.eye(6)
    matrices = matrix_from_shin(np.swapaxes(moved[:, :3], 0, 1), np.swapaxes(moved[:, 3:], 0, 1))
    inverse = np.linalg.inv(np.moveaxis(np.real(matrices[..., 0]), 2, 0))
    true = (adjusted - values[:, None, :3]) @ np.swapaxes(inverse, 1, 2)
    square = np.sum(true**2, axis=-1)
    length, alike = np.sqrt(square), float(np.mean(variance))
    slope, misclosure, spread = {
        "norm": (1.0 / length, length - norm, alike),
        "square": (2.0, square - norm**2, 4.0 * norm**2 * alike),
    }.get(estimator, (1.0 / norm, 0.5 * (square - norm**2) / norm, None))
    by_raw = (np.broadcast_to(slope, square.shape)[..., None] * true) @ inverse
    both = (by_raw[..., :, None] * true[..., None, :]).reshape(*square.shape, 9)
    by_matrix = both @ np.moveaxis(np.imag(matrices) / 1e-30, 2, 0).reshape(-1, 9, 6)
    misclosure = misclosure + np.sum(by_raw * (observed - adjusted), axis=-1)
    spread = (
        np.sum(by_raw**2 * variance, axis=-1) if spread is None else np.broadcast_to(spread, square.shape)
    )
    return misclosure, -np.concatenate([by_raw, by_matrix], axis=-1), by_raw, spread


def _solved(
    design: AnyArray, misclosure: AnyArray, spread: AnyArray
) -> tuple[np.ndarray, AnyArray, AnyArray, AnyArray]:
    """Which of the sets determine all unknowns, their cofactors, the steps and the residuals after them."""
    weighted = np.swapaxes(design / spread[..., None], 1, 2)
    normal: AnyArray = weighted @ design
    size = np.sqrt(np.diagonal(normal, axis1=1, axis2=2))
    scale = size[:, :, None] * size[:, None, :]
    good = np.all(np.isfinite(normal) & (scale > 0.0), axis=(1, 2))
    scaled = np.where(good[:, None, None], normal / scale, np.eye(normal.shape[1]))
    values, vectors = np.linalg.eigh(scaled)
    cofactor = (vectors / values[:, None]) @ np.swapaxes(vectors, 1, 2) / scale
    step = -(cofactor @ (weighted @ misclosure[..., None]))[..., 0]
    residual = misclosure + (design @ step[..., None])[..., 0]
    return good & (values[:, 0] > 1e-12), cofactor, step, residual


LATITUDE = np.radians(40.0)  # 4.1.1
GRAVITY = 9.801  # m/s², 4.5
SAMPLES = 180  # three minutes at 1 Hz, 4.2
ATTITUDES = 26
PLACEMENT = np.radians(2.0)
HEADING = np.radians(20.0)
# Table 3.1: standard deviations of samples of one second.
FORCE_NOISE, RATE_NOISE, RATE_NOISE_HG1900 = 3.667e-3, 3.636e-5, 2.618e-5  # m/s², rad/s, rad/s
# Table 4.1: one value for all axes.
GYRO_ERRORS = np.repeat([4.848e-6, 150e-6, 100e-6], 3)  # rad/s, -, rad
FORCE_ERRORS = np.repeat([0.01, 300e-6, 100e-6], 3)  # m/s², -, rad
# With no noise the weights need some sigma: the thesis does not say which.
NOMINAL_SHARE = 1e-10
CASES = (1, 2, 3)
FASTER = 1e4  # case 3


@dataclass(frozen=True)
class Setting:
    """What one study simulates.

    Attributes
    ----------
    triad : "gyro" or "accelerometer".
    unknowns : 3, 6 or 9.
    attitudes : the first so many of the 26; more than 26 are all of them several times.
    samples : averaged in each attitude.
    noise : standard deviation of a sample, SI.
    rate_factor : how many times the Earth's rate the reference is.
    estimator : see `ESTIMATORS`.
    """

    triad: str
    unknowns: int
    attitudes: int = ATTITUDES
    samples: int = SAMPLES
    noise: float = RATE_NOISE
    rate_factor: float = 1.0
    estimator: str = "gauss-helmert"

    @property
    def reference(self) -> float:
        """Norm of the true vector, SI."""
        return GRAVITY if self.triad == "accelerometer" else EARTH_RATE * self.rate_factor

    @property
    def errors(self) -> Series:
        """(9,) true bias, scale factor errors and angles."""
        return FORCE_ERRORS if self.triad == "accelerometer" else GYRO_ERRORS


@dataclass(frozen=True)
class Runs(NormBatch):
    """The outcome of a study, one row a run; sigmas are sigma0 times the root of the cofactor (3.36).

    Attributes
    ----------
    setting : what was simulated.
    differences : (runs, unknowns) estimate minus truth: bias, scale factor error, angles; SI.
    """

    setting: Setting
    differences: Table


def table_setting(table: str, case: int) -> Setting:
    """Return the setting of a column of table 4.2, 4.3, 4.4 or 4.5.

    Parameters
    ----------
    table : "4.2", "4.3", "4.4" or "4.5".
    case : 1 (no noise), 2, or 3 (reference rate times 10,000; not in table 4.5).

    Raises
    ------
    UsageError
        If the thesis has no such column.
    """
    unknowns = {"4.2": 3, "4.3": 6, "4.4": 9, "4.5": 9}
    if table not in unknowns or case not in CASES or (table == "4.5" and case == 3):
        raise UsageError(f"The thesis has no case {case} in table {table}.")
    triad = "accelerometer" if table == "4.5" else "gyro"
    noise = FORCE_NOISE if table == "4.5" else RATE_NOISE
    return Setting(
        triad, unknowns[table], noise=0.0 if case == 1 else noise, rate_factor=FASTER if case == 3 else 1.0
    )


def run_setting(setting: Setting, runs: int, rng: np.random.Generator, *, tolerance: float = 1e-6) -> Runs:
    """Simulate a setting many times and adjust every run.

    Parameters
    ----------
    setting : what to simulate.
    runs : how many.
    rng : source of all numbers; the same state gives the same runs bit for bit.
    tolerance : converged when no parameter moves by more than this share of its sigma.
    """
    means = simulate_means(setting, runs, rng)
    sigma = setting.noise / np.sqrt(setting.samples)
    batch = adjust_norms(
        means,
        sigma if sigma > 0.0 else NOMINAL_SHARE * setting.reference,
        setting.reference,
        unknowns=setting.unknowns,
        estimator=setting.estimator,
        tolerance=tolerance,
    )
    off = batch.parameters[:, : setting.unknowns].copy()
    off[:, 3:6] -= 1.0
    off -= setting.errors[: setting.unknowns]
    sigmas, how = batch.sigmas * batch.sigma0[:, None], (batch.iterations, batch.converged, batch.mirror)
    return Runs(batch.parameters, sigmas, batch.sigma0, *how, setting, off)


def simulate_means(setting: Setting, runs: int, rng: np.random.Generator) -> AnyArray:
    """Return (runs, attitudes, 3) means of the samples in each attitude; every sample is drawn.

    Parameters
    ----------
    setting, runs, rng : as for `run_setting`.
    """
    true = simulate_true(setting, runs, rng)
    errors = setting.errors
    matrix = np.real(matrix_from_shin(1.0 + errors[3:6], errors[6:9]))
    means = true @ matrix.T + errors[:3]
    if setting.noise > 0.0:
        for run in means:
            run += setting.noise * rng.standard_normal((*run.shape, setting.samples)).mean(axis=-1)
    return means


def simulate_true(setting: Setting, runs: int, rng: np.random.Generator) -> AnyArray:
    """Return (runs, attitudes, 3) true vectors in b.

    Parameters
    ----------
    setting, runs, rng : as for `run_setting`.
    """
    down_b = -twenty_six_directions()
    repeats = -(-setting.attitudes // ATTITUDES)
    down_b = np.tile(down_b, (repeats, 1))[: setting.attitudes]
    pitch, roll = -np.arcsin(down_b[:, 0]), np.arctan2(down_b[:, 1], down_b[:, 2])
    shape = (runs, setting.attitudes)
    off = rng.normal(0.0, PLACEMENT, (3, *shape))
    heading = HEADING + 0.5 * np.pi * rng.integers(0, 4, shape)
    if setting.triad == "accelerometer":
        vector_n = np.array([0.0, 0.0, -GRAVITY])  # 4.6
    else:
        vector_n = setting.reference * np.array([np.cos(LATITUDE), 0.0, -np.sin(LATITUDE)])  # 4.2
    return _turned(vector_n, roll + off[0], pitch + off[1], heading + off[2])


def _turned(vector_n: Vectors, roll: AnyArray, pitch: AnyArray, heading: AnyArray) -> AnyArray:
    """Return R1(roll) R2(pitch) R3(heading) times a vector of n."""
    x, y, z = vector_n
    cosine, sine = np.cos(heading), np.sin(heading)
    x, y = cosine * x + sine * y, -sine * x + cosine * y
    cosine, sine = np.cos(pitch), np.sin(pitch)
    x, z = cosine * x - sine * z, sine * x + cosine * z
    cosine, sine = np.cos(roll), np.sin(roll)
    y, z = cosine * y + sine * z, -sine * y + cosine * z
    return np.stack(np.broadcast_arrays(x, y, z), axis=-1)
