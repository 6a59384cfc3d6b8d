"""Where the adjustment of a magnetometer starts: a linear solution with the poses that both other triads tell."""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Matrices, Series, Vectors, inverted
from tumble.calibration.magnetometer.field_equations import (
    AZIMUTH,
    BIAS,
    DIP,
    FIELD,
    MATRIX,
    FieldAdjustment,
    mean_attitudes,
)
from tumble.errors import ObservabilityError

# Holds beyond so many times the median residual count for less, in so many rounds.
ROBUST, ROUNDS = 2.5, 12
# A section of so many holds tells its field by itself; of shorter ones, norm and dip alone serve.
LONG_SECTION = 4


def start_field(task: FieldAdjustment) -> None:
    """Give the magnetometer and the field values to start from.

    Parameters
    ----------
    task : its unknowns of the magnetometer and of the field are set.

    Raises
    ------
    ObservabilityError
        If the holds are fewer than the unknowns, or all alike.

    Notes
    -----
    With ``y = A r + c`` the calibrated field of raw numbers r, ``C y = f`` is linear and homogeneous in A, c and the
    field f of each section; so is ``down' y = v`` where nobody carries headings. The solution is the singular vector of
    the least singular value, with holds that contradict it counting for less. Its sign is free: A that is not mirrored
    is taken.
    """
    active = np.flatnonzero(task.taking_part[FIELD])
    raw = task.seen.mean[active]
    if active.size < 6:
        raise ObservabilityError(
            f"The magnetometer has {active.size} holds: record twelve or more in different attitudes."
        )
    centre = np.median(raw, axis=0)
    size = float(np.sqrt(np.mean((raw - centre) ** 2)))
    if not size > 0.0:
        raise ObservabilityError("The magnetometer shows the same in all holds: it is constant.")
    scaled, C = (raw - centre) / size, mean_attitudes(task)[active]
    firsts = [section.first for section in task.sections]
    place = np.searchsorted(firsts, active, side="right") - 1
    rows, groups = _equations(place, len(firsts), C, scaled)
    solution = _robust(rows, groups, active.size)
    upright = 1.0 if np.linalg.det(solution[:9].reshape(3, 3)) > 0.0 else -1.0
    if not np.linalg.cond(solution[:9].reshape(3, 3)) < 1e8:
        raise ObservabilityError("The magnetometer's axes all show one direction in all holds.")
    A, c = upright * solution[:9].reshape(3, 3), upright * solution[9:12]
    field_b = scaled @ A.T + c
    field_w, norm = np.einsum("kij,kj->ki", C, field_b), float(np.median(np.linalg.norm(field_b, axis=1)))
    # Of a section without a hold that takes part along x.
    along: Vectors = np.tile(np.array([1.0, 0.0, 0.0]), (len(firsts), 1))
    for section in np.unique(place).tolist():
        along[section] = np.median(field_w[place == section], axis=0)
    u, matrix = task.unknowns, norm * size * inverted(A)
    u[MATRIX][:] = matrix.ravel()
    u[BIAS][:] = centre - matrix @ c / norm
    level = np.hypot(along[:, 0], along[:, 1])
    u[DIP][:] = float(np.median(np.arctan2(along[:, 2], level)))
    u[AZIMUTH][:] = np.arctan2(along[:, 1], along[:, 0])


def _equations(place: np.ndarray, sections: int, C: Matrices, scaled: Vectors) -> tuple[AnyArray, np.ndarray]:
    """Rows of the homogeneous system, and which hold each belongs to."""
    rows = np.concatenate([(C[:, :, :, None] * scaled[:, None, None, :]).reshape(-1, 3, 9), C], axis=2)
    long = np.flatnonzero(np.bincount(place, minlength=sections) >= LONG_SECTION)
    if not long.size:
        return np.column_stack([rows[:, 2], -np.ones(len(rows))]), np.arange(len(rows))
    kept = np.flatnonzero(np.isin(place, long))
    which = np.eye(long.size)[np.searchsorted(long, place[kept])]
    field = (which[:, None, :, None] * np.eye(3)[:, None, :]).reshape(kept.size, 3, -1)
    return np.concatenate([rows[kept], -field], axis=2).reshape(3 * kept.size, -1), np.repeat(kept, 3)


def _robust(rows: AnyArray, groups: np.ndarray, holds: int) -> Series:
    weight = np.ones(holds)
    solution = np.zeros(rows.shape[1])
    for _ in range(ROUNDS):
        solution = np.linalg.svd(weight[groups, None] * rows, full_matrices=False)[2][-1]
        square = np.bincount(groups, (rows @ solution) ** 2, minlength=holds)
        off = np.sqrt(square)
        limit = ROBUST * float(np.median(off[np.unique(groups)])) + 1e-12
        weight = np.where(off > limit, limit / np.maximum(off, 1e-300), 1.0)
    return solution
