"""Is an optional term wanted by the data? Wald's test of its estimates against zero."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Square
from tumble.calibration.estimate import TermTest

# A term that chance explains so often, tested by one step from the adjustment without it, is needless: the noise was
# found without it, and is larger by what it would explain.
NEEDLESS = 0.1


def wald_test(name: str, estimates: Series, covariance: Square, freedom: int, limit: float) -> TermTest:
    """Test estimates of a term jointly against zero.

    Parameters
    ----------
    name : of the term.
    estimates, covariance : of its unknowns, from the fit that contains them.
    freedom : degrees of freedom of the noise level.
    limit : the term is kept if chance gives as large a statistic more rarely than this.

    Notes
    -----
    ``estimates' covariance^-1 estimates / n`` is F with n and `freedom` degrees of freedom if the term
    is not there. The covariance is scaled to correlations first: unknowns in counts and in radians
    differ by many powers of ten.
    """
    from scipy.special import fdtrc

    scale = np.sqrt(np.diag(covariance))
    normalised = estimates / scale
    correlation = covariance / np.outer(scale, scale)
    statistic = float(normalised @ np.linalg.solve(correlation, normalised)) / estimates.size
    probability = float(fdtrc(estimates.size, max(freedom, 1), statistic))
    largest = float(normalised[np.argmax(np.abs(normalised))])
    return TermTest(
        name=name,
        kept=probability < limit,
        statistic=statistic,
        degrees=estimates.size,
        probability=probability,
        limit=limit,
        largest=f"{largest:+.1f} sigma",
    )
