"""Calibration on a turntable that needs no alignment (Zhang et al. 2010).

The accelerometers are calibrated on the norm of gravity in attitudes that nobody needs to know, the gyros
on the angles that the table's display tells, whatever the axis. Both saw the same axes: that tells the
rotation between them, if the axes are not vertical.

Where the paper leaves a choice or gives something away:

- The accelerometers' closed form (12) to (14) is the start and the check; the Gauss-Helmert adjustment
  of the same norms weighs holds by their noise and finds gross errors.
- Inter-triad angles: all axes, each weighed by what it really tells. Two axes, z and then y as in the
  paper, let the accelerometers' misalignments in: five times worse.
- Biases of the gyros: from the Earth rate's part along the vertical, which the accelerometers show, where a
  latitude is given; from the norms of static pairs (24), (25) otherwise.
- Ramps, and a table that stops early, leave bias and Earth rate in the difference of two rotations: they
  are taken out (`rotation_pairs`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Square, Vector, inverted
from tumble.calibration.checks.hold_wander import wander_of_rate
from tumble.calibration.checks.snooping import wald_test
from tumble.calibration.checks.triad_agreement import refuse_contradicting_axes
from tumble.calibration.closed_forms.accelerometers import fit_accelerometers
from tumble.calibration.closed_forms.inter_triad import wahba_rotation
from tumble.calibration.closed_forms.rest_rates import SENSITIVITY as REST_SENSITIVITY
from tumble.calibration.closed_forms.rotation_pairs import EarthParts, pair_rotations, refuse_unlike_angles
from tumble.calibration.closed_forms.rotation_planes import normal_in_raw, observe_plane
from tumble.calibration.equations.placement import is_excessive
from tumble.calibration.equations.spin_groups import REVERSED
from tumble.calibration.equations.triad_unknowns import triad_from_unknowns
from tumble.calibration.estimate import (
    Estimate,
    TermTest,
)
from tumble.calibration.prior import StableKnowledge
from tumble.calibration.procedure import Procedure
from tumble.calibration.procedures.multi_position import TriadFit
from tumble.calibration.session import Session
from tumble.calibration.turntable.estimate import turntable_estimate
from tumble.calibration.turntable.solution import (
    BIAS,
    MATRIX,
    SENSITIVITY,
    TurntableInputs,
    TurntableSystem,
)
from tumble.calibration.turntable.task import (
    TurntableOutcome,
    TurntableTask,
    TurntableTests,
    are_apart,
    shows_earth,
)
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ObservabilityError
from tumble.protocol import Protocol
from tumble.recording.recording import Recording
from tumble.segmentation import HoldMeans, Timeline
from tumble.segmentation.matching import Matching
from tumble.segmentation.rotations import Rotation
from tumble.units import angular_rate_factor

# Axes of both triads that differ by more after the best rotation belong to no rotation.
LARGEST_MISFIT = 0.2
PASSES = 4
# Chance of keeping a g-sensitivity that is not there, and the rests that twelve unknowns ask for.
G_SENSITIVITY_FALSE_ALARM, FEWEST_RESTS = 0.01, 9


def calibrate_turntable(
    recording: Recording,
    timeline: Timeline,
    means: HoldMeans,
    rotations: list[Rotation],
    matching: Matching,
    protocol: Protocol,
    site: Site,
    *,
    prior: StableKnowledge | None = None,
) -> Estimate:
    """Calibrate both triads and the rotation between them from holds and from a table's rotations.

    Parameters
    ----------
    recording : samples; those of the rotations show the axes to the accelerometers.
    timeline : its noise at rest.
    means : of all holds: each serves the accelerometers.
    rotations : in the order of `matching.spins`.
    matching, protocol : which rotation is about which axis.
    site : gravity; with a latitude the vertical Earth rate determines the gyros' biases.
    prior : non-orthogonalities of the accelerometers from an earlier calibration.

    Returns
    -------
    estimate : in the frame ``accelerometer-x``, with the gyro's whole matrix, the fits of the axes and the
        uncertainty budget.

    Raises
    ------
    ObservabilityError
        If poses or axes are too few or too alike, or a way round is missing.
    ConvergenceError
        If the accelerometers' adjustment fails.
    RecordingError
        If the axes that both triads saw show columns that are swapped or reversed.
    """
    if means.angular_rate is None or means.angular_rate_covariance is None:
        raise ObservabilityError(
            "The recording has no gyro: a turntable's rotations have nothing to calibrate."
        )
    force = fit_accelerometers(recording, means, site, prior)
    means, rotations = _with_wander(recording, means, rotations, force, site)
    pairs, lonely = pair_rotations(rotations, matching, protocol)
    refuse_unlike_angles(recording, pairs, means)
    triad = triad_from_unknowns(force.unknowns)
    noise = timeline.noise_floor.specific_force
    planes = [observe_plane(recording, pair, triad, site.gravity, noise) for pair in pairs]
    bad = {outlier.group for outlier in force.outliers}
    rests = np.array([k for k in range(len(means)) if k not in bad])
    task = TurntableTask(recording, means, site, force, pairs, planes, rests, lonely)
    solution = _solve(task)
    refuse_contradicting_axes(recording, inverted(solution.unknowns[MATRIX].reshape(3, 3)))
    return turntable_estimate(task, solution)


def _with_wander(
    recording: Recording, means: HoldMeans, rotations: list[Rotation], force: TriadFit, site: Site
) -> tuple[HoldMeans, list[Rotation]]:
    """Count in rests and rotations how the gyros' biases wander; the horizontal Earth rate is not known."""
    assert means.specific_force is not None
    assert means.angular_rate_covariance is not None
    up_b = triad_from_unknowns(force.unknowns).correct(means.specific_force)
    up_b = up_b / np.linalg.norm(up_b, axis=1, keepdims=True)
    every = np.arange(len(means))
    unseen = 0.5 * (EARTH_RATE / (angular_rate_factor(recording.angular_rate_unit) or 1.0)) ** 2
    if site.latitude is not None:
        unseen *= float(np.cos(site.latitude)) ** 2
    wander = wander_of_rate(means, every, up_b, np.full(3, unseen))
    means = replace(means, angular_rate_covariance=wander.of_each(means.angular_rate_covariance, every))
    return means, [
        replace(r, covariance=r.covariance + wander.of_integral(r.middle, r.seconds)) for r in rotations
    ]


def _solve(task: TurntableTask) -> TurntableOutcome:
    """Solve, with the bias and the Earth rate taken out better every time; then weigh by what the tests say."""
    matrix: Matrix | None = None
    bias: Vector | None = None
    parts: dict[int, Vector] = {}
    system: TurntableSystem | None = None
    values = np.zeros(0)
    for _ in range(PASSES):
        parts = EarthParts(task.pairs, task.means, matrix, bias, parts or None).parts()
        system = TurntableSystem.of(_inputs(task, parts, matrix))
        if matrix is None:
            _refuse_reversed(task, system)
        values = system.solve(system.inputs.unchanged)
        matrix, bias = values[MATRIX].reshape(3, 3), values[BIAS]
    assert system is not None
    term = _test_sensitivity(task, system, values)
    kept = term is not None and term.kept
    for _ in range(2 if kept else 0):
        parts = _parts(task, values, parts)
        system = TurntableSystem.of(_inputs(task, parts, values[MATRIX].reshape(3, 3)), with_sensitivity=True)
        values = system.solve(system.inputs.unchanged)
    tests = _tests(task, system, values)
    inputs, scaled = _scaled(system.inputs, tests)
    if scaled:
        system = TurntableSystem.of(inputs, with_sensitivity=system.with_sensitivity)
        values = system.solve(inputs.unchanged)
    unseen = np.zeros((3, 3)) if kept else _unseen_sensitivity(task, system, values)
    return TurntableOutcome(system, values, _parts(task, values, parts), tests, scaled, term, unseen)


def _unseen_sensitivity(task: TurntableTask, system: TurntableSystem, values: Series) -> Square:
    """Return (3, 3) raw²: what a g-sensitivity that the rests cannot exclude does to biases that are solved without it.

    The rests' mean specific force is not zero, and the biases are off by so much times the g-sensitivity: by the one
    that the rests show, proven or not, and by how uncertain it is.
    """
    if system.by_pairs or len(system.inputs.rest) < FEWEST_RESTS:
        return np.zeros((3, 3))
    inputs, matrix = system.inputs, values[MATRIX].reshape(3, 3)
    told = system.rests(matrix, values[:9], inputs.rest, with_sensitivity=True)
    plain = system.rests(matrix, values[:9], inputs.rest, with_sensitivity=False)
    moved = plain.bias - told.bias
    return np.outer(moved, moved) + np.maximum(
        np.diag(np.diag(told.covariance[:3, :3] - plain.covariance[:3, :3])), 0.0
    )


def _parts(task: TurntableTask, values: Series, parts: dict[int, Vector]) -> dict[int, Vector]:
    """What bias and Earth rate add to each rotation, with the solution as it is."""
    assert task.means.specific_force is not None
    force_b = triad_from_unknowns(task.force.unknowns).correct(task.means.specific_force)
    felt = force_b @ values[SENSITIVITY].reshape(3, 3).T
    return EarthParts(task.pairs, task.means, values[MATRIX].reshape(3, 3), values[BIAS], parts, felt).parts()


def _test_sensitivity(task: TurntableTask, system: TurntableSystem, values: Series) -> TermTest | None:
    """Test whether the gyros at rest show a g-sensitivity; without a latitude and with the Earth seen they cannot."""
    if system.by_pairs or len(system.inputs.rest) < FEWEST_RESTS:
        return None
    matrix, inputs = values[MATRIX].reshape(3, 3), system.inputs
    told = system.rests(matrix, values[:9], inputs.rest, with_sensitivity=True)
    noise = max(1.0, told.square_sum / told.degrees)
    # Headings that go with the poses make of the horizontal Earth rate what looks like a g-sensitivity.
    unseen = (inputs.horizontal_rate or EARTH_RATE) / task.site.gravity
    habit = unseen**2 * np.asarray(np.kron(matrix @ matrix.T, np.eye(3)), dtype=np.float64)
    spread = noise * told.covariance[REST_SENSITIVITY, REST_SENSITIVITY] + habit
    return wald_test(
        "g_sensitivity", told.sensitivity.ravel(), spread, told.degrees, G_SENSITIVITY_FALSE_ALARM
    )


def _inputs(task: TurntableTask, parts: dict[int, Vector], matrix: Matrix | None) -> TurntableInputs:
    means, pairs = task.means, task.pairs
    assert means.angular_rate is not None
    assert means.angular_rate_covariance is not None
    assert means.specific_force is not None
    told = [k for k, plane in enumerate(task.planes) if not plane.why]
    if len(told) < 2 or not are_apart([task.planes[k].normal for k in told]):
        told = []
    force_matrix = triad_from_unknowns(task.force.unknowns).matrix
    normals = [normal_in_raw(task.planes[k].normal, force_matrix) for k in told]
    tangents = [[normal_in_raw(tangent, force_matrix) for tangent in task.planes[k].tangents] for k in told]
    covariance = means.angular_rate_covariance[task.rests]
    vertical: float | None = None
    horizontal = 0.0
    if task.site.latitude is not None:
        vertical = EARTH_RATE * float(np.sin(task.site.latitude))
        horizontal = EARTH_RATE * float(np.cos(task.site.latitude))
    elif matrix is None or not shows_earth(matrix, means.angular_rate[task.rests], covariance):
        # Neither latitude nor gyros that see it: the Earth rate is noise.
        vertical = 0.0
        rough = np.eye(3) if matrix is None else matrix
        covariance = covariance + EARTH_RATE**2 / 3.0 * (rough @ rough.T)
    return TurntableInputs(
        force=task.force.unknowns[:9].copy(),
        force_covariance=task.force.covariance[:9, :9],
        rotation=np.array([pair.difference(parts) for pair in pairs]),
        rotation_covariance=np.array([pair.covariance for pair in pairs]),
        angle=np.array([pair.angle for pair in pairs]),
        angle_sigma=np.array([pair.angle_sigma for pair in pairs]),
        plane=np.array(told, dtype=int),
        normal=np.array(normals).reshape(-1, 3),
        tangent=np.array(tangents).reshape(-1, 2, 3),
        normal_covariance=np.array([task.planes[k].covariance for k in told]).reshape(-1, 2, 2),
        rest=means.angular_rate[task.rests],
        rest_covariance=covariance,
        rest_force=means.specific_force[task.rests],
        vertical_rate=vertical,
        horizontal_rate=horizontal,
    )


def _refuse_reversed(task: TurntableTask, system: TurntableSystem) -> None:
    """Refuse axes of the two triads that no rotation joins."""
    if not len(system.inputs.plane):
        return
    axes_o, axes_p = system.axes(system.inputs.unchanged)
    if _misfit(axes_o, axes_p) < LARGEST_MISFIT:
        return
    if _misfit(-axes_o, axes_p) < LARGEST_MISFIT:
        raise ObservabilityError(REVERSED)
    raise ObservabilityError(
        "The axes that the gyros and the accelerometers saw in the table's rotations belong to no "
        "rotation between them. Either a gyro axis is reversed or two are swapped (--columns), or "
        "the protocol has the axis or the way round of a turn wrong. " + _worst_axis(task, axes_o, axes_p)
    )


def _misfit(axes_o: AnyArray, axes_p: AnyArray) -> float:
    rotation = wahba_rotation(axes_o, axes_p)
    return float(np.max(np.linalg.norm(axes_o - axes_p @ rotation.T, axis=1)))


def _worst_axis(task: TurntableTask, axes_o: AnyArray, axes_p: AnyArray) -> str:
    away = np.linalg.norm(axes_o - axes_p @ wahba_rotation(axes_o, axes_p).T, axis=1)
    told = [pair for pair, plane in zip(task.pairs, task.planes, strict=True) if not plane.why]
    return f"The worst is the axis {told[int(np.argmax(away))].name}."


def _tests(task: TurntableTask, system: TurntableSystem, values: Series) -> TurntableTests:
    inputs = system.inputs
    matrix = values[MATRIX].reshape(3, 3)
    inverse = inverted(matrix)
    turned = inputs.rotation @ inverse.T
    length = np.linalg.norm(turned, axis=1)
    along = (turned / length[:, None]) @ inverse
    variance = np.einsum("ki,kij,kj->k", along, inputs.rotation_covariance, along) + inputs.angle_sigma**2
    angles = float(np.sum((length - inputs.angle) ** 2 / variance)), len(length) - 6
    axes = (0.0, 0)
    if system.gain is not None:
        axes = system.axes_test(inputs.unchanged)
    rests = (0.0, 0)
    if not system.by_pairs:
        told = system.rests(matrix, values[:9], inputs.rest, with_sensitivity=system.with_sensitivity)
        rests = told.square_sum, told.degrees
    return TurntableTests(angles, axes, rests)


def _scaled(inputs: TurntableInputs, tests: TurntableTests) -> tuple[TurntableInputs, dict[str, float]]:
    """Raise the covariances of what contradicts itself by more than its noise explains."""
    scaled: dict[str, float] = {}
    if is_excessive(*tests.angles):
        factor = tests.angles[0] / tests.angles[1]
        scaled["the table's angles against one another"] = float(np.sqrt(factor))
        inputs = replace(
            inputs,
            rotation_covariance=factor * inputs.rotation_covariance,
            angle_sigma=np.sqrt(factor) * inputs.angle_sigma,
        )
    if is_excessive(*tests.axes):
        factor = tests.axes[0] / tests.axes[1]
        scaled["the axes that both triads saw"] = float(np.sqrt(factor))
        inputs = replace(inputs, normal_covariance=factor * inputs.normal_covariance)
    if is_excessive(*tests.rests):
        factor = tests.rests[0] / tests.rests[1]
        scaled["the gyros at rest"] = float(np.sqrt(factor))
        inputs = replace(inputs, rest_covariance=factor * inputs.rest_covariance)
    return inputs, scaled


def _run(session: Session) -> Estimate:
    protocol, matching = session.matched
    return calibrate_turntable(
        session.recording,
        session.timeline,
        session.means,
        session.rotations,
        matching,
        protocol,
        session.site,
        prior=session.prior,
    )


PROCEDURE = Procedure(
    "turntable",
    _run,
    "accelerometer-x",
    "a table whose angle is read, tilted",
    "nine or more poses at rest, six axes turned about both ways; nothing aligned",
    "both triads in full, the rotation between them; gyros as exactly as the angles",
    "turntable.md",
    takes=frozenset({"prior"}),
    gyros_from="table",
    example="turntable-9",
    remedy="hold longer and in more poses, above all edges; turn further, both ways about each axis",
    counts_between_holds=True,
    joint_believes=False,
    free_turns=False,
)
