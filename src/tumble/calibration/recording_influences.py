"""What each observation of a recording does to its unknowns, and how biases wander that holds have in common."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Vector, inverted
from tumble.calibration.equations.adjustment import JointAdjustment
from tumble.calibration.equations.causes import FORCE_WANDER, RATE_WANDER
from tumble.calibration.equations.hold_equations import Rate
from tumble.calibration.equations.imu_unknowns import force_matrix, raw_force
from tumble.estimation.influence import Influences, influences_of
from tumble.estimation.solve import Settled, settled_at
from tumble.segmentation.rest_wander import RestParts, find_density

# Of which density is found: more show nothing more.
MOST_HOLDS = 60


def recording_influences(task: JointAdjustment, settled: Settled | None = None) -> Influences:
    """Return what each observation of a recording does to its unknowns at the solution.

    Parameters
    ----------
    task : settled.
    settled : its solution; None linearises once more.

    Raises
    ------
    ObservabilityError
        If shared unknowns are not determined.
    """
    data = task.data
    densities = {FORCE_WANDER: data.force_density, RATE_WANDER: data.rate_density}
    span = float(data.base.time[0]), float(data.base.time[-1])
    return influences_of(
        *(settled or settled_at(task), task.prior, densities, span), _between(task), data.wander_once
    )


def _between(task: JointAdjustment) -> dict[str, Vector]:
    """Source -> (3,) raw² per unit of ``ln f``: the densities by which biases wander, as all rests show them.

    Rests of one face lie near each other in time and share most of it: they scatter less among themselves than the
    faces do.
    """
    parts = task.data.base.parts
    # Holds that are too short to be cut into parts show no wander.
    if parts is None or parts.force is None:
        return {}
    made = {FORCE_WANDER: _force_density(task, parts)}
    if parts.rate is not None:
        made[RATE_WANDER] = _rate_density(task, parts)
    return made


def _holds(task: JointAdjustment, parts: RestParts, kind: str) -> np.ndarray:
    holds = np.intersect1d(np.flatnonzero(task.taking_part[kind]), parts.hold)
    return holds[:: max(1, -(-holds.size // MOST_HOLDS))]


def _rate_density(task: JointAdjustment, parts: RestParts) -> Vector:
    data, u = task.data, task.unknowns
    assert parts.rate is not None
    holds = _holds(task, parts, "rate")
    shown, up_b = np.zeros((data.holds, 3)), np.zeros((data.holds, 3))
    for section in task.sections:
        (linear,) = Rate(section).linearise(task)
        shown[section.holds] = linear.residual + data.base.rate_mean[section.holds]
        up_b[section.holds] = section.C_wb[:, 1, 2]
    columns = [np.ones(data.holds), *(up_b.T if u.is_free("gyro.g_sensitivity") else ())]
    design, signal = np.column_stack(columns)[holds], parts.rate - shown[parts.hold]
    return find_density(parts, signal, parts.rate_white, holds=holds, design=design)


def _force_density(task: JointAdjustment, parts: RestParts) -> Vector:
    """By the poses where most are believed; else by gravity's size, which is known of every hold.

    A unit that stays on its table from hold to spin is placed once: that one hold of seven shows nothing of a wander.
    Two holds show along gravity as much of one wander as their directions up have in common.
    """
    data, u, poses = task.data, task.unknowns, task.data.poses
    if poses is not None and data.holds < 2 * poses.hold.size <= 2 * MOST_HOLDS:
        at = np.isin(poses.hold, np.flatnonzero(task.taking_part["force"]))
        holds, up_b, sigma = poses.hold[at], poses.up_f[at], poses.sigma[at, None]
        moved = float(np.max(np.linalg.norm(data.base.force_mean[holds], axis=1))) * sigma
        spread = moved**2 * (np.maximum(1.0 - up_b**2, 0.0) + 2.0 * sigma**2)
        design = np.column_stack([np.ones(len(holds)), up_b])
        return find_density(parts, parts.force, parts.force_white, holds=holds, design=design, spread=spread)
    assert parts.force is not None
    up_b = -np.concatenate([section.C_wb[:, 1, 2] for section in task.sections])
    shown = raw_force(u, task.site.gravity * up_b)
    # What is seen along gravity, m/s², of a raw number: the others' part in it is a tilt's.
    along = np.einsum("ni,nij->nj", up_b, inverted(shown.by_true))
    columns = u.columns({name: along[:, None] @ block for name, block in shown.by_blocks.items()}, 0)[:, 0]
    holds, scale = _holds(task, parts, "force"), np.sum(force_matrix(u) ** 2, axis=1)
    signal = np.einsum("nj,nj->n", along[parts.hold], parts.force - shown.value[parts.hold])
    density = find_density(
        parts,
        signal[:, None],
        np.mean(parts.force_white / scale, keepdims=True),
        holds=holds,
        design=columns[holds],
        alike=up_b[holds] @ up_b[holds].T,
    )
    return density[0] * scale
