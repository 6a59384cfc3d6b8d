"""What neighbours share: the covariance by biases that wander from hold to rotation to hold.

The adjustment takes the bias of each hold, and of each rotation, for an independent draw. 1/f noise is none: close
stretches have it nearly in common, and what all have in common is no error, for the bias of a recording is its mean.
What each stretch's wander does to each unknown is known, and so is the covariance of any two.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from tumble.arrays import AnyArray, Series, Square, Vector
from tumble.calibration.joint_data import JointData
from tumble.calibration.joint_spins import Layout, wander_variances
from tumble.calibration.joint_system import JointProblem
from tumble.calibration.joint_wander import covariance_about_the_mean


@dataclass(frozen=True, slots=True)
class Stretch:
    """A stretch of time over which a triad's bias counts as one draw.

    Attributes
    ----------
    start, stop : s.
    gain : (unknowns, 3) by how much its wander moves the shared unknowns.
    variance : (3,) raw², that the adjustment gives it.
    """

    start: float
    stop: float
    gain: AnyArray
    variance: Vector


def shared_wander(stretches: list[Stretch], density: Vector, span: tuple[float, float]) -> Square:
    """Return (unknowns, unknowns) by how much the covariance differs from that of independent draws.

    Parameters
    ----------
    stretches : of one triad.
    density : (3,) raw², of the wander per unit of ``ln f``.
    span : s, of the recording.
    """
    gain = np.array([s.gain for s in stretches])
    starts, stops = np.array([s.start for s in stretches]), np.array([s.stop for s in stretches])
    together = covariance_about_the_mean(starts, stops, span)
    variance = np.array([s.variance for s in stretches])
    truly = np.einsum("kai,i,kl,lbi->ab", gain, density, together, gain, optimize=True)
    return np.asarray(
        truly - np.einsum("kai,ki,kbi->ab", gain, variance, gain, optimize=True), dtype=np.float64
    )


def hold_stretches(
    data: JointData, places: Iterable[int], gains: AnyArray, roots: AnyArray, floor: Vector
) -> Iterator[Stretch]:
    """Yield the holds' own.

    Parameters
    ----------
    data : holds.
    places : (terms,) which holds.
    gains : (terms, unknowns, m) by whitened errors, m a multiple of three: a wander moves all parts of a hold.
    roots : (terms, m, m) raw errors by whitened ones.
    floor : (3,) raw², of a hold's mean.
    """
    base = data.base
    for k, gain, root in zip(places, gains, roots, strict=True):
        raw: AnyArray = gain @ np.asarray(np.linalg.inv(root), dtype=np.float64)
        parts: AnyArray = raw.reshape(raw.shape[0], raw.shape[1] // 3, 3).sum(axis=1)
        yield Stretch(float(base.time[base.head[k, 0]]), float(base.time[base.tail[k, 1] - 1]), parts, floor)


def rotation_stretches(
    problem: JointProblem, unknowns: Series, k: int, gain: AnyArray
) -> tuple[Stretch, Stretch]:
    """Return a rotation's own, of the accelerometers and of the gyros: the constants of its wander.

    Parameters
    ----------
    problem, unknowns : the variances that the adjustment gives them.
    k : the hold before.
    gain : (unknowns, own) by its whitened own unknowns.
    """
    data, spin = problem.data, problem.data.spins[k]
    layout = Layout.of(spin, unknowns)
    start, stop = data.base.time[spin.windows[0, 0]], data.base.time[spin.windows[-1, 1] - 1]
    longer = max(float(np.log(data.span / spin.seconds)), 0.0)
    made: list[Stretch] = []
    for place, variances, density in zip(
        (layout.force(), layout.rate()),
        wander_variances(data, spin, unknowns, problem.extra),
        (data.force_density, data.rate_density),
        strict=True,
    ):
        first = layout.inner(place).start
        # An observation shows less than predicted by what a bias wanders, an unknown is more than nothing by it.
        of_constant = -gain[:, first : first + 3] / np.sqrt(variances[0])
        made.append(Stretch(float(start), float(stop), of_constant, longer * density))
    return made[0], made[1]
