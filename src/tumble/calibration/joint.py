"""The joint estimator: one maximum-likelihood adjustment for every procedure.

A procedure is what is known about the motion: that the unit rests in the holds, that gyros carry attitudes over
the turns, that a table turns about a fixed axis by an angle that it shows. All of it enters one adjustment with
the noise that each observation really has, so that gyros and accelerometers inform each other: a table's slow
rotation shows gravity to the accelerometers at every angle, which ties their misalignments to the gyros'.

Unknown are both triads, the attitude at the head and the tail of every hold, the Earth rate in each section's
level frame (known as far as the latitude is), and for each rotation the attitude of every window, the lever
arm, and how both biases wander. Optional terms are kept if the data want them.

The accelerometers alone are estimated so, too, and tell whether the poses contradict a prior.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace

import numpy as np

from tumble.arrays import Series, inverted
from tumble.calibration.checks.triad_agreement import add_time_lag
from tumble.calibration.checks.unseen import add_common_scale, rest_rate
from tumble.calibration.equations.adjustment import JointAdjustment, balance_recording, solve_recording
from tumble.calibration.equations.gathering import gather
from tumble.calibration.equations.holds_and_turns import HoldsAndTurns
from tumble.calibration.equations.imu_unknowns import (
    FORCE_ALONE,
    LAYOUT,
    PLAIN,
    force_matrix,
    gyro_matrix,
    name_plate,
    terms_prior,
)
from tumble.calibration.equations.observed import TableRotation, observe, table_rotation, with_rounding
from tumble.calibration.equations.pose_equations import mounting_prior
from tumble.calibration.estimate import Estimate, TermTest
from tumble.calibration.objections import say_missing, say_of_prior, say_of_sheets
from tumble.calibration.optional_terms import USUAL_STEPS, TermSearch, seen_table_terms, unknowns_with
from tumble.calibration.outcome.estimate import joint_estimate
from tumble.calibration.outcome.settled import JointOutcome
from tumble.calibration.prior import (
    StableKnowledge,
    TriadSheet,
    Untold,
    angle_prior,
    find_untold,
    name_plate_prior,
    sheets_prior,
    stable_knowledge,
    together,
    triad_sheets,
)
from tumble.calibration.session import Options, Procedure, Session, find_procedure
from tumble.calibration.start import Offered, rough_start, rough_variances, start_adjustment, with_stand_ins
from tumble.calibration.terms import TERMS
from tumble.counting import about
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.estimation import Balanced, Unknowns, linearise
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.segmentation import LONGEST_GAP, HoldMeans, Rotation
from tumble.units import specific_force_factor

# An axis that leans by less than this is upright; a window may then turn so far.
UPRIGHT, UPRIGHT_ANGLE = 0.1, 3.0  # rad
# Rough gyros are off by less than such a share of an angle against one another.
UNLIKE = 0.15
# Of a window of what stands in for accelerometers: far above gravity's square.
NOTHING_SHOWN = 1e6  # (m/s²)²
# A recording tells its clock if it leaves less than this share of what is believed of it open.
CLOCK_TOLD = 0.3


def calibrate(session: Session, procedure: Procedure, *, clocked: bool = True) -> Estimate:
    """Calibrate both triads from everything that was recorded and that the procedure believes.

    Parameters
    ----------
    session : the recording, what was done, and what is known beforehand; its `joint` is the settled solution with
        everything behind it, for adjustments that go on from there.
    procedure : what is believed, the frame of the result, and the optional terms that are sought.
    clocked : adjust what clock and table may be off by; else whoever goes on from the solution states it.

    Raises
    ------
    ObservabilityError
        If what was recorded determines nothing of the accelerometers, or not what the frame needs.
    ConvergenceError
        If the adjustment does not settle.
    """
    if procedure.by_temperature:
        # Who calibrates at one temperature needs none of it.
        from tumble.calibration.thermal.procedure import calibrate_thermal

        what = session.recording, session.timeline, session.site
        return calibrate_thermal(*what, protocol=session.protocol, progress=session.say)
    session.say("joint adjustment")
    begun, options = begin(session, procedure, clocked=clocked), session.options
    task, plain, has_gyro = begun.task, begun.plain, begun.offered.has_gyro
    by_hand = has_gyro and begun.offered.has_force and not task.data.rotations
    known = _known_terms(task.unknowns, wanted=options.optional_terms)
    task.unknowns = task.unknowns.with_free(unknowns_with(plain, known))
    of_table = _seen_on_table(task) if options.optional_terms and task.data.rotations else []
    tests, untried = list[TermTest](), list[str]()
    with _explained(begun.unlike):
        with about(USUAL_STEPS):
            task, balanced, fresh = _settled_from(task, of_table, a_start=bool(known))
        if options.optional_terms:
            search = TermSearch(task, fresh, plain, procedure.seeks)
            task, balanced = search.settled(balanced, of_table, session.say)
            tests, untried = [*search.tests.values()], search.untried
    outcome = session.joint = JointOutcome(
        *(session.recording, task, balanced, tests, begun.untold, procedure.frame, has_gyro),
        *(session.prior, untried, session.alike["table_rate"] if clocked else None),
        has_force=begun.offered.has_force,
    )
    estimate = joint_estimate(outcome)
    if "clock" in begun.alike and "clock" not in begun.adjusted:
        add_common_scale(estimate, begun.alike["clock"], rest_rate(estimate, session.means))
    if options.optional_terms and by_hand:
        add_time_lag(estimate, task.data.base)
    estimate.say("remark", *begun.broken)
    say_of_sheets(estimate, outcome, begun.sheets, session.alike, alone=False)
    say_missing(estimate, outcome, procedure)
    return estimate


@dataclass
class Begun:
    """An adjustment that begins: what is free without any term, what is not told, and what may be wrong alike."""

    offered: Offered
    task: JointAdjustment
    plain: np.ndarray
    untold: Untold | None
    alike: dict[str, float]
    adjusted: dict[str, float]
    broken: list[str]
    unlike: str
    sheets: list[TriadSheet]


def begin(
    session: Session, procedure: Procedure, *, clocked: bool = True, start: Unknowns | None = None
) -> Begun:
    """Gather what was observed and what is believed, where a rough start puts everything.

    Parameters
    ----------
    session, procedure, clocked : as for `calibrate`.
    start : sensors to start from, however little is told of them; None finds them.

    Raises
    ------
    ObservabilityError
        If what was recorded determines nothing of the accelerometers, or not what the frame needs.
    """
    poses, site = session.poses_of(procedure), session.site
    if poses is None and procedure.frame == "fixture":
        raise ObservabilityError(
            "No pose is believed, so that nothing determines the frame 'fixture': give a protocol "
            "whose holds have poses with a small sigma, or leave the frame as it is."
        )
    offered = with_stand_ins(session.recording, session.timeline, session.means, poses, site)
    poses, has_gyro = (poses if offered.has_force else None), offered.has_gyro
    matched = has_gyro and session.matching is not None and session.matching.spins
    rotations = session.rotations if matched else []
    u, broken = start or rough_start(offered, site, rotations), list[str]()
    by_hand = None if rotations or offered.means.modelled else u
    base = gather(*offered[:3], by_hand)
    if not has_gyro:
        base.turn_start[:] = base.turn_stop[:] = -1
    turned = _rotations(base, u, rotations, broken)
    for one in [] if offered.has_force else turned:
        # What stands in for accelerometers shows nothing while a table turns.
        one.force_covariance = one.force_covariance + NOTHING_SHOWN * np.eye(3)
    data = observe(with_rounding(base, turned), u, turned)
    if by_hand is not None:
        # What rests show of it may be a hand's that sways: how biases wander the residuals say.
        data.base, data.rate_density = replace(data.base, rate_floor=np.zeros(3)), np.zeros(3)
    data.poses = poses
    plain = np.setdiff1d(PLAIN if has_gyro else FORCE_ALONE, [] if offered.has_force else FORCE_ALONE)
    if poses is not None:
        plain = np.concatenate([plain, LAYOUT.indices("fixture")])
    task = start_adjustment(data, u.with_free(plain), site)
    task.taking_part["rate"] &= has_gyro
    task.prior = together(angle_prior(u, session.prior), None if poses is None else mounting_prior(u))
    alike = {name: sigma for name, sigma in session.alike.items() if clocked and has_gyro and sigma > 0.0}
    adjusted, plain = _with_alike(task, alike, plain)
    sheets = triad_sheets(session.options.data_sheet, session.recording)
    task.prior = together(task.prior, sheets_prior(task.unknowns, sheets))
    untold = find_untold(linearise(task)[1], task.unknowns) if start is None else None
    unsaid = np.setdiff1d(plain, np.concatenate([plain[:0], *(one.place for one in sheets)]))
    task.prior = together(task.prior, name_plate_prior(u.with_free(unsaid), session.recording))
    if untold is not None:
        _refuse_nothing_told(untold, session.recording)
        task.noise = rough_variances(base, u, has_gyro=has_gyro)
    return Begun(offered, task, plain, untold, alike, adjusted, broken, _unlike_angle(rotations, u), sheets)


def calibrate_accelerometers(
    session: Session, means: HoldMeans | None = None, holds: Sequence[int] | None = None
) -> Estimate:
    """Calibrate the accelerometers alone, by gravity's norm in the holds, without what else is known or wanted.

    Parameters
    ----------
    session : the recording.
    means, holds : of those holds that count, and which these are; None for all.

    Raises
    ------
    ObservabilityError
        If the holds do not determine all of the accelerometers.
    ConvergenceError
        If the adjustment does not settle.
    """
    alone = Session(replace(session.recording, angular_rate=None), given_site=session.site)
    alone.options, alone.timeline = Options(optional_terms=False), session.timeline
    if holds is not None:
        found = session.timeline.holds
        alone.timeline = replace(session.timeline, holds=tuple(found[k] for k in holds), turns=())
    known = session.means if means is None else means
    alone.means = replace(known, angular_rate=None, angular_rate_covariance=None, parts=None)
    estimate = calibrate(alone, find_procedure("multi-position"))
    if alone.joint is None or alone.joint.untold is not None:
        raise ObservabilityError("The holds do not determine all of the accelerometers.")
    return estimate


def check_prior(estimate: Estimate, sessions: Sequence[Session], knowledge: StableKnowledge) -> None:
    """Object to a prior that the poses contradict, where they can tell the angles without it.

    Parameters
    ----------
    estimate : gets an objection, or a caution where nothing can be checked.
    sessions : recordings of one unit, that tell its angles together.
    knowledge : the prior.
    """
    seen = list[StableKnowledge]()
    for session in sessions:
        with suppress(ObservabilityError, ConvergenceError):
            alone = calibrate_accelerometers(session)
            assert alone.model.accelerometer is not None
            seen.append(stable_knowledge(alone.model.accelerometer.matrix, alone.covariance[:9, :9]))
    say_of_prior(estimate, knowledge, seen)


def _known_terms(u: Unknowns, *, wanted: bool) -> list[str]:
    """Optional terms that the start has; where none are wanted they are made zero."""
    u["gyro.g_sensitivity"][:] *= float(wanted)
    return ["g_sensitivity"] if np.any(u["gyro.g_sensitivity"]) else []


def _with_alike(
    task: JointAdjustment, given: Mapping[str, float], plain: np.ndarray
) -> tuple[dict[str, float], np.ndarray]:
    """Let what is wrong alike be unknown where it shows; return it, and the plain unknowns with it.

    Clock and table stay as they are where the recording tells nothing of them. A table's rates that are believed tell
    the clock, and so does the Earth's rotation to gyros that see it well.
    """
    rated = any(rotation.turn_rate is not None for rotation in task.data.rotations.values())
    adjusted = {"table_rate": given["table_rate"]} if rated and "table_rate" in given else {}
    if "clock" in given:
        both = {**adjusted, "clock": given["clock"]}
        trial = task.copy()
        trial.unknowns = task.unknowns.with_free(np.union1d(task.unknowns.free, LAYOUT.indices(*both)))
        trial.prior = together(task.prior, LAYOUT.sparse_prior(trial.unknowns.values, both))
        sizes, (at,) = name_plate(trial.unknowns)[trial.unknowns.free], trial.unknowns.places(["clock"])
        normal = linearise(trial)[1] * np.outer(sizes, sizes)
        # Directions of the sensors that nothing tells are open by their name plate.
        left = inverted(normal + np.eye(len(normal)))[at, at] * sizes[at] ** 2
        adjusted = both if np.sqrt(left) < CLOCK_TOLD * given["clock"] else adjusted
    if adjusted:
        plain = np.sort(np.concatenate([plain, LAYOUT.indices(*adjusted)]))
        task.prior = together(task.prior, LAYOUT.sparse_prior(task.unknowns.values, adjusted))
        task.unknowns = task.unknowns.with_free(plain)
    return adjusted, plain


def _rotations(
    base: HoldsAndTurns, u: Unknowns, rotations: Sequence[Rotation], broken: list[str]
) -> list[TableRotation]:
    inverse = inverted(gyro_matrix(u))
    made: list[TableRotation] = []
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
        rate = inverse @ (rotation.integral / rotation.seconds - u["gyro.bias"])
        made.append(
            table_rotation(
                base,
                before,
                rotation.start,
                rotation.stop,
                rate,
                angle=None if at_rate else rotation.angle,
                angle_sigma=0.0 if at_rate else rotation.angle_sigma,
                turn_rate=rotation.angle / rotation.seconds if at_rate else None,
                rate_sigma=rotation.angle_sigma / rotation.seconds if at_rate else 0.0,
                **_window_sizes(u, base, before, rate),
                row=rotation.row,
                name=f"rotation {rotation.row + 1}",
            )
        )
    return made


def _unlike_angle(rotations: Sequence[Rotation], u: Unknowns) -> str:
    """Say which angle of the protocol the gyros contradict most, if by far; whole turns more or less are no matter."""
    read = [one for one in rotations if one.is_from_rest]
    if not read:
        return ""
    inverse, angles = inverted(gyro_matrix(u)), np.array([abs(one.angle) for one in read])
    turned = np.array([inverse @ (one.integral - one.seconds * u["gyro.bias"]) for one in read])
    sizes = np.linalg.norm(turned, axis=1)
    # Rough gyros are off by some share alike.
    sizes /= float(np.median(sizes / angles))
    off = np.abs(np.remainder(sizes - angles + np.pi, 2.0 * np.pi) - np.pi)
    worst = int(np.argmax(off / angles))
    if off[worst] < UNLIKE * angles[worst]:
        return ""
    size, axis = np.copysign(sizes[worst], read[worst].angle), "xyz"[int(np.argmax(np.abs(turned[worst])))]
    return (
        f"Step {read[worst].step + 1}, about {axis}: the protocol says that the table turned "
        f"{np.degrees(read[worst].angle):.6g}°, and the gyros turned about {np.degrees(size):.4g}°. The table stopped "
        "early, or the display was misread: put the angle that it did turn into the protocol (`angle_deg`)."
    )


@contextmanager
def _explained(unlike: str) -> Generator[None]:
    """Say what is wrong with an angle where nothing settles."""
    try:
        yield
    except ConvergenceError as error:
        if unlike:
            raise ObservabilityError(unlike) from error
        raise


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
    return bool(np.any(steps > max(LONGEST_GAP, 1.5 * base.step)))


def _window_sizes(u: Unknowns, base: HoldsAndTurns, before: int, rate: Series) -> dict[str, float]:
    """How far a window may turn: gravity that stands on the axis does not go round, and wants few windows."""
    up = inverted(force_matrix(u)) @ (base.force_mean[before] - u["force.bias"])
    leaning = float(
        np.linalg.norm(np.cross(up, rate)) / max(np.linalg.norm(up) * np.linalg.norm(rate), 1e-30)
    )
    return {"largest_angle": UPRIGHT_ANGLE} if leaning < UPRIGHT else {}


def _refuse_nothing_told(untold: Untold, recording: Recording) -> None:
    """Refuse holds that tell nothing of accelerometers, or of counts not all: without a unit nothing is nominal."""
    needed = np.isin(LAYOUT.indices("force.bias", "force.scale"), untold.unknowns)
    if np.all(needed):
        raise ObservabilityError(
            f"The holds determine nothing of the accelerometers. {untold.sentences(FORCE_ALONE)[0]}"
        )
    if np.any(needed) and specific_force_factor(recording.specific_force_unit) is None:
        raise ObservabilityError(
            "The accelerometers count in unknown units, and the holds do not determine all their scale factors and "
            f"biases. {untold.sentences(FORCE_ALONE)[0]} Or say the unit with --units."
        )


def _seen_on_table(task: JointAdjustment) -> list[str]:
    """The terms that only a table's rotations show, as far as these do."""
    trial, free = task.copy(), unknowns_with(FORCE_ALONE, [*TERMS])
    trial.unknowns = trial.unknowns.with_free(np.union1d(task.unknowns.free, free))
    return seen_table_terms(linearise(trial)[1], trial.unknowns)


def _settled_from(
    task: JointAdjustment, names: list[str], *, a_start: bool
) -> tuple[JointAdjustment, Balanced, JointAdjustment]:
    """Balance from the first start that settles; return the adjustment, and as it was before.

    Without added variance a bias that wanders is first taken for an error of something else: then with rough ones.
    `a_start` : with terms that are yet to be tried, it is a start for the trials, and nothing is balanced.
    """
    fresh = task.copy()
    try:
        return task, _balanced_with(task, names, a_start=a_start), fresh
    except (ConvergenceError, ObservabilityError):
        has_gyro = fresh.unknowns.is_free("gyro.bias")
        again = replace(fresh, noise=rough_variances(fresh.data.base, fresh.unknowns, has_gyro=has_gyro))
        before = again.copy()
        return again, _balanced_with(again, names, a_start=a_start), before


def _balanced_with(task: JointAdjustment, names: list[str], *, a_start: bool) -> Balanced:
    """Balance with a table's terms: what is left of a lag by itself would be taken for a table that shakes.

    Lever arms that only round-off seems to tell are taken out of `names`, where nothing settles with them.
    """
    if "lever_arms" in names:
        before = task.copy()
        try:
            return _balanced(task, names, a_start=a_start)
        except (ConvergenceError, ObservabilityError):
            names.remove("lever_arms")
            for name in ("unknowns", "sections", "rotations", "noise", "taking_part", "prior"):
                setattr(task, name, getattr(before, name))
    return _balanced(task, names, a_start=a_start)


def _balanced(task: JointAdjustment, names: list[str], *, a_start: bool) -> Balanced:
    """Settle with some terms free, and hold them again.

    With a table's terms it is a start for trials that begin with the noise anew: nothing is balanced yet.
    """
    prior, free = task.prior, task.unknowns.free
    task.unknowns = task.unknowns.with_free(unknowns_with(free, names))
    task.prior = together(prior, terms_prior(task.unknowns))
    balanced = Balanced(solve_recording(task), [], {}) if names or a_start else balance_recording(task)
    task.unknowns, task.prior = task.unknowns.with_free(free), prior
    return balanced
