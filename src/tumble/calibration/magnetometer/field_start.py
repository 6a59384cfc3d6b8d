"""Where the adjustment of a magnetometer starts: a linear solution with the poses that both other triads tell."""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Series, Vectors, inverted
from tumble.calibration.magnetometer.field_equations import (
    AZIMUTH,
    BIAS,
    DIP,
    FIELD,
    MATRIX,
    FieldAdjustment,
    hold_shares,
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
    scaled = (raw - centre) / size
    rows, groups = _equations(task, active, scaled)
    solution = _robust(rows, groups, active.size)
    upright = 1.0 if np.linalg.det(solution[:9].reshape(3, 3)) > 0.0 else -1.0
    if not np.linalg.cond(solution[:9].reshape(3, 3)) < 1e8:
        raise ObservabilityError("The magnetometer's axes all show one direction in all holds.")
    A, c = upright * solution[:9].reshape(3, 3), upright * solution[9:12]
    field = _field_of(task, active, scaled @ A.T + c)
    norm = float(np.median(np.linalg.norm(scaled @ A.T + c, axis=1)))
    u, matrix = task.unknowns, norm * size * inverted(A)
    u[MATRIX][:] = matrix.ravel() / task.norm
    u[BIAS][:] = centre - matrix @ c / norm
    level = np.hypot(field[:, 0], field[:, 1])
    u[DIP][:] = float(np.median(np.arctan2(field[:, 2], level)))
    u[AZIMUTH][:] = np.arctan2(field[:, 1], field[:, 0])


def _equations(task: FieldAdjustment, active: np.ndarray, scaled: Vectors) -> tuple[AnyArray, np.ndarray]:
    """Rows of the homogeneous system, and which hold each belongs to."""
    long = [s for s in task.sections if np.count_nonzero(np.isin(active, s.holds)) >= LONG_SECTION]
    sole = not long
    width = 12 + (1 if sole else 3 * len(long))
    rows: list[AnyArray] = []
    groups: list[int] = []
    for place, section in enumerate(task.sections if sole else long):
        for at in np.flatnonzero(np.isin(active, section.holds)).tolist():
            k = active[at]
            shares = hold_shares(task, np.array([k]))[0]
            C = np.einsum("p,pij->ij", shares, section.C_wb[k - section.first])
            made = np.zeros((3, width))
            made[:, :9], made[:, 9:12] = (C[:, :, None] * scaled[at]).reshape(3, 9), C
            if sole:
                made = made[2:]
                made[0, 12] = -1.0
            else:
                made[:, 12 + 3 * place : 15 + 3 * place] = -np.eye(3)
            rows.append(made)
            groups += [at] * len(made)
    return np.concatenate(rows), np.array(groups)


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


def _field_of(task: FieldAdjustment, active: np.ndarray, field_b: Vectors) -> AnyArray:
    """(sections, 3) the median field of each section in its frame; of one without a hold that takes part along x."""
    made = np.tile(np.array([1.0, 0.0, 0.0]), (len(task.sections), 1))
    for place, section in enumerate(task.sections):
        at = np.flatnonzero(np.isin(active, section.holds))
        if at.size:
            k = active[at]
            C = np.einsum("kp,kpij->kij", hold_shares(task, k), section.C_wb[k - section.first])
            made[place] = np.median(np.einsum("kij,kj->ki", C, field_b[at]), axis=0)
    return made
