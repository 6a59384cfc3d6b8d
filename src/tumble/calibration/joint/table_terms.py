"""Terms of the joint estimator that only a turning table shows: a lag between the triads, and lever arms.

While a table turns gravity round, accelerometers that are read later than the gyros see it where it was by
``lag`` times the rate. And each accelerometer sits at a place of its own: at ``r`` it feels ``[w]² r`` more than
the point that the triad is said to be at (size effect).

Which places can be told: each rotation has a lever arm of its own, from the axis to the unit, which takes up
all that is across its axis u. What is left is along it, ``w² (sum of u_i² u_j r_ij - u_j r_jj)`` over all i and j,
with accelerometer i's place along j: of each pair the place along j against accelerometer j's own, six in all, and
of the sum of the squares of u nothing. So the point to count from is free, and is chosen such that ``r_jj = 0``.
Axes x, y and z tell none of them, for nothing is left of ``u_i² u_j``; an edge between x and y tells one sum of
``r_xy`` and ``r_yx``, the other edge their difference.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Series, Square, Table, Vectors
from tumble.calibration.estimate import TermTest
from tumble.calibration.joint.observability import LEVER_ARM, TOLD, name_plate
from tumble.calibration.joint.unknowns import RawForce
from tumble.calibration.joint.wide import LEVER_ARMS, RATE_QUADRATIC, TIME_LAG, part_of
from tumble.calibration.term_tests import wald_test
from tumble.estimation import Prior

PAIRS = ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))
"""Of the lever arms that are unknown: whose, and along which axis."""
TABLE_TERMS = {
    "time_lag": np.arange(TIME_LAG.start, TIME_LAG.stop),
    "lever_arms": np.array([LEVER_ARMS.start + 3 * i + j for i, j in PAIRS]),
    "gyro_quadratic": np.arange(RATE_QUADRATIC.start, RATE_QUADRATIC.stop),
}
# Share of the name plate's variance that is left of a direction that the motion tells.
LEFT = TOLD**2 / (1.0 + TOLD**2)


def size_effect(unknowns: Series, centripetal: AnyArray) -> AnyArray | None:
    """Return (windows, 3, 3) m/s² that each accelerometer feels beyond the unit; None where all are at one place.

    Parameters
    ----------
    unknowns : all.
    centripetal : (windows, 3, 3) 1/s², the squared cross matrix of the rate.
    """
    arms = part_of(unknowns, LEVER_ARMS).reshape(3, 3)
    return np.einsum("nij,aj->nai", centripetal, arms) if np.any(arms) else None


def by_lever_arms(shown: RawForce, centripetal: AnyArray) -> AnyArray:
    """Return (windows, 3, 9) derivatives of the raw force by the lever arms, sensor by sensor.

    Parameters
    ----------
    shown, centripetal : of the windows.
    """
    own = np.einsum("nab,nbj->naj", shown.by_true, centripetal)
    made = np.zeros((len(own), 3, 3, 3))
    made[:, range(3), range(3)] = own
    return made.reshape(-1, 3, 9)


def by_time_lag(shown: RawForce, rates: Table, gravity_b: Vectors) -> AnyArray:
    """Return (windows, 3) derivatives of the raw force by the lag.

    Parameters
    ----------
    shown : of the windows.
    rates, gravity_b : (windows, 3) rad/s, and m/s² of the part that goes round.
    """
    return np.einsum("nab,nb->na", shown.by_true, np.cross(rates, gravity_b))


def seen_table_terms(normal: Square, free: np.ndarray, unknowns: Series) -> list[str]:
    """Return the terms that the motion tells; of lever arms any part of them.

    Parameters
    ----------
    normal, free : information of the free unknowns, all terms among them, and their indices.
    unknowns : where the others are.
    """
    sizes = name_plate(unknowns)[free]
    left = np.linalg.inv(normal * np.outer(sizes, sizes) + np.eye(free.size))
    found: list[str] = []
    for name, own in TABLE_TERMS.items():
        at = np.searchsorted(free, own)
        shares = np.linalg.eigvalsh(left[np.ix_(at, at)])
        # Of lever arms a part is worth having.
        if shares[0 if name == "lever_arms" else -1] < LEFT:
            found.append(name)
    return found


def lever_prior_of(free: np.ndarray, unknowns: Series) -> Prior | None:
    """Return that accelerometers of a unit are a few centimetres apart: what the motion does not tell stays small.

    None where lever arms are not free.

    Parameters
    ----------
    free : indices of the unknowns to adjust.
    unknowns : all, for their number.
    """
    if not np.all(np.isin(TABLE_TERMS["lever_arms"], free)):
        return None
    precision = np.zeros((unknowns.size, unknowns.size))
    at = TABLE_TERMS["lever_arms"]
    precision[at, at] = 1.0 / LEVER_ARM**2
    return Prior(np.zeros(unknowns.size), precision)


def term_test(name: str, estimates: Series, covariance: Square, freedom: int, limit: float) -> TermTest:
    """Test a term against zero, lever arms in what the motion tells of them; see `wald_test`.

    Parameters
    ----------
    name, estimates, covariance, freedom, limit : as there; of lever arms with their prior taken in.
    """
    if name != "lever_arms":
        return wald_test(name, estimates, covariance, freedom, limit)
    values, vectors = np.linalg.eigh(covariance)
    told = vectors[:, values < max(LEFT * LEVER_ARM**2, 1.001 * float(values[0]))]
    return wald_test(name, told.T @ estimates, told.T @ covariance @ told, freedom, limit)


__all__ = [
    "PAIRS",
    "TABLE_TERMS",
    "by_lever_arms",
    "by_time_lag",
    "lever_prior_of",
    "seen_table_terms",
    "size_effect",
    "term_test",
]
