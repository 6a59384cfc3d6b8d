"""Smoothing: every state by all fixes, those before it and those after."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tumble.arrays import AnyArray, Table
from tumble.errors import UsageError
from tumble.navigation.filter.run import FilterRun, unpacked
from tumble.navigation.filter.setup import FilterSetup
from tumble.navigation.trajectory import Trajectory


@dataclass(frozen=True, slots=True)
class SmoothedRun:
    """A filter's run, smoothed.

    Attributes
    ----------
    trajectory : at the filter's events.
    sensors : (events, states).
    sigmas : (events, 9 + states) one standard deviation.
    covariances : (events, n, n).
    setup : of the filter.
    """

    trajectory: Trajectory
    sensors: Table
    sigmas: Table
    covariances: AnyArray
    setup: FilterSetup


def smooth(run: FilterRun) -> SmoothedRun:
    """Return the Rauch-Tung-Striebel smoother's result for a filter's run.

    The filter takes its errors out at every fix, so that they are zero after it: what the future says of them
    is carried back and taken out of each event's state once.

    Parameters
    ----------
    run : with `keep_covariances`.

    Raises
    ------
    UsageError
        If the run kept no covariances.
    """
    from tumble.navigation.filter.kernels import apply_errors

    events = len(run.trajectory)
    if len(run.covariances) != events:
        raise UsageError(
            "This run kept no covariances to smooth with: run the filter with keep_covariances=True."
        )
    navs, sensors = run.trajectory.packed, run.sensors.copy()
    covariances = run.covariances.copy()
    error = np.zeros(covariances.shape[1])
    for i in range(events - 2, -1, -1):
        gain = _smoothing_gain(run.covariances[i], run.transitions[i + 1], run.predicted[i + 1])
        error = gain @ (run.errors[i + 1] + error)
        spread = gain @ (covariances[i + 1] - run.predicted[i + 1]) @ gain.T
        covariances[i] += 0.5 * (spread + spread.T)
        apply_errors(navs[i], sensors[i], error)
    sigmas = np.sqrt(np.maximum(np.einsum("ijj->ij", covariances), 0.0))
    return SmoothedRun(unpacked(run.time, navs), sensors, sigmas, covariances, run.setup)


def _smoothing_gain(covariance: AnyArray, transition: AnyArray, predicted: AnyArray) -> AnyArray:
    """P Phi' inverse(P_predicted), with states scaled to one sigma; those without variance are left alone."""
    scale = np.sqrt(np.diag(predicted))
    scale = np.where(scale > 0.0, scale, 1.0)
    normal = predicted / np.outer(scale, scale)
    normal[np.diag_indices_from(normal)] += np.where(np.diag(predicted) > 0.0, 1e-14, 1.0)
    solved = np.linalg.solve(normal, (transition @ covariance) / scale[:, None])
    return (solved / scale[:, None]).T
