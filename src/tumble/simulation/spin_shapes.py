"""How a table's spins run: ramps up and down, waves of the angle on the way, and an axis that wobbles.

A spin turns by a rotation vector of length Φ. Its angle is φ(t) = ψ(t) + Σ A (sin(n ψ + β) − sin β), less
what the waves would leave at its end, in proportion to ψ: so that it ends at Φ. ψ comes to a constant rate
and stops from it, and every wave rests with it. All are closed formulas of time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import AnyArray, Series, Vector, Vectors
from tumble.records import dataclass

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


@dataclass(frozen=True)
class SpinShapes:
    """One row for each turn; a turn that is no spin has NaN for its ramps and zeros.

    Attributes
    ----------
    ramp_up, ramp_down : (turns,) s to come to the constant rate, and to stop from it.
    amplitude, phase : (turns, waves) rad, of each wave of the angle; its phase is that at the start.
    cycles : (waves,) per revolution.
    wobble_b : (turns, 3) rad, in b and across the axis: by which the axis leans at the start. The lean goes
        round once a revolution in the room, against the turn.
    """

    ramp_up: AnyArray
    ramp_down: AnyArray
    amplitude: AnyArray
    cycles: AnyArray
    phase: AnyArray
    wobble_b: AnyArray

    @staticmethod
    def even(ramp: AnyArray) -> SpinShapes:
        """Return spins with equal ramps, no waves and no wobble.

        Parameters
        ----------
        ramp : (turns,) s; NaN for a turn that is no spin.
        """
        turns = len(ramp)
        none = np.zeros((turns, 0))
        return SpinShapes(ramp, ramp, none, np.zeros(0), none, np.zeros((turns, 3)))

    @property
    def wobbles(self) -> bool:
        """Whether any axis does."""
        return bool(np.any(self.wobble_b))

    def between_holds(self) -> SpinShapes:
        """Return one row for each hold and each turn, in order."""

        def spread(rows: AnyArray, filler: float) -> AnyArray:
            result = np.full((2 * len(rows) + 1, *rows.shape[1:]), filler)
            result[1::2] = rows
            return result

        return SpinShapes(
            spread(self.ramp_up, np.nan),
            spread(self.ramp_down, np.nan),
            spread(self.amplitude, 0.0),
            self.cycles,
            spread(self.phase, 0.0),
            spread(self.wobble_b, 0.0),
        )

    def add_waves(self, rows: np.ndarray, angle: Series, progress: AnyArray) -> None:
        """Add the waves to the share of each spin's angle, and to its first and second time derivative.

        Parameters
        ----------
        rows : (samples,) row of each sample's spin.
        angle : (samples,) rad, its whole angle.
        progress : (3, samples) without waves.
        """
        share, speed, gain = progress
        amplitude, phase = self.amplitude[rows] / angle[:, None], self.phase[rows]
        turned = angle[:, None] * self.cycles
        at = turned * share[:, None] + phase
        left = np.sum(amplitude * (np.sin(turned + phase) - np.sin(phase)), axis=1)
        waves = np.sum(amplitude * (np.sin(at) - np.sin(phase)), axis=1) - left * share
        slope = 1.0 + np.sum(amplitude * turned * np.cos(at), axis=1) - left
        bend = -np.sum(amplitude * turned**2 * np.sin(at), axis=1)
        progress[2] = slope * gain + bend * speed**2
        progress[1] *= slope
        # At its end the waves have gone to the last digit.
        progress[0] = np.where(share < 1.0, share + waves, 1.0)


def wobble_rotation(axis_b: Vectors, angle: Series, wobble_b: Vectors) -> Rotation:
    """Return the rotation that a wobbling axis adds after the turn by an angle; none at the start.

    Parameters
    ----------
    axis_b : (rows, 3) unit vectors that the angle is about.
    angle : (rows,) rad turned so far.
    wobble_b : (rows, 3) rad, lean at the start, across the axis.
    """
    from scipy.spatial.transform import Rotation

    # The lean goes in the room by minus the angle, and so in b by minus twice it. The lean at the start, which
    # stays in the room, is taken away: the mean axis is in b where it is meant to be.
    at_start = Rotation.from_rotvec(-_turned(wobble_b, axis_b, -angle))
    return at_start * Rotation.from_rotvec(_turned(wobble_b, axis_b, -2.0 * angle))


def wobbling_axis(axis_b: Vectors, angle: Series, wobble_b: Vectors) -> tuple[Vectors, Vectors]:
    """Return the angular rate in b per rate of the angle, and its derivative by the angle.

    The attitude is a turn by minus the angle about the axis, and one by twice the angle about the axis as
    it leans: two turns about fixed axes.

    Parameters
    ----------
    axis_b, angle, wobble_b : as for `wobble_rotation`.
    """
    from scipy.spatial.transform import Rotation

    leaning = Rotation.from_rotvec(-wobble_b).apply(axis_b)
    back = _turned(leaning, axis_b, -2.0 * angle)
    return 2.0 * axis_b - back, 2.0 * np.cross(axis_b, back)


def _turned(vector: Vectors, axis: Vectors, angle: Series) -> Vectors:
    """Vectors turned about unit vectors."""
    sine, cosine = np.sin(angle)[:, None], np.cos(angle)[:, None]
    along = np.sum(axis * vector, axis=1, keepdims=True) * axis
    return along + cosine * (vector - along) + sine * np.cross(axis, vector)


def directions_of(vectors: Vectors) -> tuple[Vectors, Series]:
    """Return unit vectors and lengths; where there is no length, any direction.

    Parameters
    ----------
    vectors : (rows, 3).
    """
    length = np.linalg.norm(vectors, axis=1)
    away: Vector = np.array([1.0, 0.0, 0.0])
    return np.where(
        length[:, None] > 0.0, vectors / np.where(length > 0.0, length, 1.0)[:, None], away
    ), length
