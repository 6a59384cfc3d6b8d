"""What the steps of the turntable procedure share: task, outcome, tests, and what the gyros make of its rotations.

What the calibrated gyros make of a table's rotations, an axis at a time: for the turntable and the laboratory.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Square, Vector, Vectors, inverted
from tumble.calibration.closed_forms.rotation_pairs import RotationPair
from tumble.calibration.closed_forms.rotation_planes import SMALLEST_SINE, RotationPlane
from tumble.calibration.estimate import (
    TermTest,
)
from tumble.calibration.evidence import Spins, TurnedAngle
from tumble.calibration.procedures.multi_position import TriadFit
from tumble.calibration.turntable.solution import (
    TurntableSystem,
)
from tumble.earth import EARTH_RATE, Site
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.segmentation import HoldMeans


def spins_evidence(
    pairs: Sequence[RotationPair], axes_b: Sequence[Vector], matrix: Matrix, parts: dict[int, Vector]
) -> Spins:
    """Return mean rates of all rotations, found in a pair or not, and what the gyros show beyond them.

    Parameters
    ----------
    pairs : rotations both ways about each axis.
    axes_b : unit vectors in b.
    matrix : (3, 3) of the gyros.
    parts : of bias and Earth rate in each rotation, raw·s, by `Rotation.row`.
    """
    count = 1 + max(r.row for pair in pairs for r in pair.rotations)
    inverse = inverted(matrix)
    rates, names = np.zeros(count), ["a rotation without its counterpart"] * count
    residuals, sigmas = np.full((count, 3), np.nan), np.full((count, 3), np.nan)
    for pair, axis in zip(pairs, axes_b, strict=True):
        for side, sign in ((pair.forward, 1.0), (pair.backward, -1.0)):
            for r in side:
                rates[r.row] = sign * abs(r.angle) / r.seconds
                turned = inverse @ (r.integral - parts[r.row])
                residuals[r.row] = (turned - sign * abs(r.angle) * axis) / r.seconds
                spread = inverse @ r.covariance @ inverse.T + r.angle_sigma**2 * np.outer(axis, axis)
                sigmas[r.row] = np.sqrt(np.diag(spread)) / r.seconds
                names[r.row] = f"{pair.name}, {'counter-clockwise' if sign > 0 else 'clockwise'}"
    return Spins(rates, residuals, sigmas, tuple(names))


def turned_angles(
    pair: RotationPair, axis_b: Vector, matrix: Matrix, parts: dict[int, Vector]
) -> tuple[TurnedAngle, ...]:
    """Return the angles of one axis, as the table and as the gyros have them.

    Parameters
    ----------
    pair : rotations both ways.
    axis_b, matrix, parts : as for `spins_evidence`.
    """
    inverse = inverted(matrix)
    weight = axis_b @ inverse
    angles: list[TurnedAngle] = []
    for r in pair.rotations:
        sign = 1.0 if r in pair.forward else -1.0
        turned = float(axis_b @ (inverse @ (r.integral - parts[r.row]))) * sign
        sigma = float(np.sqrt(weight @ r.covariance @ weight + r.angle_sigma**2))
        residual = turned - abs(r.angle)
        angles.append(TurnedAngle(r.row, sign * abs(r.angle), residual, sigma, r.seconds, r.is_from_rest))
    return tuple(angles)


# The Earth rate is seen in a hold if its mean is known to a fifth of it.
SEEN = 0.2


@dataclass(slots=True)
class TurntableTask:
    """What the steps of the procedure share.

    Attributes
    ----------
    recording, means, site : what was recorded, its holds, and where.
    force : the accelerometers' adjustment.
    pairs, planes : the rotations about each axis, and what the accelerometers saw of them.
    rests : indices of the holds that show the gyros at rest.
    lonely : sentences on rotations without a counterpart.
    """

    recording: Recording
    means: HoldMeans
    site: Site
    force: TriadFit
    pairs: list[RotationPair]
    planes: list[RotationPlane]
    rests: np.ndarray
    lonely: list[str]


@dataclass(slots=True)
class TurntableTests:
    """Square sums and degrees of freedom of what the table's angles, the axes and the rests leave."""

    angles: tuple[float, int]
    axes: tuple[float, int]
    rests: tuple[float, int]


@dataclass(slots=True)
class TurntableOutcome:
    """The solution, and what it was made with.

    Attributes
    ----------
    system : the solution as a function of its inputs.
    unknowns : (30,) its values.
    parts : of bias and Earth rate in each rotation, raw·s, by `Rotation.row`.
    tests : what the steps leave.
    scaled : factors on the noise of what contradicted itself, by name.
    term : the test of the g-sensitivity; None where rests cannot tell it.
    unseen : (3, 3) raw², covariance of the biases by a g-sensitivity that was not kept and cannot be excluded.
    """

    system: TurntableSystem
    unknowns: Series
    parts: dict[int, Vector]
    tests: TurntableTests
    scaled: dict[str, float]
    term: TermTest | None
    unseen: Square

    @property
    def terms(self) -> frozenset[str]:
        """Optional terms that were estimated."""
        return frozenset({"g_sensitivity"}) if self.system.with_sensitivity else frozenset[str]()


def are_apart(axes: list[Vector]) -> bool:
    """Return whether two of the axes enclose an angle worth the name."""
    spread = np.linalg.svd(np.array(axes), compute_uv=False)
    return bool(spread[1] > SMALLEST_SINE * spread[0])


def sees_earth(matrix: Matrix, covariance: AnyArray) -> bool:
    """Tell whether gyros of this matrix know the mean of a hold, with this covariance, to a fifth of the Earth rate."""
    inverse = inverted(matrix)
    variance = np.einsum("ij,kjl,il->k", inverse, covariance, inverse) / 3.0
    return bool(np.sqrt(np.median(variance)) < SEEN * EARTH_RATE)


def shows_earth(matrix: Matrix, rest: Vectors, covariance: AnyArray) -> bool:
    """Return whether the rests differ by what the Earth rate makes of different attitudes."""
    scatter = np.std(rest @ inverted(matrix).T, axis=0)
    return bool(np.linalg.norm(scatter) > SEEN * EARTH_RATE) and sees_earth(matrix, covariance)
