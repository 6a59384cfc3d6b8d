"""What holds are off by together: biases that wander, in the covariance of a procedure that weighs holds apart.

A procedure adjusts as if the mean of each hold had an error of its own. 1/f noise makes close holds alike and far ones
not, and a difference of two holds that lie minutes apart is off by more than their own noise. The density of the wander
comes from the rests themselves (`tumble.segmentation.rest_wander`); what it does to each unknown comes from what an
error of each hold, or of each rotation between holds, moves it by.
"""

from __future__ import annotations

from itertools import permutations

import numpy as np

from tumble.arrays import AnyArray, Matrices, Matrix, Series, Square, Vector, Vectors
from tumble.calibration.equations.placement import PlacedFit, placement_covariance
from tumble.estimation import Adjustment
from tumble.estimation.wander import covariance_about_the_mean, wider
from tumble.records import dataclass
from tumble.segmentation import HoldMeans
from tumble.segmentation.rest_wander import RestParts, find_density


@dataclass(frozen=True, slots=True)
class HoldWander:
    """How the biases of one triad wander, and over which holds.

    Attributes
    ----------
    density : (3,) raw² per unit of ``ln f``; zero where nothing is known of it.
    white : (3,) raw²·s, density of the white noise.
    start, stop : (holds,) s, of all holds.
    span : s, over which the bias of the recording is the mean.
    """

    density: Vector
    white: Vector
    start: Series
    stop: Series
    span: tuple[float, float]

    @classmethod
    def none(cls, means: HoldMeans) -> HoldWander:
        """Return a wander that is not known.

        Parameters
        ----------
        means : of all holds.
        """
        start, stop = _limits(means)
        return cls(np.zeros(3), np.zeros(3), start, stop, (float(start.min()), float(stop.max())))

    @property
    def is_known(self) -> bool:
        """Whether anything wanders."""
        return bool(np.any(self.density > 0.0))

    def typical(self, holds: np.ndarray) -> Vector:
        """Return (3,) raw: by what the mean of one of `holds` is typically off from that of the recording."""
        at = covariance_about_the_mean(self.start[holds], self.stop[holds], self.span)
        return np.sqrt(self.density * max(float(np.mean(np.diag(at))), 0.0))

    def of_each(self, covariance: Matrices, holds: np.ndarray) -> Matrices:
        """Return the covariances of the means of `holds`, raised to what noise and wander make of them.

        Parameters
        ----------
        covariance : (holds, 3, 3) raw², by the scatter within the holds.
        holds : their indices.
        """
        if not self.is_known:
            return covariance
        own = np.diag(covariance_about_the_mean(self.start[holds], self.stop[holds], self.span))
        seconds = (self.stop - self.start)[holds]
        least = self.white / seconds[:, None] + self.density * np.maximum(own, 0.0)[:, None]
        more = np.maximum(least - np.diagonal(covariance, axis1=1, axis2=2), 0.0)
        return covariance + more[:, :, None] * np.eye(3)

    def of_integral(self, middle: float, seconds: float) -> Matrix:
        """Return (3, 3) raw²·s²: covariance of the integral over a stretch of time by what wanders.

        Parameters
        ----------
        middle, seconds : s, of the stretch.
        """
        limits = np.array([middle - 0.5 * seconds]), np.array([middle + 0.5 * seconds])
        share = max(float(covariance_about_the_mean(*limits, self.span)[0, 0]), 0.0)
        return np.diag(self.density * share * seconds**2)

    def counted(self, covariance: Matrices, seconds: Series) -> Vectors:
        """Return (stretches, 3) raw²: what covariances of means have beyond white noise.

        Parameters
        ----------
        covariance, seconds : (stretches, 3, 3), (stretches,).
        """
        beyond = np.diagonal(covariance, axis1=1, axis2=2) - self.white / seconds[:, None]
        return np.asarray(np.maximum(beyond, 0.0), dtype=np.float64)

    def over(self, covariance: Square, response: AnyArray, noise: Matrices, holds: np.ndarray) -> Square:
        """Return `widened` for the means of holds.

        Parameters
        ----------
        covariance, response : as for `widened`.
        noise : (holds, 3, 3) raw², covariances of the means that `covariance` was made with.
        holds : their indices.
        """
        start, stop = self.start[holds], self.stop[holds]
        return self.widened(covariance, response, self.counted(noise, stop - start), start, stop)

    def widened(
        self, covariance: Square, response: AnyArray, counted: Vectors, start: Series, stop: Series
    ) -> Square:
        """Return a covariance that counts what stretches of time have in common; never less than it was.

        Parameters
        ----------
        covariance : (unknowns, unknowns), with the stretches' errors as independent.
        response : (stretches, unknowns, 3), what a raw error of the mean of each stretch moves each unknown by.
        counted : (stretches, 3) raw², the variances that were taken for wander, see `counted`.
        start, stop : (stretches,) s.
        """
        if not self.is_known:
            return covariance
        together = covariance_about_the_mean(start, stop, self.span)
        change = np.zeros_like(covariance)
        for axis in range(3):
            own = response[:, :, axis]
            change += own.T @ (self.density[axis] * together - np.diag(counted[:, axis])) @ own
        return wider(covariance, change)


def _limits(means: HoldMeans) -> tuple[Series, Series]:
    half = 0.5 * means.duration
    return means.time - half, means.time + half


def responses(adjustment: Adjustment) -> AnyArray:
    """Return (groups, unknowns, size): what an error of each observation moves each unknown by.

    Parameters
    ----------
    adjustment : whose misclosures are what is computed less what is observed.
    """
    weighted = adjustment.chain.solve(adjustment.linearisation.design)
    return np.asarray(np.einsum("pq,gsq->gps", adjustment.cofactor, weighted), dtype=np.float64)


def wander_of_force(means: HoldMeans, holds: np.ndarray, up_b: Vectors, sigma: Series) -> HoldWander:
    """Return how the accelerometers' biases wander over holds in poses that are known.

    What placement does to a sensor across gravity is no wander.

    Parameters
    ----------
    means : of all holds.
    holds : (poses,) indices of those in known poses.
    up_b, sigma : (poses, 3) unit vectors up, and (poses,) rad, standard uncertainty of the placement.
    """
    parts = means.parts
    if parts is None or means.specific_force is None:
        return HoldWander.none(means)
    density = placed_density(parts, means.specific_force[holds], holds, up_b, sigma)
    return HoldWander(density, parts.force_white, *_limits(means), parts.span)


def placed_density(
    parts: RestParts, force: Vectors, holds: np.ndarray, up_b: Vectors, sigma: Series
) -> Vector:
    """Return (3,) raw²: the density by which the accelerometers' biases wander over holds in poses that are known.

    Parameters
    ----------
    parts, force : of the rests, and (poses, 3) raw means of the holds.
    holds, up_b, sigma : as for `wander_of_force`.
    """
    moved = float(np.max(np.linalg.norm(force, axis=1))) * sigma[:, None]
    spread = moved**2 * (np.maximum(1.0 - up_b**2, 0.0) + 2.0 * sigma[:, None] ** 2)
    design = np.column_stack([np.ones(len(holds)), up_b])
    return find_density(parts, parts.force, parts.force_white, holds=holds, design=design, spread=spread)


def wander_of_rate(
    means: HoldMeans, holds: np.ndarray, up_b: Vectors, unseen: Vector, known: Vectors | None = None
) -> HoldWander:
    """Return how the gyros' biases wander over holds in poses that are known; a g-sensitivity is no wander.

    Parameters
    ----------
    means : of all holds.
    holds, up_b : (poses,) indices of those in known poses, (poses, 3) unit vectors up.
    unseen : (3,) raw², variance by an Earth rate of unknown heading.
    known : (poses, 3) raw, what each shows besides the bias, such as the Earth's rotation; None for nothing.
    """
    parts = means.parts
    if parts is None or parts.rate is None:
        return HoldWander.none(means)
    beside = np.zeros((len(means), 3))
    beside[holds] = 0.0 if known is None else known
    density = find_density(
        parts,
        parts.rate - beside[parts.hold],
        parts.rate_white,
        holds=holds,
        design=np.column_stack([np.ones(len(holds)), up_b]),
        spread=np.tile(unseen, (len(holds), 1)),
    )
    return HoldWander(density, parts.rate_white, *_limits(means), parts.span)


def wander_of_placed(wander: HoldWander, force: PlacedFit, holds: np.ndarray, attitudes: AnyArray) -> Square:
    """Return the covariance of a placed fit with what its holds have in common: biases that wander, and a placement.

    Holds one after another in the same attitude are of one placement: nobody took the unit away between them.

    Parameters
    ----------
    wander : of the triad.
    force : adjusted to the means of `holds`, in order of time, with the covariances of `HoldWander.of_each`.
    holds : their indices.
    attitudes : (holds, ...) nominal, with nan where nothing is known of them.
    """
    response = responses(force.adjustment)
    placed = placement_covariance(force.readings, force.matrix)
    change = np.zeros_like(force.covariance)
    nominal = np.column_stack([force.readings.nominal, np.nan_to_num(attitudes).reshape(len(holds), -1)])
    group = np.cumsum(np.append(True, np.any(np.abs(np.diff(nominal, axis=0)) > 1e-6, axis=1)))
    for number in np.unique(group):
        own = np.flatnonzero(group == number)
        for k, j in permutations(own.tolist(), 2):
            change += response[k] @ (0.5 * (placed[k] + placed[j])) @ response[j].T
    covariance = wider(force.covariance, 0.5 * (change + change.T))
    return wander.over(covariance, response, force.readings.covariance, holds)
