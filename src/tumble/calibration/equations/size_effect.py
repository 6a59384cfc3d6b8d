"""Terms that only a turning table shows: a lag between the triads, and the accelerometers' lever arms.

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

from tumble.arrays import AnyArray, Table, Vectors
from tumble.calibration.equations.imu_unknowns import LAYOUT, LEVER_ARM
from tumble.estimation import Prior
from tumble.estimation.unknowns import Unknowns

PAIRS = ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))
"""Of the lever arms that are unknown: whose, and along which axis."""
ARMS = np.array([LAYOUT["lever_arms"].start + 3 * i + j for i, j in PAIRS])
"""Where these stand among the unknowns."""


def apart(u: Unknowns, centripetal: AnyArray) -> AnyArray | None:
    """Return (windows, 3, 3) m/s² that each accelerometer feels beyond the unit; None where all are at one place.

    Parameters
    ----------
    u : where the unknowns are.
    centripetal : (windows, 3, 3) 1/s², the squared cross matrix of the rate.
    """
    arms = u["lever_arms"].reshape(3, 3)
    return np.einsum("nij,aj->nai", centripetal, arms) if np.any(arms) else None


def by_lever_arms(by_true: AnyArray, centripetal: AnyArray) -> AnyArray:
    """Return (windows, 3, 9) derivatives of the raw force by the lever arms, sensor by sensor.

    Parameters
    ----------
    by_true : (windows, 3, 3) derivatives by the true force.
    centripetal : of the windows.
    """
    own = np.einsum("nab,nbj->naj", by_true, centripetal)
    made = np.zeros((len(own), 3, 3, 3))
    made[:, range(3), range(3)] = own
    return made.reshape(-1, 3, 9)


def by_lag(by_true: AnyArray, rates: Table, gravity_b: Vectors) -> AnyArray:
    """Return (windows, 3) derivatives of the raw force by the lag.

    Parameters
    ----------
    by_true : (windows, 3, 3) derivatives by the true force.
    rates, gravity_b : (windows, 3) rad/s, and m/s² of the part that goes round.
    """
    return np.einsum("nab,nb->na", by_true, np.cross(rates, gravity_b))


def lever_prior(u: Unknowns) -> Prior | None:
    """Return that accelerometers of a unit are a few centimetres apart: what the motion does not tell stays small.

    None where lever arms are not adjusted.

    Parameters
    ----------
    u : the unknowns.
    """
    if not u.is_free("lever_arms"):
        return None
    precision = np.zeros((u.values.size, u.values.size))
    precision[ARMS, ARMS] = 1.0 / LEVER_ARM**2
    return Prior(np.zeros(u.values.size), precision)
