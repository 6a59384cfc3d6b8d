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

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from tumble.arrays import Series, inverted
from tumble.calibration.checks.observability import (
    Untold,
    angle_prior,
    find_untold,
    name_plate_prior,
    together,
)
from tumble.calibration.checks.unseen import add_common_scale, rest_rate
from tumble.calibration.equations.adjustment import JointAdjustment, balance_recording, solve_recording
from tumble.calibration.equations.believed_poses import BelievedPoses
from tumble.calibration.equations.imu_unknowns import (
    FORCE_ALONE,
    LAYOUT,
    PLAIN,
    force_matrix,
    gyro_matrix,
    imu_unknowns,
    name_plate,
    term_unknowns,
    terms_prior,
    unknowns_of,
)
from tumble.calibration.equations.observed import TableRotation, observe, table_rotation, with_rounding
from tumble.calibration.equations.pose_equations import mounting_prior
from tumble.calibration.equations.turn import HoldsAndTurns
from tumble.calibration.estimate import Estimate, TermTest
from tumble.calibration.optional_terms import (
    determined_terms,
    gives_way,
    offered_terms,
    possible_terms,
    seen_table_terms,
    surprise_added,
    term_limits,
    unknowns_with,
    wanted_terms,
    worse_predicted,
)
from tumble.calibration.outcome.estimate import JointOutcome, joint_estimate
from tumble.calibration.prior import StableKnowledge
from tumble.calibration.procedures.hand_held import USUAL_STEPS, add_time_lag
from tumble.calibration.start import gather_what_there_is, rough_start, rough_variances, start_adjustment
from tumble.calibration.terms import TERMS
from tumble.counting import about
from tumble.earth import Site
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.estimation.balance import Balanced, Noise
from tumble.estimation.solve import linearise, solve
from tumble.estimation.unknowns import Unknowns
from tumble.recording.recording import Recording
from tumble.segmentation import HoldMeans, Timeline
from tumble.segmentation.rotations import Rotation
from tumble.segmentation.turns import LONGEST_GAP

# An axis that leans by less than this is upright; a window may then turn so far.
UPRIGHT, UPRIGHT_ANGLE = 0.1, 3.0  # rad
# A recording tells its clock if it leaves less than this share of what is believed of it open.
CLOCK_TOLD = 0.3


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
    alike: Mapping[str, float] | None = None,
    partly: bool = True,
    optional_terms: bool = True,
    sought: frozenset[str] = frozenset(),
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
    frame : of the result: "accelerometer-x", "mean-gyro", or "fixture" where poses tell it.
    prior : what an earlier calibration knows of the accelerometers' angles.
    alike : of what gyros are compared with and may be wrong alike, ``clock`` and ``table_rate``, one sigma as a share;
        None takes both as exact.
    partly : go on where some unknowns are not told, and leave them to the name plate.
    optional_terms : try g-sensitivity, quadratic terms and asymmetries, on a table a lag between the triads and the
        accelerometers' lever arms too, and keep what the data want.
    sought : optional terms that the recording was made for: they are kept where it determines them.
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
    u = _start_values(recording, timeline, means, site, start)
    base, has_gyro = gather_what_there_is(recording, timeline, means)
    _refuse_undetermined(frame, poses)
    broken: list[str] = []
    turned = _rotations(base, u, rotations, broken)
    data = observe(with_rounding(base, turned), u, turned)
    data.poses = poses
    plain = PLAIN if has_gyro else FORCE_ALONE
    if poses is not None:
        plain = np.concatenate([plain, LAYOUT.indices("fixture")])
    known = _known_terms(u, wanted=optional_terms)
    task = start_adjustment(data, u.with_free(plain), site)
    task.taking_part["rate"] &= has_gyro
    task.prior = together(angle_prior(u, prior), None if poses is None else mounting_prior(u))
    given = {name: sigma for name, sigma in (alike or {}).items() if sigma > 0.0 and has_gyro}
    adjusted, plain = _with_alike(task, given, plain)
    untold = find_untold(linearise(task)[1], task.unknowns)
    if untold is not None:
        _refuse_nothing_told(untold, partly=partly)
        task.prior = together(task.prior, name_plate_prior(u.with_free(plain)))
        task.noise = rough_variances(base, u, has_gyro=has_gyro)
        optional_terms, known = False, []
    task.unknowns = task.unknowns.with_free(unknowns_with(plain, known))
    of_table = _seen_on_table(task) if optional_terms and has_gyro and data.rotations else []
    with about(USUAL_STEPS):
        task, balanced, fresh = _settled_from(
            task, of_table, lambda: rough_start(recording, timeline, means, site), a_start=bool(known)
        )
    tests: list[TermTest] = []
    untried: list[str] = []
    if optional_terms:
        task, balanced, tests, untried = _with_terms(task, balanced, fresh, plain, of_table, sought, say)
    outcome = JointOutcome(recording, task, balanced, tests, start, untold, frame, has_gyro, prior, untried)
    outcome.table_sigma = None if alike is None else alike.get("table_rate")
    if keep is not None:
        keep(outcome)
    clock = None if "clock" in adjusted else given.get("clock")
    return _completed(
        outcome, base, means, clock, broken, lag=optional_terms and has_gyro and not data.rotations
    )


def _completed(
    outcome: JointOutcome,
    base: HoldsAndTurns,
    means: HoldMeans,
    clock: float | None,
    broken: Sequence[str],
    *,
    lag: bool,
) -> Estimate:
    """The estimate with what is found beside the adjustment: the clock's scale, a lag."""
    estimate = joint_estimate(outcome)
    if clock is not None:
        add_common_scale(estimate, clock, rest_rate(estimate, means))
    if lag:
        add_time_lag(estimate, base)
    estimate.say("remark", *broken)
    return estimate


def _refuse_undetermined(frame: str, poses: BelievedPoses | None) -> None:
    if poses is None and frame == "fixture":
        raise ObservabilityError(
            f"No pose is believed, so that nothing determines the frame {frame!r}: give a protocol "
            "whose holds have poses with a small sigma, or leave the frame as it is."
        )


def _known_terms(u: Unknowns, *, wanted: bool) -> list[str]:
    """Optional terms that the start has; where none are wanted they are made zero."""
    names = ("g_sensitivity", "quadratic")
    if wanted:
        return [name for name in names if np.any(u.values[term_unknowns(name)])]
    for name in names:
        u.values[term_unknowns(name)] = 0.0
    return []


def _with_alike(
    task: JointAdjustment, given: Mapping[str, float], plain: np.ndarray
) -> tuple[dict[str, float], np.ndarray]:
    """Let what is wrong alike be unknown where it shows; return it, and the plain unknowns with it."""
    adjusted = _adjusted_alike(task, given)
    if adjusted:
        plain = np.sort(np.concatenate([plain, LAYOUT.indices(*adjusted)]))
        task.prior = together(task.prior, LAYOUT.sparse_prior(task.unknowns.values, adjusted))
        task.unknowns = task.unknowns.with_free(plain)
    return adjusted, plain


def _adjusted_alike(task: JointAdjustment, given: Mapping[str, float]) -> dict[str, float]:
    """What clock and table may be wrong by alike and the recording tells something of: the others stay as they are.

    A table's rates that are believed tell the clock, and so does the Earth's rotation to gyros that see it well.
    """
    rated = any(rotation.turn_rate is not None for rotation in task.data.rotations.values())
    table = {"table_rate": given["table_rate"]} if rated and "table_rate" in given else {}
    if "clock" not in given:
        return table
    both = {**table, "clock": given["clock"]}
    trial = task.copy()
    trial.unknowns = task.unknowns.with_free(np.union1d(task.unknowns.free, LAYOUT.indices(*both)))
    trial.prior = together(task.prior, LAYOUT.sparse_prior(trial.unknowns.values, both))
    sizes, (at,) = name_plate(trial.unknowns)[trial.unknowns.free], trial.unknowns.places(["clock"])
    normal = linearise(trial)[1] * np.outer(sizes, sizes)
    # Directions of the sensors that nothing tells are open by their name plate.
    left = inverted(normal + np.eye(len(normal)))[at, at] * sizes[at] ** 2
    return both if np.sqrt(left) < CLOCK_TOLD * given["clock"] else table


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


def _start_values(
    recording: Recording, timeline: Timeline, means: HoldMeans, site: Site, start: Estimate | None
) -> Unknowns:
    """From another procedure's estimate as far as it goes, the rest roughly."""
    model = None if start is None else start.model
    if model is not None and model.accelerometer is not None and model.gyroscope is not None:
        return imu_unknowns(unknowns_of(model))
    u = rough_start(recording, timeline, means, site)
    if start is not None and start.model.gyroscope is not None and _tells_gyros(start):
        u["gyro.matrix"][:] = start.model.gyroscope.matrix.ravel()
        u["gyro.bias"][:] = start.model.gyroscope.bias
    return u


def _tells_gyros(start: Estimate) -> bool:
    return sum(name.startswith("gyroscope.matrix") for name in start.names) == 9


def _refuse_nothing_told(untold: Untold, *, partly: bool) -> None:
    """Refuse a recording that does not even tell biases and scale factors of the accelerometers, or not everything."""
    if not partly:
        raise ObservabilityError(
            f"it needs a motion that determines all of both triads. {' '.join(untold.sentences[:1])}"
        )
    if np.all(np.isin(LAYOUT.indices("force.bias", "force.scale"), untold.unknowns)):
        raise ObservabilityError(f"The holds determine nothing of the accelerometers. {untold.sentences[0]}")


def _seen_on_table(task: JointAdjustment) -> list[str]:
    """The terms that only a table's rotations show, as far as these do."""
    trial = task.copy()
    trial.unknowns = trial.unknowns.with_free(
        np.union1d(task.unknowns.free, unknowns_with(FORCE_ALONE, [*TERMS]))
    )
    return seen_table_terms(linearise(trial)[1], trial.unknowns)


def _settled_from(
    task: JointAdjustment, names: list[str], rough: Callable[[], Unknowns], *, a_start: bool
) -> tuple[JointAdjustment, Balanced, JointAdjustment]:
    """Balance from the first start that settles; return the adjustment, and as it was before.

    `a_start` : with terms that are yet to be tried, it is a start for the trials, and nothing is balanced.
    """
    fresh = task.copy()
    try:
        return task, _balanced_with(task, names, a_start=a_start), fresh
    except (ConvergenceError, ObservabilityError) as error:
        for other in _other_starts(fresh, rough()):
            before = other.copy()
            try:
                return other, _balanced_with(other, names, a_start=a_start), before
            except (ConvergenceError, ObservabilityError):
                continue
        raise error


def _other_starts(fresh: JointAdjustment, rough: Unknowns) -> Iterator[JointAdjustment]:
    """The same sensors with rough variances, then rough sensors with them.

    Without added variance a bias that wanders is first taken for an error of something else.
    """
    has_gyro = fresh.unknowns.is_free("gyro.bias")
    noise = rough_variances(fresh.data.base, fresh.unknowns, has_gyro=has_gyro)
    again = start_adjustment(fresh.data, rough.with_free(fresh.unknowns.free), fresh.site)
    for one in (fresh.copy(), again):
        yield replace(one, noise=noise.copy(), taking_part=fresh.copy().taking_part, prior=fresh.prior)


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


def _with_terms(
    task: JointAdjustment,
    base: Balanced,
    fresh: JointAdjustment,
    plain: np.ndarray,
    of_table: list[str],
    sought: frozenset[str],
    say: Callable[[str], None],
) -> tuple[JointAdjustment, Balanced, list[TermTest], list[str]]:
    """Try all optional terms at once, drop the least significant until every one left is wanted.

    `fresh` has its variances and what takes part as they were before anything was balanced: what looks like a bad turn
    without a term may be the term. Returned last are the terms that were not tried.
    """
    say("optional terms")
    offered = offered_terms(has_gyro=task.unknowns.is_free("gyro.bias")) + of_table
    names: list[str] = _determined(task, fresh, plain, offered)
    untried = [name for name in offered if name not in names]
    limits, tests = term_limits(offered), dict[str, TermTest]()
    with about(USUAL_STEPS):
        without = _without_terms(task, base, fresh, plain)
        names = _not_needless(*without, plain, names, tests, limits, sought)
    while names:
        say(f"optional terms: {len(names)} of {len(offered)} in question")
        trial = _from_before(task, fresh, unknowns_with(plain, names))
        trial.prior = together(trial.prior, terms_prior(trial.unknowns))
        try:
            with about(USUAL_STEPS):
                balanced = balance_recording(trial)
        except (ObservabilityError, ConvergenceError):
            # Where the equations are bent, what is determined to first order may not be.
            untried.append(max(names, key=gives_way))
            names = [name for name in names if name != untried[-1]]
            # An earlier trial, with more terms, may have wanted it.
            tests.pop(untried[-1], None)
            continue
        wanted = wanted_terms(trial, balanced, names, tests, limits, sought)
        if wanted == names:
            worse = [n for n in worse_predicted(without[1], balanced, names) if n not in sought]
            worse.sort(key=lambda n: -tests[n].probability)
            weakest = _unneeded(task, fresh, plain, without[1], balanced, worse)
            if weakest is None:
                return trial, balanced, list(tests.values()), untried
            tests[weakest] = replace(tests[weakest], kept=False)
            wanted = [name for name in names if name != weakest]
        names = wanted
    return *without, list(tests.values()), untried


def _not_needless(
    task: JointAdjustment,
    balanced: Balanced,
    plain: np.ndarray,
    names: list[str],
    tests: dict[str, TermTest],
    limits: dict[str, float],
    sought: frozenset[str],
) -> list[str]:
    """The terms that may be wanted, by one step from the adjustment without any; what it shows is added to `tests`.

    Where something was left out or weighed less for want of a term, one step does not show it: all may be.
    """
    masked = balanced.outliers or any(task.noise.factors.values())
    if not names or masked or balanced.solution.unknowns.free.size != plain.size:
        return names
    trial = task.copy()
    trial.unknowns = trial.unknowns.with_free(unknowns_with(plain, names))
    trial.prior = together(trial.prior, terms_prior(trial.unknowns))
    try:
        solution = solve(trial, once=True)
    except (ObservabilityError, ConvergenceError):
        return names
    found = dict[str, TermTest]()
    left = possible_terms(trial, Balanced(solution, [], solution.tests()), names, found, sought)
    tests.update({name: replace(found[name], limit=limits[name]) for name in names if name not in left})
    return left


def _unneeded(
    task: JointAdjustment,
    fresh: JointAdjustment,
    plain: np.ndarray,
    without: Balanced,
    balanced: Balanced,
    worse: list[str],
) -> str | None:
    """The first term without which everything that was recorded is predicted better; None if there is none.

    Holds are not predicted better by what turns tell of accelerometers, and turns are. `without` has no term at all.
    """
    for name in worse:
        free = np.union1d(np.setdiff1d(balanced.solution.unknowns.free, term_unknowns(name)), plain)
        if np.array_equal(free, without.solution.unknowns.free):
            other = without
        else:
            # Without any term nothing settled: `without` would be that.
            other = _balanced_from(task, fresh, free) if free.size > plain.size else None
        if other is not None and surprise_added(other, balanced, ("force", "rate", "turn")) > 0.0:
            return name
    return None


def _balanced_from(task: JointAdjustment, fresh: JointAdjustment, free: np.ndarray) -> Balanced | None:
    """The balanced adjustment of some unknowns, from before; None where it does not settle."""
    alone = _from_before(task, fresh, free)
    alone.prior = together(alone.prior, terms_prior(alone.unknowns))
    try:
        return balance_recording(alone)
    except (ObservabilityError, ConvergenceError):
        return None


def _without_terms(
    task: JointAdjustment, base: Balanced, fresh: JointAdjustment, plain: np.ndarray
) -> tuple[JointAdjustment, Balanced]:
    """The adjustment without any optional term: what it is compared with, and what is left if none is wanted."""
    if base.solution.unknowns.free.size == plain.size:
        return task, base
    alone = _from_before(task, fresh, plain)
    try:
        return alone, balance_recording(alone)
    except (ObservabilityError, ConvergenceError):
        # Terms that the start had may be what it settles with.
        again = _from_before(task, fresh, base.solution.unknowns.free)
        again.prior = together(again.prior, terms_prior(again.unknowns))
        return again, balance_recording(again)


def _from_before(task: JointAdjustment, fresh: JointAdjustment, free: np.ndarray) -> JointAdjustment:
    """A copy from where the adjustment is, with noise and observations as they were before it was balanced."""
    return replace(task.copy(free), noise=fresh.noise.copy(), taking_part=fresh.copy().taking_part)


def _determined(
    task: JointAdjustment, fresh: JointAdjustment, plain: np.ndarray, names: list[str]
) -> list[str]:
    """The terms that the recording determines, by the information where the adjustment without them has settled.

    All that was recorded counts: a turn may have been left out for the very term that nothing else shows.
    """
    trial = replace(
        task.copy(unknowns_with(plain, names)),
        noise=Noise(dict(task.noise.added), fresh.noise.copy().factors),
        taking_part=fresh.copy().taking_part,
    )
    return determined_terms(linearise(trial)[1], trial.unknowns, plain, names)


def _silent(_: str) -> None:
    """Tell nobody."""
