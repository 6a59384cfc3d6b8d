"""What becomes of the accelerometers' unknowns if what holds scatter by is a wander that neighbours share.

Means of holds scatter by more than their white noise: partly by what is each hold's own, partly by a bias that
wanders, which neighbours have nearly in common. The adjustment takes all of it for each hold's own. For biases and
scale factors that is near enough for weighing; what a term of the second order would explain, a slow wander explains
as well, and three times as often as independent draws say.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Square, inverted
from tumble.calibration.equations.triad_unknowns import BIAS
from tumble.calibration.joint.neighbours import Drift, shared_wander
from tumble.calibration.joint.system import JointProblem, JointSolution
from tumble.calibration.joint.terms import Terms
from tumble.calibration.joint.unknowns import force_matrix
from tumble.estimation.gathered import GatheredTerms


def shared_scatter(problem: JointProblem, solution: JointSolution) -> Square:
    """Return (unknowns, unknowns) by how much the covariance would differ; zeros where holds do not scatter.

    Parameters
    ----------
    problem, solution : observations with their variances, and the settled estimate; rotations of a table have
        wanders of their own, and are left as they are.
    """
    base, size = problem.data.base, solution.state.unknowns.size
    matrix = force_matrix(solution.state.unknowns)
    scatter = np.diag(base.force_floor) + problem.extra.force * (matrix @ matrix.T)
    density = problem.data.force_density * np.diag(scatter) / np.maximum(base.force_floor, 1e-300)
    if not np.any(density > 0.0):
        return np.zeros((size, size))
    drifts: list[tuple[Drift, AnyArray]] = []
    for index, equations in enumerate(solution.equations):
        nodes, border = solution.covariance(index)
        for terms in equations.terms:
            if terms.kind == "force" and terms.place.size:
                told, drift = _of_holds(problem, terms, scatter)
                drifts.append((drift, told.gain(nodes, border, slice(3, None))))
    return shared_wander(drifts, density, (float(base.time[0]), float(base.time[-1])))


def _of_holds(problem: JointProblem, terms: Terms, scatter: Square) -> tuple[GatheredTerms, Drift]:
    base, k = problem.data.base, terms.place
    inverse = np.asarray(np.linalg.inv(np.linalg.cholesky(terms.covariance)), dtype=np.float64)
    told = GatheredTerms("force", terms.node, inverse @ terms.by_node, None, inverse @ terms.by_border)
    alone = inverse @ np.tile(scatter, (3, 3)) @ np.swapaxes(inverse, 1, 2)
    start, stop = base.time[base.head[k, 0]], base.time[base.tail[k, 1] - 1]
    return told, Drift(start, stop, told.by_border[:, :, 3 + BIAS.start : 3 + BIAS.stop], alone)


def wider(covariance: Square, change: Square) -> Square:
    """Return a covariance that is at least as wide as it is with and without a change, in every direction.

    Parameters
    ----------
    covariance, change : (unknowns, unknowns) positive definite, and symmetric.
    """
    root = np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
    inverse = inverted(root)
    values, vectors = np.linalg.eigh(inverse @ change @ inverse.T)
    along = root @ vectors
    return covariance + (along * np.maximum(values, 0.0)) @ along.T


__all__ = ["shared_scatter", "wider"]
