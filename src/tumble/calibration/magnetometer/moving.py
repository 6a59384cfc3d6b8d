"""Does the field move while it is recorded? A current that is switched on, a motor, a unit that is magnetised.

A change in the room turns with the field of the place; one on the unit is a change of its bias. Both are tried as
what grows steadily and as what begins between two holds, each by the step that the adjustment would make with it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import Series, Square, Table, inverted
from tumble.calibration.magnetometer.field_equations import (
    FIELD,
    IN_ROOM,
    ON_UNIT,
    FieldAdjustment,
    magnetometer_matrix,
)
from tumble.estimation.settled import Settled
from tumble.estimation.solve import linearise
from tumble.records import dataclass

FALSE_ALARM = 1e-3
"""Chance that a recording in a field that stays is said to move."""
# Holds on either side of a change, so that a single one that is off is no change.
LEAST_HOLDS = 3
# Of many holds so many are tried as the last one before a step; one between is seen by its neighbours.
MOST_STEPS = 24
# Redundant observations without which nothing is said.
LEAST_REDUNDANCY = 8.0


@dataclass(frozen=True, slots=True)
class Moving:
    """A change of the field while it is recorded.

    Attributes
    ----------
    where : "room" or "unit".
    before : the hold after which it begins; -1 for what grows steadily.
    share : its size as a share of the field's norm.
    probability : that chance does it, of all that was tried.
    """

    where: str
    before: int
    share: float
    probability: float


def find_moving(task: FieldAdjustment, solution: Settled) -> Moving | None:
    """Return the most significant change of the field; None where chance explains all.

    Parameters
    ----------
    task, solution : settled.
    """
    from scipy.special import fdtrc

    tests = solution.tests().get(FIELD)
    if tests is None:
        return None
    square, redundancy = float(tests.square.sum()), float(tests.redundancy.sum())
    courses = _courses(task)
    found: Moving | None = None
    for before, course in courses:
        for where, (gain, share, size) in _gains(task, course).items():
            if redundancy - size < LEAST_REDUNDANCY:
                continue
            left = max(square - gain, 1e-12 * square) / (redundancy - size)
            # Steady growth has half of the false alarms, all the steps together the other.
            tried = 4.0 if before < 0 else 4.0 * (len(courses) - 1)
            chance = min(1.0, tried * float(fdtrc(size, redundancy - size, gain / size / left)))
            if found is None or chance < found.probability:
                found = Moving(where, before, share, chance)
    return found if found is not None and found.probability < FALSE_ALARM else None


def with_change(task: FieldAdjustment, moving: Moving) -> FieldAdjustment:
    """Return the adjustment with a change of the field among its unknowns.

    Parameters
    ----------
    task, moving : as it was before, and what was found.
    """
    u = task.unknowns
    chosen = _told(task)[moving.where]
    active = np.flatnonzero(task.taking_part[FIELD])
    course = _growth(task, active) if moving.before < 0 else _step(task, moving.before)
    return replace(task.copy(), unknowns=u.with_free(np.union1d(u.free, chosen)).copy(), course=course)


def _growth(task: FieldAdjustment, active: np.ndarray) -> Series:
    time = task.seen.time
    return (time - time[active[0]]) / (time[active[-1]] - time[active[0]])


def _step(task: FieldAdjustment, before: int) -> Series:
    return (np.arange(task.seen.time.size) > before).astype(float)


def _told(task: FieldAdjustment) -> dict[str, np.ndarray]:
    """The unknowns of a change in the room and of one on the unit; without a gyro nothing determines its azimuth."""
    layout = task.unknowns.layout
    room, unit = layout.indices(IN_ROOM), layout.indices(ON_UNIT)
    alone = max(section.last - section.first for section in task.sections) < LEAST_HOLDS
    return {"room": room[[0, 2]] if alone else room, "unit": unit}


def _courses(task: FieldAdjustment) -> list[tuple[int, Series]]:
    """What may happen: steady growth (-1), and a step after a hold."""
    active = np.flatnonzero(task.taking_part[FIELD])
    if active.size < 2 * LEAST_HOLDS:
        return []
    made = [(-1, _growth(task, active))]
    inner = active[LEAST_HOLDS - 1 : -LEAST_HOLDS]
    for k in inner[:: -(-inner.size // MOST_STEPS)].tolist():
        made.append((k, _step(task, k)))
    return made


def _gains(task: FieldAdjustment, course: Series) -> dict[str, tuple[float, float, int]]:
    """How far the square sum falls with a change of either kind, how large that is, and its unknowns."""
    u = task.unknowns
    room, unit = _told(task).values()
    trial = replace(
        task, unknowns=u.with_free(np.union1d(u.free, np.concatenate([room, unit]))), course=course
    )
    _, normal, gradient = linearise(trial)
    made: dict[str, tuple[float, float, int]] = {}
    for where, chosen, others in (("room", room, unit), ("unit", unit, room)):
        at, gone = trial.unknowns.places(chosen), trial.unknowns.places(others)
        kept = np.setdiff1d(np.arange(trial.unknowns.free.size), gone)
        spread = _block_of_inverse(normal[np.ix_(kept, kept)], np.searchsorted(kept, at))
        if spread is None:
            continue
        step = -spread @ gradient[at]
        if where == "unit":
            step = inverted(magnetometer_matrix(u)) @ step
        gain = float(gradient[at] @ spread @ gradient[at])
        made[where] = gain, float(np.linalg.norm(step)), int(at.size)
    return made


def _block_of_inverse(normal: Square, at: np.ndarray) -> Table | None:
    scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
    scaled = normal * np.outer(scale, scale)
    if np.linalg.cond(scaled) > 1e13:
        return None
    return (inverted(scaled) * np.outer(scale, scale))[np.ix_(at, at)]
