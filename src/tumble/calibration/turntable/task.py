"""What the steps of the turntable procedure share: the task, the outcome, what the tests say."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Square, Vector, Vectors, inverted
from tumble.calibration.closed_forms.rotation_pairs import RotationPair
from tumble.calibration.closed_forms.rotation_planes import SMALLEST_SINE, RotationPlane
from tumble.calibration.estimate import (
    TermTest,
)
from tumble.calibration.procedures.multi_position import TriadFit
from tumble.calibration.turntable.solution import (
    TurntableSystem,
)
from tumble.earth import EARTH_RATE, Site
from tumble.recording.recording import Recording
from tumble.segmentation import HoldMeans

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
