"""Repeatability of calibrations (gauge R&R): what units, operators and repetitions contribute to one parameter.

y = μ + unit + operator + unit x operator + repetition + e, all random, e of the known variance of each estimate. The
variances are found by restricted maximum likelihood; what is beyond e between repetitions is what the stated
uncertainties lack.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series
from tumble.records import dataclass

PARTS = ("unit", "operator", "unit x operator", "repetition")


@dataclass(frozen=True, slots=True)
class Gauge:
    """Standard deviations of the parts of one parameter, by name, and the root mean square of the stated sigmas.

    `share` : of the whole variation that is not the unit's, in standard deviations (%R&R).
    """

    parts: dict[str, float]
    stated: float
    share: float
    count: int


def gauge_study(values: Series, sigmas: Series, unit: np.ndarray, operator: np.ndarray) -> Gauge:
    """Return the parts of a parameter's variation.

    Parameters
    ----------
    values, sigmas : (n,).
    unit, operator : (n,) their numbers.
    """
    from scipy.optimize import minimize

    scale = max(float(np.std(values)), float(np.sqrt(np.mean(sigmas**2))), 1e-300)
    y, known = values / scale, np.diag((sigmas / scale) ** 2)
    pair = unit * (int(np.max(operator)) + 1) + operator
    columns = (unit, operator, pair, np.arange(len(y)))
    # A part that cannot be told from another one is none: one operator, or each unit at one operator.
    told = [len(np.unique(unit)) > 1, len(np.unique(operator)) > 1, False, True]
    told[2] = (
        told[0] and told[1] and len(np.unique(pair)) > len(np.unique(unit)) and len(np.unique(pair)) < len(y)
    )
    shapes = [(c[:, None] == c[None, :]).astype(float) for c, has in zip(columns, told, strict=True) if has]

    def objective(roots: Series) -> float:
        v = known + sum(root**2 * shape for root, shape in zip(roots, shapes, strict=True))
        v = v + 1e-12 * np.eye(len(y))
        sign, log = np.linalg.slogdet(v)
        inverse = np.linalg.inv(v)
        information = float(np.sum(inverse))
        mean = float(np.sum(inverse @ y)) / information
        residual = y - mean
        return float(log + np.log(information) + residual @ inverse @ residual) if sign > 0 else 1e12

    best = min(
        (minimize(objective, np.full(len(shapes), start), method="L-BFGS-B") for start in (0.1, 0.6)),
        key=lambda found: float(found.fun),
    )
    sds = iter(np.abs(best.x) * scale)
    parts = {name: float(next(sds)) if has else float("nan") for name, has in zip(PARTS, told, strict=True)}
    stated = float(np.sqrt(np.mean(sigmas**2)))
    own = sum(parts[name] ** 2 for name in PARTS[1:] if np.isfinite(parts[name])) + stated**2
    units = parts["unit"] ** 2 if np.isfinite(parts["unit"]) else 0.0
    return Gauge(parts, stated, float(np.sqrt(own / (own + units))), len(y))
