"""Tests of every residual of the joint estimator against what its noise and its redundancy make of it.

What the unknowns take up of each residual is known, correlations included: a kind's redundancy follows from the
covariances of attitudes and shared unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.calibration.joint.system import JointProblem, JointSolution
from tumble.calibration.joint.terms import HEAD, TAIL, Terms
from tumble.calibration.joint.unknowns import force_matrix, gyro_matrix
from tumble.estimation.bordered import NodeCovariance

KINDS = ("force", "rate", "swing", "rest", "turn", "tilt", "pose", "parts")
# Eigenvalues of a redundancy below this are directions that nothing checks.
CHECKED = 0.05


@dataclass(frozen=True, slots=True)
class KindTests:
    """Tests of every observation of one kind.

    Attributes
    ----------
    place : (terms,) holds.
    statistic : (terms,) chi-square with `degrees` if the noise given is the true one.
    degrees : (terms,) how many of its directions something else checks.
    square : (terms,) sum of squared whitened residuals.
    redundancy : (terms,) what is left of its observations to check it, the trace of a matrix.
    redundancy_square : (terms,) the trace of that matrix's square.
    variance : (terms,) SI², typical of one component.
    residual : (terms, m) raw or rad.
    """

    place: np.ndarray
    statistic: Series
    degrees: np.ndarray
    square: Series
    redundancy: Series
    redundancy_square: Series
    variance: Series
    residual: AnyArray

    def where(self, taken: np.ndarray) -> KindTests:
        """Return the tests of some of them.

        Parameters
        ----------
        taken : (terms,) of bool.
        """
        return KindTests(*(getattr(self, f.name)[taken] for f in fields(self)))


def joint_tests(problem: JointProblem, solution: JointSolution) -> dict[str, KindTests]:
    """Return the tests of all kinds that have observations.

    Parameters
    ----------
    problem, solution : the observations and the settled estimate.
    """
    gathered: dict[str, list[KindTests]] = {kind: [] for kind in KINDS}
    for index, equations in enumerate(solution.equations):
        nodes, border = solution.covariance(index)
        for terms in equations.terms:
            if not terms.place.size:
                continue
            joint = _joint_covariance(terms, nodes, border)
            gathered[terms.kind].append(_tests(terms, joint, solution.state.unknowns))
            if terms.kind == "force":
                gathered["parts"].append(_tests(terms, joint, solution.state.unknowns, parts=True))
    return {kind: _together(tests) for kind, tests in gathered.items() if tests}


def _joint_covariance(terms: Terms, nodes: NodeCovariance, border: AnyArray) -> AnyArray:
    """Of the nodes that each term depends on, and of the border."""
    own, across = nodes.own[terms.node], nodes.with_border[terms.node]
    size = own.shape[1]
    if terms.by_next is None:
        joint = np.zeros((terms.node.size, size + border.shape[0], size + border.shape[0]))
    else:
        joint = np.zeros((terms.node.size, 2 * size + border.shape[0], 2 * size + border.shape[0]))
        following = nodes.following[terms.node]
        joint[:, size : 2 * size, size : 2 * size] = nodes.own[terms.node + 1]
        joint[:, :size, size : 2 * size] = following
        joint[:, size : 2 * size, :size] = np.swapaxes(following, 1, 2)
        across = np.concatenate([across, nodes.with_border[terms.node + 1]], axis=1)
    joint[:, :size, :size] = own
    rest = across.shape[1]
    joint[:, :rest, rest:], joint[:, rest:, :rest] = across, np.swapaxes(across, 1, 2)
    joint[:, rest:, rest:] = border
    return joint


def _tests(terms: Terms, joint: AnyArray, unknowns: Series, *, parts: bool = False) -> KindTests:
    nodes = [terms.by_node] if terms.by_next is None else [terms.by_node, terms.by_next]
    design = np.concatenate([*nodes, terms.by_border], axis=2)
    residual, covariance = terms.residual, terms.covariance
    taken = design @ joint @ np.swapaxes(design, 1, 2)
    if parts:
        # How the parts differ: head and tail against the middle.
        apart = np.zeros((6, 9))
        apart[:3, :3], apart[3:, 6:] = np.eye(3), np.eye(3)
        apart[:, 3:6] = -np.tile(np.eye(3), (2, 1))
        residual, covariance = residual @ apart.T, apart @ covariance @ apart.T
        taken = apart @ taken @ apart.T
    elif terms.kind == "force":
        # Of the three parts, their weighted mean: what the hold as a whole shows.
        weights = _inverses(covariance).reshape(-1, 3, 3, 9).sum(axis=1)
        mean = _inverses(weights @ np.tile(np.eye(3), (3, 1))) @ weights
        residual = np.einsum("tij,tj->ti", mean, residual)
        covariance = mean @ covariance @ np.swapaxes(mean, 1, 2)
        taken = mean @ taken @ np.swapaxes(mean, 1, 2)
    root = _inverses(np.asarray(np.linalg.cholesky(covariance), dtype=np.float64))
    white = np.einsum("tij,tj->ti", root, residual)
    left = np.eye(residual.shape[1]) - root @ taken @ np.swapaxes(root, 1, 2)
    values, vectors = np.linalg.eigh(0.5 * (left + np.swapaxes(left, 1, 2)))
    least = CHECKED if terms.kind != "rest" else 0.0
    checked = values > np.maximum(least, 1e-12)
    along = np.einsum("tji,tj->ti", vectors, white)
    squares = np.where(checked, along**2 / np.where(checked, values, 1.0), 0.0)
    scale = {
        "force": np.sum(force_matrix(unknowns) ** 2, axis=1),
        "rate": np.sum(gyro_matrix(unknowns) ** 2, axis=1),
    }.get(terms.kind, np.ones(residual.shape[1]))
    if parts:
        scale = np.ones(6)
    variance = 1.0 / np.mean(scale / np.diagonal(covariance, axis1=1, axis2=2), axis=1)
    if terms.kind == "rest":
        # A sway that is believed to be small is pulled to nothing: what would be seen of a larger one.
        variance = variance * 6.0 / np.maximum(np.trace(left, axis1=1, axis2=2), 1e-12)
    return KindTests(
        terms.place,
        squares.sum(axis=1),
        checked.sum(axis=1),
        np.sum(white**2, axis=1),
        np.trace(left, axis1=1, axis2=2),
        np.sum(left**2, axis=(1, 2)),
        variance,
        residual,
    )


def _inverses(matrices: AnyArray) -> AnyArray:
    return np.asarray(np.linalg.inv(matrices), dtype=np.float64)


def _together(tests: list[KindTests]) -> KindTests:
    return KindTests(
        np.concatenate([t.place for t in tests]),
        np.concatenate([t.statistic for t in tests]),
        np.concatenate([t.degrees for t in tests]),
        np.concatenate([t.square for t in tests]),
        np.concatenate([t.redundancy for t in tests]),
        np.concatenate([t.redundancy_square for t in tests]),
        np.concatenate([t.variance for t in tests]),
        np.concatenate([t.residual for t in tests]),
    )


def angle_redundancies(problem: JointProblem, solution: JointSolution) -> dict[int, float]:
    """Return, by the hold before, how much of each table angle that was read the others check: 0 to 1.

    Parameters
    ----------
    problem, solution : the observations and the settled estimate.
    """
    found: dict[int, float] = {}
    for index, equations in enumerate(solution.equations):
        nodes, _ = solution.covariance(index)
        for k, spin in equations.spins.items():
            if np.isnan(spin.angle_residual):
                continue
            node = k - equations.section.first
            cross = nodes.following[node][TAIL, HEAD]
            spread = nodes.own[node][TAIL, TAIL] + nodes.own[node + 1][HEAD, HEAD] - cross - cross.T
            sigma2 = max(problem.data.spins[k].angle_sigma, 1e-9) ** 2
            found[k] = max(1.0 - float(spin.axis @ spread @ spin.axis) / sigma2, 0.0)
    return found


__all__ = ["CHECKED", "KINDS", "KindTests", "angle_redundancies", "joint_tests"]
