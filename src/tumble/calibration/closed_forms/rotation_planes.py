"""The axis of a rotation: as the gyros see it, and the plane that forces go round in (Zhang 2010, (41) to (47)).

The sense of the turn is in it too: seen from b, gravity goes round the other way. How well the normal is
known comes from the samples' own distances from the plane, in batches of a quarter of a revolution, so
that noise which lasts for many samples counts as what it is.

The axis of a rotation, as the gyros see it and as the accelerometers do (Zhang et al. 2010, (41) to (47)).

While a table turns, the specific force along its axis does not change: gravity's part along a fixed axis
is constant, and what a lever arm adds is always across it. The specific forces lie in a plane, and the
axis is its normal. If the axis is vertical they lie in a point, and nothing is to be seen.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Square, Table, Vector, Vectors, inverted
from tumble.calibration.closed_forms.rotation_pairs import RotationPair
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.sensor import Triad


def axis_from_rotation(matrix: AnyArray, rotation: AnyArray) -> AnyArray:
    """Return the unit axis in the gyros' frame o.

    Parameters
    ----------
    matrix : (..., 3, 3) of the gyros in o, raw per SI unit.
    rotation : (..., 3) raw·s, integral of a rotation without bias and Earth rate, such as the difference
        of the two directions.

    Notes
    -----
    Zhang et al. 2010, (41).
    """
    vector = np.linalg.solve(matrix, rotation[..., None])[..., 0]
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def scatter_in_p(matrix: AnyArray, raw_scatter: AnyArray) -> AnyArray:
    """Return the scatter (..., 3, 3) of true specific forces from that of raw ones.

    Parameters
    ----------
    matrix : (..., 3, 3) of the accelerometers.
    raw_scatter : (..., 3, 3), the mean of products of the deviations from the mean, raw units squared.
    """
    inverse = np.linalg.inv(matrix)
    return inverse @ raw_scatter @ np.swapaxes(inverse, -1, -2)


def axis_from_scatter(scatter: AnyArray) -> AnyArray:
    """Return the unit normal of the plane that the specific forces lie in; its sign is open.

    Parameters
    ----------
    scatter : (..., 3, 3) of the specific force about its mean, true units.

    Notes
    -----
    Zhang et al. 2010, (44) to (47). The matrix A of (46) is not square: ς is its right null vector.
    About the mean κ has gone; both ways are as good.
    """
    return np.ascontiguousarray(np.linalg.eigh(scatter)[1][..., :, 0])


# The least sine of the axis' angle to the vertical: below 6 degrees gravity shows less than a tenth of itself.
SMALLEST_SINE = 0.1
# An axis known no better than this helps no inter-triad angle: what assembly leaves is smaller.
WORST_SIGMA = 5e-3  # rad
# Batches for the noise: a quarter of a revolution, and as many at least.
BATCHES_A_TURN, FEWEST_BATCHES = 4, 8


@dataclass(frozen=True, slots=True)
class RotationPlane:
    """What the accelerometers saw of a pair of rotations.

    Attributes
    ----------
    normal : (3,) unit vector in b along the axis, counter-clockwise as `RotationPair.forward`.
    tangents : (2, 3) unit vectors across it.
    covariance : (2, 2) of its components along the tangents, rad².
    sine : of the angle between the axis and the vertical.
    residual : m/s², root mean square distance of the samples from the plane.
    why : why it cannot be used, as a sentence; empty if it can.
    """

    normal: Vector
    tangents: Table
    covariance: Square
    sine: float
    residual: float
    why: str = ""


def observe_plane(
    recording: Recording, pair: RotationPair, triad: Triad, gravity: float, noise: Vector
) -> RotationPlane:
    """Fit the plane of a pair of rotations through the specific forces of all its samples.

    Parameters
    ----------
    recording : with accelerometers.
    pair : whose samples at the constant rate are taken.
    triad : the accelerometers.
    gravity : m/s².
    noise : (3,) standard deviation of a sample at rest, raw: its square is taken out of the scatter.
    """
    assert recording.specific_force is not None
    inverse = inverted(triad.matrix)
    pieces: list[Vectors] = []
    sense = np.zeros(3)
    scatter, count, level = np.zeros((3, 3)), 0, np.zeros(3)
    for side, sign in ((pair.forward, 1.0), (pair.backward, -1.0)):
        for rotation in side:
            raw = np.asarray(recording.specific_force[rotation.start : rotation.stop], dtype=np.float64)
            mean = raw.mean(axis=0)
            piece = (raw - mean) @ inverse.T
            pieces.append(piece)
            scatter += piece.T @ piece
            count += len(piece)
            level += len(piece) * (inverse @ (mean - triad.bias))
            eighth = max(1, len(piece) // (8 * max(1, round(abs(rotation.angle) / (2.0 * np.pi)))))
            sense -= sign * np.sum(np.cross(piece[:-eighth], piece[eighth:]), axis=0)
    scatter = scatter / count - scatter_in_p(triad.matrix, np.diag(noise**2))
    normal = axis_from_scatter(scatter)
    normal = normal * np.sign(float(normal @ sense) or 1.0)
    values, vectors = np.linalg.eigh(scatter)
    tangents = np.ascontiguousarray(vectors[:, 1:].T)
    sine = float(np.sqrt(max(values[1] + values[2], 0.0)) / gravity)
    covariance = _covariance(pair, pieces, normal, tangents, values[1:] * count)
    squares = np.concatenate([(piece @ normal) ** 2 for piece in pieces])
    why = _useless(pair, sine, covariance)
    return RotationPlane(normal, tangents, covariance, sine, float(np.sqrt(np.mean(squares))), why)


def _covariance(
    pair: RotationPair, pieces: list[Vectors], normal: Vector, tangents: Table, size: Series
) -> Square:
    """Covariance of the normal's two components, from sums over batches of a quarter of a revolution."""
    rotations = [*pair.forward, *pair.backward]
    total, batches = np.zeros((2, 2)), 0
    for piece, rotation in zip(pieces, rotations, strict=True):
        turns = abs(rotation.angle) / (2.0 * np.pi)
        number = max(int(BATCHES_A_TURN * turns), FEWEST_BATCHES)
        moments = (piece @ normal)[:, None] * (piece @ tangents.T)
        length = max(len(moments) // number, 1)
        sums = moments[: len(moments) // length * length].reshape(-1, length, 2).sum(axis=1)
        total += sums.T @ sums
        batches += len(sums)
    # two components and a mean were taken from each rotation
    kept = max(batches - 3 * len(pieces), 1) / max(batches, 1)
    least = np.maximum(np.abs(size), 1e-300)
    return np.asarray(total / kept / np.outer(least, least), dtype=np.float64)


def _useless(pair: RotationPair, sine: float, covariance: Square) -> str:
    if sine < SMALLEST_SINE:
        return (
            f"The axis {pair.name} stood within {np.degrees(np.arcsin(min(sine, 1.0))):.1f}° of the "
            "vertical while the unit was turned about it: the accelerometers see gravity along it "
            "all the time and cannot determine the axis."
        )
    sigma = float(np.sqrt(np.max(np.linalg.eigvalsh(covariance))))
    if sigma > WORST_SIGMA:
        return (
            f"The accelerometers determine the axis {pair.name} to {1e3 * sigma:.2g} mrad only: too "
            "noisy, too short, or too small a part of a revolution."
        )
    return ""


def normal_in_raw(normal: Vector, matrix: Matrix) -> Vector:
    """Return the plane's normal in the space of raw readings, where the triad's errors do not move it.

    Parameters
    ----------
    normal : (3,) in b.
    matrix : (3, 3) of the accelerometers with which it was found.
    """
    return np.asarray(np.linalg.solve(matrix.T, normal), dtype=np.float64)
