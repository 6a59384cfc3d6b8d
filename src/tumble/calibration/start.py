"""Where an adjustment starts: attitudes from gravity and the gyros, rough sensors, and triads that are missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from tumble.arrays import Matrices, Matrix, Square, Vectors, inverted
from tumble.attitude import matrix_from_rotation_vector
from tumble.calibration.checks.triad_agreement import refuse_contradicting_axes
from tumble.calibration.equations.adjustment import JointAdjustment
from tumble.calibration.equations.holds_and_turns import HoldsAndTurns
from tumble.calibration.equations.imu_unknowns import gyro_matrix, imu_unknowns
from tumble.calibration.equations.observed import BelievedPoses, Observed
from tumble.calibration.equations.pose_equations import align_with_poses
from tumble.calibration.equations.rotation_equations import start_rotation
from tumble.calibration.equations.state import RotationState, Section
from tumble.calibration.equations.triad_unknowns import (
    COUNT,
    rough_gyro_matrix,
    rough_triad,
    triad_from_unknowns,
)
from tumble.calibration.equations.turn_equations import integrate_links
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ObservabilityError
from tumble.estimation import Noise, Unknowns
from tumble.recording import Recording
from tumble.segmentation import HoldMeans, Rotation, Timeline
from tumble.units import angular_rate_factor, specific_force_factor

# A rough matrix whose entries are less certain than this share is no better than the unit's own name plate.
ROUGH_ENOUGH = 0.03
# Of a nominal scale, how far rough accelerometer values may be off before they are not believed.
PLAUSIBLE = 0.3
# Of a sample of gyros that there are not: they say nothing of how a hold sways, and are no round-off's weight.
NO_RATE = 1e-2  # rad/s
# Of the direction up in a hold that nobody says the placement of.
UNPLACED = 10.0  # rad
# Rests, and how far their poses spread, from which on gyros at rest tell a g-sensitivity to start from.
FEWEST_RESTS, LEAST_SPREAD = 9, 0.05
# By which a bias may wander, a turn err and a pose sway, as long as nobody knows better.
START_FORCE, START_TURN, START_SWAY = 5e-3, 1e-3, 1e-4  # m/s², rad, rad


def start_adjustment(data: Observed, u: Unknowns, site: Site) -> JointAdjustment:
    """Return an adjustment with attitudes from gravity in each hold, and headings that the gyros carry.

    Parameters
    ----------
    data, site : what was observed, and where.
    u : start values.
    """
    level = _attitudes_from_force(triad_from_unknowns(u.values[:COUNT]).correct(data.parts.reshape(-1, 3)))
    level = level.reshape(-1, 3, 3, 3)
    earth = np.zeros(3)
    if site.latitude is not None:
        earth[2] = -EARTH_RATE * np.sin(site.latitude)
    made = JointAdjustment(data, site, u.copy())
    carried = _carried(data, u)
    for first, last in data.sections:
        C = level[first:last].copy()
        for k in range(first, last):
            here = C[k - first]
            here[1], here[2] = _same_heading(here[1], here[0]), _same_heading(here[2], here[0])
            if k + 1 == last:
                continue
            if k in data.rotations:
                made.rotations[k] = start_rotation(data, data.rotations[k], here[2], u, earth)
                on = _carried_end(data, k, made.rotations[k], u)
            else:
                on = here[2] @ carried[k]
            C[k + 1 - first, 0] = _same_heading(C[k + 1 - first, 0], on)
        made.sections.append(Section(int(first), int(last), C, earth.copy()))
    if data.poses is not None:
        align_with_poses(made)
    return made


def _attitudes_from_force(force_b: Vectors) -> Matrices:
    """Return (rows, 3, 3) level attitudes C_wb of any heading from specific forces in b."""
    down = -force_b / np.linalg.norm(force_b, axis=1, keepdims=True)
    first = np.eye(3)[np.argmin(np.abs(down), axis=1)]
    north = first - np.sum(first * down, axis=1, keepdims=True) * down
    north /= np.linalg.norm(north, axis=1, keepdims=True)
    east = np.asarray(np.cross(down, north), dtype=np.float64)
    return np.stack([north, east, down], axis=1)


def _carried(data: Observed, u: Unknowns) -> Matrices:
    """(holds, 3, 3) what the gyros turn by hand from each hold to the next; zeros where they do not."""
    C_se = np.zeros((data.holds, 3, 3))
    k = np.array([k for k in data.turns.tolist() if k not in data.rotations], dtype=int)
    if k.size:
        C_se[k] = integrate_links(data, u, data.base.turn_start[k], data.base.turn_stop[k]).C_se
    return C_se


def _carried_end(data: Observed, k: int, rotation: RotationState, u: Unknowns) -> Square:
    last = np.array([data.rotations[k].centres[-1]])
    link = integrate_links(data, u, last, np.array([data.base.head[k + 1, 0] + 1]))
    return np.asarray(rotation.C_wb[-1] @ link.C_se[0], dtype=np.float64)


def _same_heading(level: Square, carried: Square) -> Square:
    """Turn `level` about the vertical until it is as near to `carried` as it can be."""
    across = carried @ level.T
    heading = np.arctan2(across[1, 0] - across[0, 1], across[0, 0] + across[1, 1])
    return np.asarray(matrix_from_rotation_vector(np.array([0.0, 0.0, heading])) @ level, dtype=np.float64)


def rough_variances(base: HoldsAndTurns, u: Unknowns, *, has_gyro: bool) -> Noise:
    """Return variances to start from where little is told: what residuals do not ask for goes away again.

    Without them a bias that wanders from hold to hold would first be taken for an error of what nothing else tells.

    Parameters
    ----------
    base, u, has_gyro : what was observed, and where the adjustment starts.
    """
    rate = 0.0
    if has_gyro:
        seen = base.rate_mean @ inverted(gyro_matrix(u)).T
        rate = float(np.mean(np.median(np.abs(seen - np.median(seen, axis=0)), axis=0) / 0.6745)) ** 2
    added = {"force": START_FORCE**2, "rate": rate, "turn": START_TURN**2, "sway": START_SWAY**2}
    return Noise(added)


def rough_start(offered: Offered, site: Site, rotations: Sequence[Rotation] = ()) -> Unknowns:
    """Return rough values of both triads, of counts or SI alike.

    Accelerometers from the norms of the holds, the gyros' matrix from how turns turn gravity, or nominal where
    they tell too little.

    Parameters
    ----------
    offered, site : what was recorded, with stand-ins, and where.
    rotations : of a table, whose angles tell the size of a gyro's counts where turns do not.

    Raises
    ------
    ObservabilityError
        If a gyro is in counts and no turn determines its scale.
    RecordingError
        If the turns contradict the order, signs or units of the columns.
    """
    recording, means = offered.recording, offered.means
    assert means.specific_force is not None
    assert means.angular_rate is not None
    u = imu_unknowns()
    u["force.scale"][:] = 1.0
    factor = specific_force_factor(recording.specific_force_unit)
    if offered.has_force:
        u.values[:COUNT] = rough_triad(means.specific_force, site.gravity)
        if factor is not None and np.any(np.abs(u["force.scale"] * factor - 1.0) > PLAUSIBLE):
            u.values[:COUNT] = 0.0
            u["force.scale"][:] = 1.0 / factor
    u["gyro.matrix"][:] = np.eye(3).ravel()
    if offered.has_gyro:
        u["gyro.bias"][:] = np.median(means.angular_rate, axis=0)
        # Raw, of each rotation about its axis by a radian.
        each = [(one.integral - one.seconds * u["gyro.bias"]) / abs(one.angle) for one in rotations]
        turned = np.array(each).reshape(-1, 3)
        rated = turned[[k for k, one in enumerate(rotations) if not one.is_from_rest]]
        u["gyro.matrix"][:] = _sized(_gyro_matrix(recording, offered.timeline, u, turned), rated).ravel()
        _start_g_sensitivity(u, means.specific_force, means.angular_rate)
    return u


def _start_g_sensitivity(u: Unknowns, force: Vectors, rate: Vectors) -> None:
    """Start the gyros' bias and g-sensitivity at the line of rates at rest on force, if there are poses enough."""
    force_b = triad_from_unknowns(u.values[:COUNT]).correct(force)
    design = np.column_stack([np.full(len(force_b), np.linalg.norm(force_b[0])), force_b])
    line, _, rank, _ = np.linalg.lstsq(design, rate, rcond=LEAST_SPREAD)
    if rank == 4 and len(force_b) >= FEWEST_RESTS:
        u["gyro.bias"][:], u["gyro.g_sensitivity"][:] = design[0, 0] * line[0], line[1:].T.ravel()


def _sized(matrix: Matrix, turned: Vectors) -> Matrix:
    """A gyro's matrix that turns as far as a table at its rates does, about the axes that it has."""
    # Gravity on the axis tells no size, and too small a one where sensing axes are askew; and an angle that is off by
    # half a revolution would be taken for another one.
    axes = turned @ inverted(matrix).T
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    left = turned - axes @ matrix.T
    return np.asarray(matrix + left.T @ np.linalg.pinv(axes.T, rcond=LEAST_SPREAD), dtype=np.float64)


def _gyro_matrix(recording: Recording, timeline: Timeline, u: Unknowns, turned: Vectors) -> Matrix:
    assert recording.specific_force is not None
    assert recording.angular_rate is not None
    factor = angular_rate_factor(recording.angular_rate_unit)
    triad = triad_from_unknowns(u.values[:COUNT])
    stretches = [
        (timeline.holds[t.before].stop - 1, timeline.holds[t.after].start + 1)
        for t in timeline.turns
        if t.usable
    ]
    try:
        forward, covariance = rough_gyro_matrix(
            recording.time, recording.angular_rate, recording.specific_force, triad, u["gyro.bias"], stretches
        )
    except ValueError as error:
        if factor is not None:
            return np.eye(3) / factor
        if not len(turned):
            raise ObservabilityError(
                "The gyros count in unknown units, and the turns do not determine their scale: "
                f"{error}. Turn the unit about each of its axes while that axis lies level, or say "
                "the unit with --units."
            ) from error
        return float(np.median(np.linalg.norm(turned, axis=1))) * np.eye(3)
    if np.max(np.diag(covariance)) < ROUGH_ENOUGH**2 * np.mean(np.sum(forward**2, axis=0)):
        refuse_contradicting_axes(recording, forward)
    elif factor is not None:
        return np.eye(3) / factor
    return inverted(forward)


class Offered(NamedTuple):
    """A recording with both triads, and which of them it has: the other is stood in for."""

    recording: Recording
    timeline: Timeline
    means: HoldMeans
    has_force: bool
    has_gyro: bool


def with_stand_ins(
    recording: Recording, timeline: Timeline, means: HoldMeans, poses: BelievedPoses | None, site: Site
) -> Offered:
    """Return a recording with something in place of a triad that it lacks.

    Without a gyro the rates are zeros that nobody asks. Without accelerometers believed poses show what these would,
    and the sensors' axes are the fixture's.

    Parameters
    ----------
    recording, timeline, means, site : what was recorded, and where.
    poses : of the holds, that are believed.

    Raises
    ------
    ObservabilityError
        If there is no accelerometer, and no pose is believed.
    """
    has_force, has_gyro = means.specific_force is not None, means.angular_rate is not None
    floor, holds = timeline.noise_floor, means.count.size
    if not has_gyro:
        recording = replace(recording, angular_rate=np.zeros((len(recording), 3)))
        floor = replace(floor, angular_rate=np.full(3, NO_RATE))
        nothing = np.broadcast_to(1e-12 * np.eye(3), (holds, 3, 3)).copy()
        means = replace(means, angular_rate=np.zeros((holds, 3)), angular_rate_covariance=nothing)
    if not has_force:
        if poses is None or not holds:
            raise ObservabilityError(
                "The recording has no accelerometer, and nothing shows its poses. Record the accelerometers too, or "
                "say in a protocol how the unit was placed (`up`, `uncertainty_deg`)."
            )
        known = np.isin(np.arange(holds), list(poses.placed))
        first = np.array([poses.placed.get(k, int(poses.hold[0])) for k in range(holds)])
        at = np.searchsorted(poses.hold, first)
        # Holds that share a placement share its error; of a hold in no known placement nothing is known.
        shared = poses.sigma[at] * np.sqrt(np.bincount(at, known)[at])
        sigma = site.gravity * np.where(known, shared, UNPLACED)
        force = site.gravity * poses.up_f[at]
        starts = np.array([hold.start for hold in timeline.holds])
        samples = np.searchsorted(starts, np.arange(len(recording)), side="right") - 1
        recording = replace(recording, specific_force=force[np.maximum(samples, 0)])
        floor = replace(
            floor, specific_force=np.full(3, float(np.max((sigma * np.sqrt(means.count))[known])))
        )
        spread = sigma[:, None, None] ** 2 * np.eye(3)
        means = replace(means, specific_force=force, specific_force_covariance=spread)
    return Offered(recording, replace(timeline, noise_floor=floor), means, has_force, has_gyro)
