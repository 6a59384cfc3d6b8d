"""The joint estimator: one maximum-likelihood adjustment for every procedure.

A procedure is what is known about the motion: that the unit rests in the holds, that gyros carry attitudes over
the turns, that a table turns about a fixed axis by an angle that it shows. All of it enters one adjustment with
the noise that each observation really has, so that gyros and accelerometers inform each other: a table's slow
rotation shows gravity to the accelerometers at every angle, which ties their misalignments to the gyros'.

Unknown are both triads, the attitude at the head and the tail of every hold, the Earth rate in each section's
level frame (known as far as the latitude is), and for each rotation the attitude of every window, the lever
arm, and how both biases wander. Optional terms are kept if the data want them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from tumble.arrays import Series, inverted
from tumble.calibration.equations.triad_unknowns import BIAS, QUADRATIC, SCALE, unknowns_from_triad
from tumble.calibration.equations.turn import HoldsAndTurns
from tumble.calibration.estimate import Estimate, TermTest
from tumble.calibration.joint.believed import BelievedPoses
from tumble.calibration.joint.data import JointSpin, joint_data, window_spin
from tumble.calibration.joint.estimate import JointOutcome, joint_estimate, rest_residuals
from tumble.calibration.joint.noise import BalancedJoint, balance_joint
from tumble.calibration.joint.observability import (
    Untold,
    angle_prior,
    find_untold,
    name_plate_prior,
    together,
)
from tumble.calibration.joint.poses import mounting_prior
from tumble.calibration.joint.start import gather_what_there_is, rough_start, rough_variances
from tumble.calibration.joint.system import (
    JointProblem,
    JointState,
    Masks,
    linearise_joint,
    start_state,
)
from tumble.calibration.joint.table_terms import (
    TABLE_TERMS,
    lever_prior_of,
    seen_table_terms,
)
from tumble.calibration.joint.terms import Extra
from tumble.calibration.joint.trials import (
    copied_state,
    fresh_problem,
    narrowed_problem,
    widened_problem,
)
from tumble.calibration.joint.unknowns import G_SENSITIVITY, GYRO_BIAS, GYRO_MATRIX, SHARED, force_matrix
from tumble.calibration.joint.wanted import ALL_TERMS, OF_GYROS, OPTIONAL_TERMS, term_limits, wanted_terms
from tumble.calibration.joint.wide import FIXTURE, widened
from tumble.calibration.prior import StableKnowledge
from tumble.calibration.procedures.hand_held import add_bias_step, add_time_lag
from tumble.calibration.snooping import Outlier
from tumble.earth import Site
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.recording.recording import Recording
from tumble.segmentation import HoldMeans, Timeline
from tumble.segmentation.rotations import LONGEST_GAP, Rotation
from tumble.sensor import ImuModel
from tumble.sensor.gauge import change_frame

# Both triads without optional terms.
PLAIN = np.concatenate([np.arange(0, 9), np.arange(GYRO_MATRIX.start, GYRO_BIAS.stop)])
# An axis that leans by less than this is upright; a window may then turn so far.
UPRIGHT, UPRIGHT_ANGLE = 0.1, 3.0  # rad
# Accelerometers without a gyro.
FORCE_ALONE = np.arange(0, 9)


def calibrate_joint(
    recording: Recording,
    timeline: Timeline,
    means: HoldMeans,
    site: Site,
    start: Estimate | None = None,
    *,
    rotations: Sequence[Rotation] = (),
    poses: BelievedPoses | None = None,
    frame: str = "accelerometer-x",
    prior: StableKnowledge | None = None,
    optional_terms: bool = True,
    unused_holds: Sequence[int] = (),
    progress: Callable[[str], None] | None = None,
    keep: Callable[[JointOutcome], None] | None = None,
) -> Estimate:
    """Calibrate both triads from everything that was recorded.

    Parameters
    ----------
    recording, timeline, means : raw samples, what was found in them, and the holds' means.
    site : gravity; with a latitude, the Earth rate too.
    start : what another procedure made of the same recording: start values, and the company in the report; None
        starts from rough values.
    rotations : of a table, from rest to rest, with the angles that were read.
    poses : of holds, that are believed.
    frame : of the result: "accelerometer-x", or "fixture" where poses tell it.
    prior : what an earlier calibration knows of the accelerometers' angles.
    optional_terms : try g-sensitivity, quadratic terms and asymmetries, on a table a lag between the triads and the
        accelerometers' lever arms too, and keep what the data want.
    unused_holds : holds whose force and rate are kept out of the estimate, for cross-validation.
    progress : is told in words what is being done.
    keep : is handed the settled solution with everything behind it, for adjustments that go on from there.

    Raises
    ------
    ObservabilityError
        If what was recorded does not determine both triads.
    ConvergenceError
        If the adjustment does not settle.
    """
    say = progress or _silent
    say("joint adjustment")
    values = _start_values(recording, timeline, means, site, start)
    base, has_gyro = gather_what_there_is(recording, timeline, means)
    if poses is not None:
        values = widened(values)
    elif frame != "accelerometer-x":
        raise ObservabilityError(
            f"No pose is believed, so that nothing tells the frame {frame!r}: give a protocol whose holds have poses "
            "with a small sigma, or leave the frame as it is."
        )
    broken: list[str] = []
    data = joint_data(base, values, _spins(base, values, rotations, broken))
    data.poses = poses
    masks = Masks.everything(data.holds)
    masks.rate[:] = has_gyro
    masks.force[list(unused_holds)] = False
    masks.rate[list(unused_holds)] = False
    plain = PLAIN if has_gyro else FORCE_ALONE
    if poses is not None:
        plain = np.concatenate([plain, np.arange(FIXTURE.start, FIXTURE.stop)])
    problem = JointProblem(
        data, site, plain, Extra(), masks, together(angle_prior(values, prior), mounting_prior(values))
    )
    known = {name: OPTIONAL_TERMS[name] for name in ("g_sensitivity", "quadratic")}
    known = {name: unknowns for name, unknowns in known.items() if np.any(values[unknowns])}
    if not optional_terms:
        values[QUADRATIC] = values[G_SENSITIVITY] = 0.0
        known = {}
    problem.free = plain
    state = start_state(data, values, site)
    untold = find_untold(linearise_joint(problem, state)[1], plain, state.unknowns)
    if untold is not None:
        _refuse_nothing_told(untold)
        problem.prior = together(problem.prior, name_plate_prior(values, plain))
        problem.extra = rough_variances(base, values, has_gyro=has_gyro)
        optional_terms, known = False, {}
    problem.free = np.sort(np.concatenate([plain, *known.values()]))
    of_table: list[str] = []
    if optional_terms and has_gyro and data.spins:
        problem, state, of_table = _with_table(problem, state)
    balanced = _balanced_with(problem, state, of_table)
    tests: list[TermTest] = []
    if optional_terms:
        say("optional terms")
        problem, state, balanced, tests = _with_terms(problem, state, balanced, plain, of_table)
    outcome = JointOutcome(
        recording, problem.data, site, problem, state, balanced, tests, start, untold, frame, has_gyro, prior
    )
    if keep is not None:
        keep(outcome)
    estimate = joint_estimate(outcome)
    if optional_terms and has_gyro and not data.spins:
        add_time_lag(estimate, base)
    estimate.say("remark", *broken)
    if has_gyro:
        add_bias_step(estimate, base, recording, *rest_residuals(outcome))
    return estimate


def unknowns_of(model: ImuModel) -> Series:
    """Return the 33 shared unknowns of a model with both triads, in whatever frame it is.

    Raises
    ------
    ValueError
        If a triad is missing.
    """
    if model.accelerometer is None or model.gyroscope is None:
        raise ValueError("the joint estimator's unknowns are those of both triads")
    own = change_frame(model, "accelerometer-x")
    assert own.accelerometer is not None
    assert own.gyroscope is not None
    values = np.zeros(SHARED)
    values[: QUADRATIC.stop] = unknowns_from_triad(own.accelerometer)
    values[GYRO_MATRIX] = own.gyroscope.matrix.ravel()
    values[GYRO_BIAS] = own.gyroscope.bias
    if own.g_sensitivity is not None:
        values[G_SENSITIVITY] = own.g_sensitivity.ravel()
    return values


def _spins(
    base: HoldsAndTurns, values: Series, rotations: Sequence[Rotation], broken: list[str]
) -> list[JointSpin]:
    inverse = inverted(values[GYRO_MATRIX].reshape(3, 3))
    made: list[JointSpin] = []
    for rotation in rotations:
        before, after = _beside(base, rotation)
        if before is None or after != before + 1:
            continue
        if _has_gap(base, before):
            # Nothing is known of the attitude after it: a new section begins.
            base.turn_start[before] = base.turn_stop[before] = -1
            broken.append(
                f"In rotation {rotation.row + 1} (step {rotation.step + 1} of the protocol) samples are missing: "
                "it was not used, and what follows has a heading of its own."
            )
            continue
        at_rate = not rotation.is_from_rest
        # The search does not take a table's slow rotation for a turn where it cannot be told from a hold.
        if base.turn_start[before] < 0:
            base.turn_start[before] = base.tail[before, 1] - 1
            base.turn_stop[before] = base.head[after, 0] + 1
        rate = inverse @ (rotation.integral / rotation.seconds - values[GYRO_BIAS])
        made.append(
            window_spin(
                base,
                before,
                rotation.start,
                rotation.stop,
                rate,
                angle=None if at_rate else rotation.angle,
                angle_sigma=0.0 if at_rate else rotation.angle_sigma,
                turn_rate=rotation.angle / rotation.seconds if at_rate else None,
                rate_sigma=rotation.angle_sigma / rotation.seconds if at_rate else 0.0,
                **_window_sizes(values, base, before, rate),
                row=rotation.row,
                name=f"rotation {rotation.row + 1}",
            )
        )
    return made


def _beside(base: HoldsAndTurns, rotation: Rotation) -> tuple[int | None, int | None]:
    """The holds beside a rotation; of one at a constant rate those that are nearest."""
    if rotation.before is not None:
        return rotation.before, rotation.after
    before = np.flatnonzero(base.tail[:, 1] <= rotation.start)
    after = np.flatnonzero(base.head[:, 0] >= rotation.stop)
    if not before.size or not after.size:
        return None, None
    return int(before[-1]), int(after[0])


def _has_gap(base: HoldsAndTurns, before: int) -> bool:
    """Whether samples are missing between a hold and the next one."""
    steps = np.diff(base.time[base.tail[before, 1] - 1 : base.head[before + 1, 0] + 1])
    return bool(np.any(steps > max(LONGEST_GAP, 1.5 * float(np.median(np.diff(base.time))))))


def _window_sizes(values: Series, base: HoldsAndTurns, before: int, rate: Series) -> dict[str, float]:
    """How far a window may turn: gravity that stands on the axis does not go round, and wants few windows."""
    up = inverted(force_matrix(values)) @ (base.force_mean[before] - values[BIAS])
    leaning = float(
        np.linalg.norm(np.cross(up, rate)) / max(np.linalg.norm(up) * np.linalg.norm(rate), 1e-30)
    )
    return {"largest_angle": UPRIGHT_ANGLE} if leaning < UPRIGHT else {}


def _start_values(
    recording: Recording, timeline: Timeline, means: HoldMeans, site: Site, start: Estimate | None
) -> Series:
    """From another procedure's estimate as far as it goes, the rest roughly."""
    model = None if start is None or start.frame != "accelerometer-x" else start.model
    if model is not None and model.accelerometer is not None and model.gyroscope is not None:
        return unknowns_of(model)
    values = rough_start(recording, timeline, means, site)
    if start is not None and start.model.gyroscope is not None and _tells_gyros(start):
        values[GYRO_MATRIX] = start.model.gyroscope.matrix.ravel()
        values[GYRO_BIAS] = start.model.gyroscope.bias
    return values


def _tells_gyros(start: Estimate) -> bool:
    return sum(name.startswith("gyroscope.matrix") for name in start.names) == 9


def _refuse_nothing_told(untold: Untold) -> None:
    """Refuse a recording that does not even tell biases and scale factors of the accelerometers."""
    if np.count_nonzero(untold.unknowns < SCALE.stop) == SCALE.stop:
        raise ObservabilityError(f"The holds tell nothing of the accelerometers. {untold.sentences[0]}")


def _with_table(problem: JointProblem, state: JointState) -> tuple[JointProblem, JointState, list[str]]:
    """Return both wide, and the terms that only a table's rotations show, as far as these do."""
    wide, moved = widened_problem(problem, state)
    wide.free = np.unique(np.concatenate([problem.free, *ALL_TERMS.values()]))
    names = seen_table_terms(linearise_joint(wide, moved)[1], wide.free, moved.unknowns)
    wide.free = problem.free
    return (wide, moved, names) if names else (problem, state, [])


def _balanced_with(problem: JointProblem, state: JointState, names: list[str]) -> BalancedJoint:
    """Balance with a table's terms: what is left of a lag by itself would be taken for a table that shakes."""
    prior, free = problem.prior, problem.free
    problem.free = np.sort(np.concatenate([free, *(TABLE_TERMS[name] for name in names)]))
    problem.prior = together(prior, lever_prior_of(problem.free, state.unknowns))
    balanced = balance_joint(problem, state)
    problem.free, problem.prior = free, prior
    return balanced


def _with_terms(
    problem: JointProblem, state: JointState, base: BalancedJoint, plain: np.ndarray, of_table: list[str]
) -> tuple[JointProblem, JointState, BalancedJoint, list[TermTest]]:
    """Try all optional terms at once, drop the least significant until every one left is wanted."""
    narrow = None if problem.data.poses is not None else SHARED
    before = (problem, state, base)
    problem, state = widened_problem(problem, state)
    has_gyro = bool(np.any(plain >= GYRO_MATRIX.start))
    names = [name for name in OPTIONAL_TERMS if has_gyro or name not in OF_GYROS]
    names += of_table
    limits = term_limits(names)
    tests: dict[str, TermTest] = {}
    while names:
        free = np.sort(np.concatenate([plain, *(ALL_TERMS[name] for name in names)]))
        trial = fresh_problem(problem, free)
        moved = copied_state(state, free)
        trial.prior = together(trial.prior, lever_prior_of(free, moved.unknowns))
        try:
            balanced = balance_joint(trial, moved)
        except (ObservabilityError, ConvergenceError):
            # Few holds and turns may tell the plain unknowns, and not so many more.
            names.pop()
            continue
        # What was left out before there were any terms stays out, and is told.
        balanced.outliers[:0] = base.outliers
        wanted = wanted_terms(trial, balanced, names, tests, limits)
        if wanted == names:
            if free[-1] < (narrow or 0):
                trial, moved, balanced = _settled_again(trial, moved, free, narrow, balanced.outliers)
            return trial, moved, balanced, list(tests.values())
        names = wanted
    if base.solution.free.size > plain.size:
        before = _settled_again(problem, state, plain, narrow, base.outliers)
    return *before, list(tests.values())


def _settled_again(
    problem: JointProblem, state: JointState, free: np.ndarray, size: int | None, gone: list[Outlier]
) -> tuple[JointProblem, JointState, BalancedJoint]:
    """Adjust once more with these unknowns only, in a vector of `size`, or as long as it is; `gone` is out already."""
    problem = fresh_problem(problem, free)
    state = copied_state(state, free)
    if size is not None:
        narrowed_problem(problem, state, size)
    balanced = balance_joint(problem, state)
    balanced.outliers[:0] = gone
    return problem, state, balanced


def _silent(_: str) -> None:
    """Tell nobody."""


__all__ = ["calibrate_joint", "unknowns_of"]
