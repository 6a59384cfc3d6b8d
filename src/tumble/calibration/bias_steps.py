"""Do biases jump during the recording? A knock, a supply or a defect can do it, and a unit that is switched on anew."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tumble.arrays import AnyArray, Series, Vectors
from tumble.calibration.bias_drift import TIME_CONSTANTS

# Chance of calling a step on any axis where there is none.
FALSE_ALARM = 0.01
# Holds needed on either side of a step to tell it from one odd hold.
SMALLEST_SIDE = 4
# A jump of a gyro by so many times what holds scatter by is no flicker noise.
CLEARLY = 8.0
# Nor is one of accelerometers that explains so many times what it leaves, and is so much likelier than a drift (twice
# the logarithm). They are looked for from so many holds beyond the unknowns.
CLEARLY_EXPLAINED, LIKELIER, LEAST_FREEDOM = 2.5, 20.0, 8
# Directions of less than this share of the largest are none.
RANK = 0.05


@dataclass(frozen=True, slots=True)
class BiasStep:
    """A jump of one axis' output at rest between hold `before` and hold `before + 1`, rad/s.

    `scatter` is what the means of single holds scatter by on either side.
    """

    axis: int
    before: int
    size: float
    sigma: float
    scatter: float


def switched_on_anew(triad: str, where: str) -> str:
    """Return the objection to biases of a triad that jump together.

    Parameters
    ----------
    triad : its plural.
    where : between which holds, in words.
    """
    return (
        f"The biases of the {triad} jump {where}: the unit was switched on anew or knocked there, or it is another "
        "unit's recording from there on. Calibrate each part by itself, or with --turn-ons if both are this unit's."
    )


def find_bias_steps(residual: Vectors, variance: Vectors, known: AnyArray | None = None) -> list[BiasStep]:
    """Return the steps in the hold means' residuals at the place of the most significant one, which is the first.

    Parameters
    ----------
    residual : (holds, 3) observed minus predicted mean rate at rest, rad/s.
    variance : (holds, 3) of each, (rad/s)²; only their ratios matter, the level is estimated.
    known : (holds, regressors) what was adjusted to the same means beside the bias, such as the specific force of a
        g-sensitivity: it has taken a part of a step. None for nothing.

    Notes
    -----
    For every split the weighted means of both sides are compared, less what the known regressors have of them; the
    noise level is the median of the residuals about them, so that some odd holds do not hide a step. The most
    significant of all splits of three axes is held against Student's limit for that many trials (Bonferroni).
    """
    from scipy.special import stdtrit

    holds = residual.shape[0]
    splits = range(SMALLEST_SIDE, holds - SMALLEST_SIDE + 1)
    trials = 3 * len(splits)
    if trials < 3:
        return []
    constant = np.ones((holds, 1))
    taken = constant if known is None else np.hstack([constant, known])
    freedom: float = max(0.37 * (holds - taken.shape[1] - 1), 3.0)
    level: float = 1.0 - FALSE_ALARM / (2.0 * trials)
    limit = float(stdtrit(freedom, level))
    steps = [
        _step(residual[:, axis], 1.0 / variance[:, axis], taken, axis, split)
        for axis in range(3)
        for split in splits
    ]
    found = [step for step in steps if abs(step.size) > limit * step.sigma]
    found.sort(key=lambda step: -abs(step.size) / step.sigma)
    return [step for step in found if step.before == found[0].before]


def _step(values: Series, weight: Series, taken: AnyArray, axis: int, split: int) -> BiasStep:
    """The step at a split, the noise level robustly from what is left."""
    root = np.sqrt(weight)
    base, _ = np.linalg.qr(root[:, None] * taken)
    own, seen = root * (np.arange(len(values)) >= split), root * values
    own, seen = own - base @ (base.T @ own), seen - base @ (base.T @ seen)
    strength = max(float(own @ own), 1e-300)
    size = float(own @ seen) / strength
    freed = len(values) / max(len(values) - taken.shape[1] - 1, 1)
    level = max(1.4826 * float(np.median(np.abs(seen - size * own))) * freed**0.5, 1e-12)
    return BiasStep(axis, split - 1, size, level / strength**0.5, level / float(np.median(root)))


def find_force_step(norms: Series, up: Vectors, *, further: bool = False) -> int | None:
    """Return the hold after which the accelerometers' biases clearly jump, by the norms of all holds; None without one.

    Parameters
    ----------
    norms : (holds,) corrected norm minus gravity, m/s², in the order of time.
    up : (holds, 3) unit vectors of the corrected specific force.
    further : asymmetries or quadratic terms were adjusted, too.

    Notes
    -----
    To first order nine unknowns of accelerometers change a norm by quadratic polynomials of its direction, and a jump
    by its part along the direction in all later holds. What the nine took of it is taken off both sides before they
    are compared (Frisch and Waugh 1933). A unit that warms up has an exponential of time in the jump's place.
    """
    holds = len(norms)
    pairs = [(i, j) for i in range(3) for j in range(i, 3)]
    products = np.column_stack([up[:, i] * up[:, j] for i, j in pairs])
    base = _orthonormal(np.hstack([up, products, *([np.abs(up) * up, up**3] if further else [])]))
    splits = range(SMALLEST_SIDE, holds - SMALLEST_SIDE + 1)
    freedom = holds - base.shape[1] - 3
    if freedom < LEAST_FREEDOM or not splits:
        return None
    seen = norms - base @ (base.T @ norms)
    order = np.arange(holds, dtype=float)

    def left(course: Series) -> float:
        """Squares that a bias leaves that goes so over time."""
        columns = course[:, None] * up
        axes = _orthonormal(columns - base @ (base.T @ columns))
        return max(float(seen @ seen) - float(np.sum((axes.T @ seen) ** 2)), 1e-300)

    best = min(splits, key=lambda split: left(np.where(order >= split, 1.0, 0.0)))
    after = left(np.where(order >= best, 1.0, 0.0))
    drifting = min(left(np.exp(-order / (holds * constant))) for constant in TIME_CONSTANTS)
    explained = (float(seen @ seen) - after) / holds
    clearly = explained > CLEARLY_EXPLAINED**2 * after / freedom
    return best - 1 if clearly and holds * np.log(drifting / after) > LIKELIER else None


def _orthonormal(columns: AnyArray) -> AnyArray:
    """Columns of unit length that span the same as far as it is clear."""
    left, singular, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, singular > RANK * singular[0]], dtype=np.float64)
