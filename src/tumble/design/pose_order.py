"""In which order poses are visited: near one another, and so that a bias that wanders does least harm."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import Vectors, inverted
from tumble.calibration.poses import SAME_POSE
from tumble.design.candidates import PARAMETERS, pose_rows
from tumble.design.hold_noise import hold_covariance, hold_times

if TYPE_CHECKING:
    from tumble.design.pose_plan import PoseTask

# Sweeps of swaps.
MOST_SWEEPS = 3


def shortest_order(directions: Vectors) -> list[int]:
    """Return an order in which each pose is near the one before, but never the same again at once.

    Parameters
    ----------
    directions : (n, 3) unit vectors up.
    """
    left = list(range(len(directions)))
    order = [max(left, key=lambda index: (round(float(directions[index, 2]), 6), -index))]
    left.remove(order[0])
    while left:
        cosines = directions[left] @ directions[order[-1]]
        alike = cosines > np.cos(SAME_POSE)
        # A pose that is to be visited often comes first, so that others are left to stand between.
        visits = np.array(
            [np.sum(directions[left] @ directions[index] > np.cos(SAME_POSE)) for index in left]
        )
        often = visits >= max(2.0, 0.5 * len(left))
        score = cosines + 10.0 * often - 100.0 * alike
        place = int(np.argmax(np.asarray(np.round(score, 9), dtype=np.float64)))
        order.append(left.pop(place))
    return order


def best_order(task: PoseTask, directions: Vectors, dwell: float) -> list[int]:
    """Return the order in which a wandering bias does least harm; the shortest where none wanders.

    Neighbours in time share a wander, and poses that look alike pass it on to the parameters: opposite poses one
    after the other do not. Found by swapping two poses for as long as that helps.

    Parameters
    ----------
    task, directions : as of `plan_poses`.
    dwell : s of each pose.
    """
    order = shortest_order(directions)
    if not task.noise.wanders or len(order) < 3:
        return order
    noise = hold_covariance(hold_times(np.full(len(order), dwell), task.turn), task.noise, task.rate)
    rows, alike = pose_rows(directions), directions @ directions.T
    base = (
        1e-10 * np.eye(len(PARAMETERS)) if task.known is None else task.known * float(np.mean(np.diag(noise)))
    )
    if task.known is not None:
        base = base / task.gravity**2
    gain = inverted(rows.T @ rows + base) @ rows.T
    mean = float(np.mean(np.diag(noise)))
    still = float(np.cos(SAME_POSE))

    def value(tried: list[int]) -> float:
        at = np.array(tried)
        if np.any(alike[at[1:], at[:-1]] > still):
            return float("inf")
        place = gain[:, at]
        covariance = place @ (alike[np.ix_(at, at)] * noise) @ place.T / mean
        return float(task.value(covariance))

    now = value(order)
    for _ in range(MOST_SWEEPS):
        before = now
        for first in range(len(order) - 1):
            for second in range(first + 1, len(order)):
                order[first], order[second] = order[second], order[first]
                tried = value(order)
                if tried < now * (1.0 - 1e-6):
                    now = tried
                else:
                    order[first], order[second] = order[second], order[first]
        if now > 0.995 * before:
            break
    return order
