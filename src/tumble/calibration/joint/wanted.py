"""Which optional terms the data want: the joint estimator's tests of them, by what it really knows of its noise."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Square, inverted
from tumble.calibration.equations.triad_unknowns import QUADRATIC
from tumble.calibration.estimate import TermTest
from tumble.calibration.joint.noise import BalancedJoint
from tumble.calibration.joint.scatter import shared_scatter
from tumble.calibration.joint.system import JointProblem
from tumble.calibration.joint.table_terms import TABLE_TERMS, term_test
from tumble.calibration.joint.unknowns import G_SENSITIVITY
from tumble.calibration.joint.wide import FORCE_ASYMMETRY, RATE_ASYMMETRY
from tumble.calibration.procedures.hand_held import LAG_LIMIT

OPTIONAL_TERMS = {
    "g_sensitivity": np.arange(G_SENSITIVITY.start, G_SENSITIVITY.stop),
    "quadratic": np.arange(QUADRATIC.start, QUADRATIC.stop),
    "accelerometer_asymmetry": np.arange(FORCE_ASYMMETRY.start, FORCE_ASYMMETRY.stop),
    "gyro_asymmetry": np.arange(RATE_ASYMMETRY.start, RATE_ASYMMETRY.stop),
}
OF_GYROS = ("g_sensitivity", "gyro_asymmetry")
OF_FORCE = ("quadratic", "accelerometer_asymmetry")
ALL_TERMS = {**OPTIONAL_TERMS, **TABLE_TERMS}
# A term that is not there is kept in fewer than this share of recordings, all terms together, the time lag too.
TERM_FALSE_ALARM = 0.02
# What the test of the time lag takes of it, each of the others gets an equal share of the rest; by hand these.
TERM_LIMIT = (TERM_FALSE_ALARM - LAG_LIMIT) / len(OPTIONAL_TERMS)


def term_limits(names: list[str]) -> dict[str, float]:
    """Return how rarely chance may keep each term.

    Parameters
    ----------
    names : of all that are tried.
    """
    others = [name for name in names if name != "time_lag"]
    share = (TERM_FALSE_ALARM - LAG_LIMIT) / max(len(others), len(OPTIONAL_TERMS))
    return {**dict.fromkeys(others, share), "time_lag": LAG_LIMIT}


def wanted_terms(
    problem: JointProblem,
    balanced: BalancedJoint,
    names: list[str],
    tests: dict[str, TermTest],
    limits: dict[str, float],
) -> list[str]:
    """Drop the least significant term until every one left is wanted; of each, its last test goes into `tests`.

    What the others would be without a term follows from the covariance: nothing is adjusted anew for it. Terms of
    the accelerometers are wanted only if they are whether or not neighbouring holds share what they scatter by.

    Parameters
    ----------
    problem, balanced : with all terms free, and settled.
    names : of the terms.
    tests : are added to.
    limits : how rarely chance may keep each.
    """
    solution = balanced.solution
    left, values, cofactor = list(names), solution.state.unknowns.copy(), solution.cofactor.copy()
    checks = {name: _checks_of(name, balanced) for name in names}
    by_hand = not solution.state.spins
    spread = cofactor + shared_scatter(problem, solution)[np.ix_(solution.free, solution.free)] * by_hand
    while left:
        at = {name: np.searchsorted(solution.free, ALL_TERMS[name]) for name in left}
        for name, own in at.items():
            taken = (cofactor, spread) if name in OF_FORCE and by_hand else (cofactor,)
            tests[name] = max(
                (_test(name, values, matrix, own, checks[name], limits[name]) for matrix in taken),
                key=lambda test: test.probability,
            )
        weakest = max(left, key=lambda name: tests[name].probability)
        if tests[weakest].kept:
            break
        left.remove(weakest)
        gone = at[weakest]
        share = cofactor[:, gone] @ inverted(cofactor[np.ix_(gone, gone)])
        values[solution.free] -= share @ values[ALL_TERMS[weakest]]
        without = np.eye(solution.free.size)
        without[:, gone] -= share
        cofactor = cofactor - share @ cofactor[gone]
        spread = without @ spread @ without.T
    return left


def _test(
    name: str, values: Series, covariance: Square, own: np.ndarray, checks: tuple[int, float], limit: float
) -> TermTest:
    degrees, excess = checks
    return term_test(name, values[ALL_TERMS[name]], excess * covariance[np.ix_(own, own)], degrees, limit)


def _checks_of(name: str, balanced: BalancedJoint) -> tuple[int, float]:
    """Return what tells the noise that a term is tested against: its degrees of freedom, and its excess over that.

    By hand that is what holds or turns show of their own kind: some sixty checks of forty holds tell by how much
    accelerometers wander from one to the next, and the hundreds of others know nothing of it.
    """
    told = balanced.tests
    kinds = ("rate", "turn") if name in OF_GYROS else ("force",)
    taken = [told[kind] for kind in kinds if kind in told]
    mean = sum(float(tests.redundancy.sum()) for tests in taken)
    if balanced.solution.state.spins or mean < 1.0:
        # The windows of a table are thousands, and their noise is known.
        return balanced.solution.redundancy, 1.0
    degrees = mean**2 / sum(float(tests.redundancy_square.sum()) for tests in taken)
    excess = sum(float(tests.square.sum()) for tests in taken) / mean
    return max(int(degrees), 1), max(excess, 1.0)


__all__ = [
    "ALL_TERMS",
    "OF_FORCE",
    "OF_GYROS",
    "OPTIONAL_TERMS",
    "TERM_LIMIT",
    "term_limits",
    "wanted_terms",
]
