"""Which way is up in each hold, roughly, from raw specific forces whose scale and centre nobody knows."""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Vector, Vectors
from tumble.records import dataclass


@dataclass(frozen=True, slots=True)
class RoughScale:
    """One centre and one scale for a triad: ``raw = centre + scale * direction``, raw units.

    Scale factors that differ by 10 % among the axes turn a direction by 3 degrees at most.
    """

    centre: Vector
    scale: float

    def directions(self, raw: Vectors) -> Vectors:
        """Return the directions of raw specific forces as unit vectors.

        Parameters
        ----------
        raw : (holds, 3) raw units.
        """
        away = raw - self.centre
        return away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-300)


def scale_of_units(raw: Vectors) -> RoughScale:
    """Return the scale of specific forces in physical units, whose centre is zero within half a g."""
    return RoughScale(np.zeros(3), float(np.median(np.linalg.norm(raw, axis=1))))


def scale_of_sphere(raw: Vectors) -> RoughScale | None:
    """Return the sphere through the specific forces of poses that are not all in one plane.

    None where they do not determine one.
    """
    middle = 0.5 * (raw.max(axis=0) + raw.min(axis=0))
    reach = float(np.max(np.abs(raw - middle)))
    if len(raw) < 4 or reach == 0.0:
        return None
    unit = (raw - middle) / reach
    design = np.column_stack([2.0 * unit, np.ones(len(unit))])
    values = np.linalg.svd(design, compute_uv=False)
    if values[-1] < 0.15 * values[0]:
        return None
    solution: AnyArray = np.linalg.pinv(design) @ np.sum(unit**2, axis=1)
    square = float(solution[3] + solution[:3] @ solution[:3])
    return RoughScale(middle + reach * solution[:3], reach * square**0.5) if square > 0.0 else None


def scale_of_poses(raw: Vectors, up_b: Vectors) -> RoughScale | None:
    """Return the centre and scale that bring raw specific forces nearest to known directions.

    None where the directions are too alike to tell a centre from a scale, or a scale comes out negative.

    Parameters
    ----------
    raw, up_b : (holds, 3) raw units, and unit vectors.
    """
    if len(raw) < 2:
        return None
    mean_raw, mean_up = raw.mean(axis=0), up_b.mean(axis=0)
    spread = float(np.sum((up_b - mean_up) ** 2))
    if spread < 0.5:
        return None
    scale = float(np.sum((raw - mean_raw) * (up_b - mean_up))) / spread
    return RoughScale(mean_raw - scale * mean_up, scale) if scale > 0.0 else None
