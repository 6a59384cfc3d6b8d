"""Did a unit of an array come loose? Then it stands otherwise from one hold on, and not otherwise in each pose.

Models leave something: what a unit's sensors do beyond scale factors, angles and biases turns the gravity that it sees
from that of its neighbours, in each pose by as much as before, and it is part of no unit's own residuals. A unit that
slips turns against the others once, and stays turned. So the scatter of what the units see of each other's gravity is
the yardstick: a step in it that chance does not make is a slip.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Series, Vectors, inverted
from tumble.calibration.arrays.adjustment import ArraySolution, ArrayUnit
from tumble.calibration.equations.imu_unknowns import force_matrix
from tumble.records import dataclass

# A step that chance makes in one of a thousand arrays is one; a smaller turn than this nobody has seen come loose.
FALSE_ALARM, LEAST_SLIP = 1e-3, 3e-4  # rad
# Holds on either side of it: they have to show a turn about any axis, with something to check it by.
FEWEST = 3


@dataclass(frozen=True, slots=True)
class Slip:
    """A unit that turned against the first one.

    Attributes
    ----------
    name : of the unit.
    hold : the first one after it, counted from zero.
    angle : rad, by which it turned.
    """

    name: str
    hold: int
    angle: float


def find_slips(solution: ArraySolution) -> list[Slip]:
    """Return the units that turned against the first one, each with its largest step.

    Parameters
    ----------
    solution : settled.
    """
    found: list[Slip] = []
    first = _down(solution.units[0])
    for unit in solution.units[1:]:
        seen = _down(unit) @ unit.C_1b.T
        slip = _largest_step(unit.name, np.cross(first, seen), first, len(solution.units) - 1)
        found += [] if slip is None else [slip]
    return found


def _down(unit: ArrayUnit) -> Vectors:
    """(holds, 3) unit vectors of gravity in the unit's own axes."""
    u = unit.task.unknowns
    force = (unit.task.data.base.force_mean - u["force.bias"]) @ inverted(force_matrix(u)).T
    return np.asarray(-force / np.linalg.norm(force, axis=1, keepdims=True), dtype=np.float64)


def _largest_step(name: str, turned: Vectors, down: Vectors, units: int) -> Slip | None:
    """The step that leaves least: (holds, 3) `turned` are small rotations across gravity."""
    from scipy.special import fdtrc

    shows: AnyArray = np.eye(3) - down[:, :, None] * down[:, None, :]
    whole, _ = _left(shows, turned)
    best: tuple[float, int, Series] | None = None
    places = range(FEWEST, len(turned) - FEWEST + 1)
    for k in places:
        before, after = _left(shows[:k], turned[:k]), _left(shows[k:], turned[k:])
        left = before[0] + after[0]
        if best is None or left < best[0]:
            best = (left, k, after[1] - before[1])
    degrees = 2 * len(turned) - 6
    if best is None or degrees <= 0:
        return None
    left, hold, step = best
    ratio = (whole - left) / 3.0 / max(left / degrees, 1e-300)
    angle = float(np.linalg.norm(step))
    by_chance = float(fdtrc(3, degrees, ratio)) * len(places) * units
    return Slip(name, hold, angle) if by_chance < FALSE_ALARM and angle > LEAST_SLIP else None


def _left(shows: AnyArray, turned: Vectors) -> tuple[float, Series]:
    """Square sum of what one rotation leaves of several, of each of which only the part across gravity shows."""
    normal, right = np.sum(shows, axis=0), np.einsum("kij,kj->i", shows, turned)
    common: Series = np.asarray(np.linalg.lstsq(normal, right, rcond=1e-6)[0], dtype=np.float64)
    left: AnyArray = turned - shows @ common
    return float(np.sum(left**2)), common
