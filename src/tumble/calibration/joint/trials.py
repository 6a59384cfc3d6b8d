"""Trials of the joint adjustment: copies of problem and state with other unknowns, the former left as they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.calibration.joint.system import JointProblem, JointState
from tumble.calibration.joint.wide import widened
from tumble.estimation import Prior


def widened_problem(problem: JointProblem, state: JointState) -> tuple[JointProblem, JointState]:
    """Return both with room for every term; copies, the former stay as they are.

    Parameters
    ----------
    problem, state : of 33 unknowns, or wide already.
    """
    wide = copied_state(state, np.arange(state.unknowns.size))
    wide.unknowns = widened(state.unknowns)
    problem = fresh_problem(problem, problem.free)
    if problem.prior is not None:
        size = problem.prior.mean.size
        precision = np.zeros((wide.unknowns.size, wide.unknowns.size))
        precision[:size, :size] = problem.prior.precision
        problem.prior = Prior(widened(problem.prior.mean), precision)
    return problem, wide


def narrowed_problem(problem: JointProblem, state: JointState, size: int) -> None:
    """Cut both to the first unknowns, in place.

    Parameters
    ----------
    problem, state : of `size` unknowns or more.
    size : how many are left.
    """
    state.unknowns = state.unknowns[:size].copy()
    if problem.prior is not None:
        problem.prior = Prior(problem.prior.mean[:size], problem.prior.precision[:size, :size])


def fresh_problem(problem: JointProblem, free: np.ndarray) -> JointProblem:
    """Return a copy with other free unknowns, and with variances, masks and read angles of its own.

    Parameters
    ----------
    problem, free : the problem, and indices of the unknowns to adjust.
    """
    spins = {k: replace(spin) for k, spin in problem.data.spins.items()}
    return replace(
        problem,
        data=replace(problem.data, spins=spins),
        free=free,
        extra=replace(problem.extra, restless=dict(problem.extra.restless)),
        masks=problem.masks.copy(),
        spin_noise=dict(problem.spin_noise),
        wobble=dict(problem.wobble),
    )


def copied_state(state: JointState, free: np.ndarray) -> JointState:
    """Return a copy in which unknowns that are not free are zero.

    Parameters
    ----------
    state, free : the state, and indices of its unknowns.
    """
    unknowns = np.zeros(state.unknowns.size)
    unknowns[free] = state.unknowns[free]
    return JointState(
        unknowns,
        [replace(s, C_wb=s.C_wb.copy(), earth_w=s.earth_w.copy()) for s in state.sections],
        {k: replace(s, C_wb=s.C_wb.copy(), own=s.own.copy()) for k, s in state.spins.items()},
    )


__all__ = ["copied_state", "fresh_problem", "narrowed_problem", "widened_problem"]
