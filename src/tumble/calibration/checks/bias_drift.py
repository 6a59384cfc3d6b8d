"""Does the gyro's bias drift during the recording, as a unit's does that warms up? Then its mean is less certain."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tumble.arrays import AnyArray, Series, Vectors
from tumble.calibration.estimate import Estimate
from tumble.calibration.evidence import Budget

FALSE_ALARM = 0.001
"""Chance of calling a drift on any axis where there is none."""

CAUSE = "gyro bias that drifts"
"""Name of its share in the budget of uncertainties."""

TIME_CONSTANTS = (0.05, 0.1, 0.2, 0.4, 1.0, 5.0)
"""Those that are tried, in lengths of the recording: the longest is all but a straight line."""

_LEAST_FREEDOM = 5


@dataclass(frozen=True, slots=True)
class BiasDrift:
    """A drift of one axis' output at rest.

    Attributes
    ----------
    axis : which gyro.
    change : rad/s, from the first hold to the last.
    left : rad/s, by how much the bias at the last hold is off the mean over all.
    constant : s, time constant of the exponential that describes it best.
    """

    axis: int
    change: float
    left: float
    constant: float


def find_bias_drift(
    time: Series, residual: Vectors, variance: Vectors, known: AnyArray | None = None
) -> list[BiasDrift]:
    """Return the axes whose hold means follow an exponential of time beyond chance.

    Parameters
    ----------
    time : (holds,) s, of their middles.
    residual : (holds, 3) observed minus predicted mean rate at rest, rad/s.
    variance : (holds, 3) of each, (rad/s)²; only their ratios matter, the level is estimated.
    known : (holds, regressors) what was adjusted to the same means beside the bias, such as the specific force of a
        g-sensitivity: it has taken a part of a drift. None for nothing.

    Notes
    -----
    Residual = a + b exp(-t/T) by weighted least squares for each time constant T, less what the known regressors
    have of it; the best is held against Student's limit for as many trials on three axes (Bonferroni), and against a
    single jump (`bias_steps`).
    """
    from scipy.special import stdtrit

    holds, span = len(time), float(np.ptp(time)) if len(time) else 0.0
    constant = np.ones((holds, 1))
    taken = constant if known is None else np.hstack([constant, known])
    freedom = holds - taken.shape[1] - 2
    if freedom < _LEAST_FREEDOM or span <= 0.0:
        return []
    limit = float(stdtrit(freedom, 1.0 - FALSE_ALARM / (6.0 * len(TIME_CONSTANTS))))
    shapes = np.exp(-(time - time.min())[:, None] / (span * np.array(TIME_CONSTANTS)))
    jumps = np.tril(np.ones((holds, holds)), -1)[np.argsort(np.argsort(time))][:, 1:-1]
    last, first = int(np.argmax(time)), int(np.argmin(time))
    found: list[BiasDrift] = []
    for axis in range(3):
        weight = 1.0 / variance[:, axis]
        slopes, sigmas, left = _slopes(residual[:, axis], weight, shapes, taken, freedom)
        best = int(np.argmin(left))
        jump = float(np.min(_slopes(residual[:, axis], weight, jumps, taken, freedom)[2]))
        if abs(slopes[best]) > limit * sigmas[best] and left[best] < jump:
            drift = slopes[best] * shapes[:, best]
            off = drift[last] - float(np.average(drift, weights=weight))
            change = float(drift[last] - drift[first])
            found.append(BiasDrift(axis, change, float(off), TIME_CONSTANTS[best] * span))
    return found


def _slopes(
    values: Series, weight: Series, shapes: AnyArray, taken: AnyArray, freedom: int
) -> tuple[Series, Series, Series]:
    """Slope over each shape, its sigma, and the weighted squares that are left, the taken regressors free beside it."""
    root = np.sqrt(weight)[:, None]
    base, _ = np.linalg.qr(root * taken)
    own, seen = root * shapes, root[:, 0] * values
    own, seen = own - base @ (base.T @ own), seen - base @ (base.T @ seen)
    strength = np.maximum(np.sum(own**2, axis=0), 1e-300)
    slopes = own.T @ seen / strength
    left = np.maximum(float(seen @ seen) - slopes**2 * strength, 0.0)
    return slopes, np.sqrt(left / freedom / strength), left


def add_bias_drift(
    estimate: Estimate, time: Series, residual: Vectors, variance: Vectors, known: AnyArray | None
) -> set[int]:
    """Note drifts of the gyro's biases, and count in their uncertainties by how much the last hold is off.

    Returns the axes that drift.

    Parameters
    ----------
    estimate : gets cautions, and larger uncertainties of the biases that drift.
    time, residual, variance, known : as for `find_bias_drift`; beyond bias, g-sensitivity and Earth rate.
    """
    drifts = find_bias_drift(time, residual, variance, known)
    for drift in drifts:
        axis = "xyz"[drift.axis]
        count_departure(estimate, drift.axis, drift.left)
        words = f"The bias of gyro {axis} drifts by"
        # the procedure that gave the start values may have said so, too
        estimate.said[:] = [one for one in estimate.said if not one.text.startswith(words)]
        estimate.say(
            "caution",
            f"{words} {np.degrees(drift.change):+.2g} °/s from the first hold to the last (time "
            f"constant about {drift.constant:.2g} s), as of a unit that warms up. The stated bias is "
            f"a mean. Its uncertainty counts the {np.degrees(abs(drift.left)):.2g} °/s that the last "
            "hold is off it. Let the unit warm up before recording.",
        )
    return {drift.axis for drift in drifts}


def count_departure(estimate: Estimate, axis: int, left: float) -> None:
    """Count in a gyro bias' uncertainty by how much it is off at the end.

    Parameters
    ----------
    estimate : whose covariance, parameter, correlations and budget get it.
    axis : of the gyro.
    left : rad/s, at the last hold off the mean over all.
    """
    gyroscope = estimate.model.gyroscope
    if gyroscope is None:
        return
    more = abs(float(gyroscope.matrix[axis, axis]) * left)
    name, label = f"gyroscope.bias[{axis}]", f"gyro bias {'xyz'[axis]}"
    places = [i for i, known in enumerate(estimate.names) if known == name]
    rows = [i for i, parameter in enumerate(estimate.parameters) if parameter.name == label]
    if not places or not rows:
        return
    place, row = places[0], rows[0]
    before = float(np.sqrt(estimate.covariance[place, place]))
    estimate.covariance[place, place] += more**2
    known = estimate.parameters[row]
    # in the parameter's own unit
    added = more * known.standard_uncertainty / before
    sigma = float(np.hypot(known.standard_uncertainty, added))
    estimate.parameters[row] = replace(known, standard_uncertainty=sigma)
    estimate.correlations[row, :] *= known.standard_uncertainty / sigma
    estimate.correlations[:, row] *= known.standard_uncertainty / sigma
    estimate.correlations[row, row] = 1.0
    budget = estimate.shown(Budget)
    if budget is not None:
        share = budget.shares.setdefault(CAUSE, np.zeros(len(estimate.parameters)))
        share[row] = np.hypot(share[row], added)
