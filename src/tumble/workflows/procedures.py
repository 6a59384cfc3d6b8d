"""Which procedure evaluates a recording, what it is handed, and what a user is told about the choice."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from tumble.earth import Site
from tumble.errors import ConvergenceError, ObservabilityError, UsageError
from tumble.recording import (
    Recording,
    find_axis_contradiction,
    find_dead_channels,
    find_saturated_channels,
)

if TYPE_CHECKING:
    from tumble.calibration import Estimate
    from tumble.calibration.joint.believed import BelievedPoses
    from tumble.calibration.joint.estimate import JointOutcome
    from tumble.calibration.prior import StableKnowledge
    from tumble.protocol import Protocol
    from tumble.segmentation import HoldMeans, SpinMeans, Timeline
    from tumble.segmentation.matching import Matching
    from tumble.segmentation.rotations import Rotation

PROCEDURES = (
    "hand-held",
    "multi-position",
    "six-position",
    "improved-six-position",
    "rate-table",
    "modified-multi-position",
    "turntable",
    "laboratory",
    "strapdown-rotation",
    "joint",
    "thermal",
)
LATER_PROCEDURES: tuple[str, ...] = ()
# Where the joint estimator takes over unasked: on a turntable it is two to five times nearer the truth, for every grade
# that was simulated. By hand it predicts turns better, and holds of two of three real recordings less well.
JOINT_IS_BETTER: tuple[str, ...] = ("turntable",)
# These know the table's rates from the protocol and from nowhere else.
NEED_PROTOCOL = ("rate-table", "modified-multi-position", "turntable", "laboratory", "strapdown-rotation")


def _silent(_: str) -> None:
    """Tell nobody."""


@dataclass(slots=True)
class Task:
    """What a procedure is given.

    Attributes
    ----------
    recording, timeline, means, site : what was recorded, what was found in it, and where.
    protocol, matching : what was to be done, and which hold and spin is which of its steps.
    knowledge : of an earlier calibration.
    data_sheet : name of a grade whose spreads are a prior, for the multi-position procedure.
    optional_terms, noise_correction, unknowns : as for `calibrate`.
    say : is told in words what is being done.
    """

    recording: Recording
    timeline: Timeline
    means: HoldMeans
    site: Site
    protocol: Protocol | None = None
    matching: Matching | None = None
    knowledge: StableKnowledge | None = None
    data_sheet: str | None = None
    optional_terms: bool = True
    noise_correction: bool = True
    unknowns: int | None = None
    say: Callable[[str], None] = field(default=_silent)


def check_procedure(
    procedure: str | None, unknowns: int | None, *, has_protocol: bool, data_sheet: str | None = None
) -> None:
    """Refuse a procedure that there is not, or that lacks what it needs.

    Raises
    ------
    UsageError
        If the name is unknown, or an option does not go with it.
    """
    if unknowns is not None and procedure != "multi-position":
        raise UsageError(
            "--unknowns is for the multi-position procedure: add --procedure multi-position, or leave it out."
        )
    if data_sheet is not None:
        from tumble.simulation import find_grade

        find_grade(data_sheet)
        if procedure != "multi-position":
            raise UsageError(
                "--data-sheet is for the multi-position procedure: add --procedure multi-position, or leave it out."
            )
    if procedure in LATER_PROCEDURES:
        raise UsageError(
            f"The procedure {procedure} is not part of this version: it has {', '.join(PROCEDURES)}."
        )
    if procedure is not None and procedure not in PROCEDURES:
        raise UsageError(f"There is no procedure {procedure!r}: choose one of {', '.join(PROCEDURES)}.")
    if procedure in NEED_PROTOCOL and not has_protocol:
        example = "turntable-9" if procedure == "turntable" else procedure
        raise UsageError(
            f"The procedure {procedure} has to know the table's rates and directions: write them into a protocol "
            f"file and give --protocol FILE. `tumble simulate {example} -o DIR` writes an example, DIR/protocol.yaml."
        )


def run_procedure(task: Task, procedure: str | None) -> tuple[Estimate, str]:
    """Run the procedure asked for, the protocol's own, or the one that the recording suits; say why.

    Raises
    ------
    ObservabilityError, ConvergenceError, SegmentationError
        If the recording cannot serve.
    """
    if procedure is not None:
        return _run(task, procedure), f"Procedure {procedure}, as asked for."
    if task.protocol is not None:
        own = task.protocol.procedure
        check_procedure(own, None, has_protocol=True)
        said = f"Procedure {own}, as the protocol {task.protocol.name} says"
        return _improved(task, _run(task, own), said)
    estimate, reason = _most_telling(task)
    return _improved(task, estimate, reason.rstrip("."))


def _run(task: Task, procedure: str) -> Estimate:
    if task.knowledge is not None and procedure in (
        "six-position",
        "improved-six-position",
        "rate-table",
        "laboratory",
    ):
        raise UsageError(
            f"--prior is not used by the procedure {procedure}: leave it out, or take --procedure multi-position."
        )
    try:
        estimate = _PROCEDURES[procedure](task)
    except ObservabilityError as error:
        raise ObservabilityError(f"{error}{_how_it_matched(task)}") from error
    if task.matching is not None:
        estimate.say("remark", *(r for r in task.matching.remarks if r not in estimate.remarks))
    return estimate


def _improved(task: Task, estimate: Estimate, reason: str) -> tuple[Estimate, str]:
    """Return the joint estimate where it is the better one, with the procedure's own beside it."""
    if estimate.procedure not in JOINT_IS_BETTER:
        return estimate, f"{reason}."
    try:
        joint = run_joint(task, estimate)
    except (ObservabilityError, ConvergenceError) as error:
        estimate.say("remark", f"The joint estimator does not settle on this recording: {error}")
        return estimate, f"{reason}."
    return joint, f"{reason}; estimated jointly from everything that was recorded (procedure joint)."


def _how_it_matched(task: Task) -> str:
    """Return how much of the protocol was found, where something is missing: it may be another recording's."""
    matching, protocol = task.matching, task.protocol
    if matching is None or protocol is None or not (matching.missing or matching.extra):
        return ""
    found = len({match.step for match in (*matching.holds, *matching.spins)})
    extra = len(matching.extra)
    beside = f", and {extra} holds of the recording are not in it" if extra else ""
    return (
        f" Of the {found + len(matching.missing)} holds and spins of the protocol {protocol.name} {found} were found"
        f"{beside}: if that is not what was done, give another protocol."
    )


def _most_telling(task: Task) -> tuple[Estimate, str]:
    from tumble.calibration.procedures.hand_held import SMALLEST_TURNS

    recording, timeline = task.recording, task.timeline
    turns = sum(turn.usable for turn in timeline.turns)
    if recording.specific_force is None or recording.angular_rate is None:
        return _multi_position(task), "Procedure multi-position: the recording has one triad only."
    if turns < SMALLEST_TURNS:
        return _multi_position(task), (
            f"Procedure multi-position: {turns} turns between holds can be used, and the hand-held "
            f"procedure needs {SMALLEST_TURNS}."
        )
    try:
        return _hand_held(task), (
            f"Procedure hand-held: {len(timeline.holds)} holds and {turns} turns between them were found, "
            "which tell both triads."
        )
    except ObservabilityError as error:
        # Too few poses are too few for either; only what the gyro lacks leaves the other way open.
        estimate = _multi_position(task)
        return estimate, f"Procedure multi-position: the turns do not tell the gyro. {error}"


def _hand_held(task: Task) -> Estimate:
    from tumble.calibration import calibrate_hand_held

    return calibrate_hand_held(
        task.recording,
        task.timeline,
        task.means,
        task.site,
        prior=task.knowledge,
        optional_terms=task.optional_terms,
        progress=task.say,
    )


def _multi_position(task: Task) -> Estimate:
    from tumble.calibration import calibrate_multi_position
    from tumble.simulation import find_grade

    return calibrate_multi_position(
        task.recording,
        task.means,
        task.site,
        prior=task.knowledge,
        data_sheet=None if task.data_sheet is None else find_grade(task.data_sheet),
        noise_correction=task.noise_correction,
        unknowns=task.unknowns or 9,
        progress=task.say,
    )


def _six_position(task: Task) -> Estimate:
    return _faces(task, improved=False)


def _improved_six_position(task: Task) -> Estimate:
    return _faces(task, improved=True)


def _faces(task: Task, *, improved: bool) -> Estimate:
    from tumble.calibration.procedures.six_position import calibrate_six_position
    from tumble.workflows.faces import match_faces

    protocol, matching = task.protocol, task.matching
    if protocol is None or matching is None:
        protocol, matching = match_faces(task.means, task.site)
    estimate = calibrate_six_position(
        task.recording, task.means, matching, protocol, task.site, improved=improved
    )
    estimate.say("remark", *(r for r in matching.remarks if r not in estimate.remarks))
    return estimate


def _rate_table(task: Task) -> Estimate:
    from tumble.calibration.procedures.rate_table import calibrate_rate_table

    protocol, matching, spins = _spins(task)
    return calibrate_rate_table(task.recording, task.means, spins, matching, protocol, task.site)


def _modified_multi_position(task: Task) -> Estimate:
    from tumble.calibration.procedures.modified_multi_position import calibrate_modified_multi_position

    protocol, matching, spins = _spins(task)
    return calibrate_modified_multi_position(
        task.recording, task.means, spins, matching, protocol, task.site, prior=task.knowledge
    )


def _turntable(task: Task) -> Estimate:
    from tumble.calibration.procedures.turntable import calibrate_turntable
    from tumble.segmentation.rotations import observe_rotations

    protocol, matching, spins = _spins(task)
    rotations = observe_rotations(protocol, task.recording, task.timeline, matching, task.means, spins)
    return calibrate_turntable(
        task.recording,
        task.timeline,
        task.means,
        rotations,
        matching,
        protocol,
        task.site,
        prior=task.knowledge,
    )


def _laboratory(task: Task) -> Estimate:
    from tumble.calibration.procedures.laboratory import calibrate_laboratory
    from tumble.segmentation.rotations import observe_rotations

    protocol, matching, spins = _spins(task)
    rotations = observe_rotations(protocol, task.recording, task.timeline, matching, task.means, spins)
    return calibrate_laboratory(task.recording, task.means, rotations, matching, protocol, task.site)


def _strapdown_rotation(task: Task) -> Estimate:
    from tumble.calibration.procedures.strapdown_rotation import calibrate_strapdown_rotation

    if task.protocol is None or task.matching is None:
        raise UsageError("This procedure needs a protocol: give --protocol FILE.")
    return calibrate_strapdown_rotation(
        task.recording, task.timeline, task.means, task.matching, task.protocol, task.site
    )


def run_joint(
    task: Task, start: Estimate | None = None, *, keep: Callable[[JointOutcome], None] | None = None
) -> Estimate:
    """Adjust everything at once, from the start that the recording's own procedure gives.

    Parameters
    ----------
    task : what is known of the recording.
    start : another procedure's estimate; None runs the recording's own first.
    keep : is handed the settled solution, see `calibrate_joint`.
    """
    from tumble.calibration.joint.procedure import calibrate_joint

    first = _start_of_joint(task) if start is None else start
    return calibrate_joint(
        task.recording,
        task.timeline,
        task.means,
        task.site,
        first,
        rotations=_rotations_if_any(task),
        poses=_poses(task),
        prior=task.knowledge,
        optional_terms=task.optional_terms,
        progress=task.say,
        keep=keep,
    )


def _start_of_joint(task: Task) -> Estimate | None:
    """The protocol's own procedure if it tells something, else the hand-held one; None where neither does."""
    own = None if task.protocol is None else task.protocol.procedure
    try:
        if own in _PROCEDURES and own not in ("joint", "thermal"):
            return _PROCEDURES[own](task)
        return _hand_held(task)
    except (ObservabilityError, ConvergenceError):
        return None


def _poses(task: Task) -> BelievedPoses | None:
    from tumble.calibration.joint.believed import believed_poses

    if (
        task.protocol is None
        or task.matching is None
        or task.protocol.procedure in ("turntable", "hand-held")
    ):
        return None
    return believed_poses(task.protocol, task.matching)


def _rotations(task: Task) -> list[Rotation]:
    from tumble.segmentation.rotations import observe_rotations

    protocol, matching, spins = _spins(task)
    return observe_rotations(protocol, task.recording, task.timeline, matching, task.means, spins)


def _rotations_if_any(task: Task) -> list[Rotation]:
    has_spins = task.matching is not None and len(task.matching.spins) > 0
    return _rotations(task) if has_spins and task.recording.angular_rate is not None else []


def _thermal(task: Task) -> Estimate:
    from tumble.calibration.thermal.procedure import calibrate_thermal

    return calibrate_thermal(
        task.recording, task.timeline, task.site, protocol=task.protocol, progress=task.say
    )


def _spins(task: Task) -> tuple[Protocol, Matching, SpinMeans]:
    from tumble.segmentation.matching import observe_matched_spins

    if task.protocol is None or task.matching is None:
        raise UsageError("This procedure needs a protocol: give --protocol FILE.")
    return (
        task.protocol,
        task.matching,
        observe_matched_spins(task.protocol, task.recording, task.timeline, task.matching),
    )


_PROCEDURES: dict[str, Callable[[Task], Estimate]] = {
    "hand-held": _hand_held,
    "multi-position": _multi_position,
    "six-position": _six_position,
    "improved-six-position": _improved_six_position,
    "rate-table": _rate_table,
    "modified-multi-position": _modified_multi_position,
    "turntable": _turntable,
    "laboratory": _laboratory,
    "strapdown-rotation": _strapdown_rotation,
    "thermal": _thermal,
    "joint": run_joint,
}


def add_objections(task: Task, estimate: Estimate, procedure: str | None, reason: str) -> None:
    """Say what a user who meant a whole calibration does not get, and what was wrong with the sensors."""
    from tumble.calibration.procedures.hand_held import SMALLEST_TURNS

    recording, timeline = task.recording, task.timeline
    estimate.say("objection", *find_dead_channels(recording))
    estimate.say("remark", *find_saturated_channels(recording))
    if recording.specific_force is not None and recording.angular_rate is not None:
        # Holds do not tell which way the gyro counts; where there are turns between them, these do.
        contradiction = find_axis_contradiction(recording)
        estimate.say("objection", *([] if contradiction is None else [contradiction]))
    if procedure is None and task.protocol is not None:
        return
    lost = [turn for turn in timeline.turns if not turn.usable]
    for turn in lost[:5]:
        estimate.say(
            "remark",
            f"The turn from hold {turn.before + 1} to hold {turn.after + 1} was not used: {turn.reason}.",
        )
    if len(lost) > 5:
        estimate.say("remark", f"{len(lost) - 5} more turns were not used for such reasons.")
    meant_for_turns = procedure is None and recording.angular_rate is not None
    if meant_for_turns and estimate.procedure == "multi-position" and len(timeline.turns) >= SMALLEST_TURNS:
        because = f" {len(lost)} of them cannot be used ({lost[0].reason})." if lost else ""
        estimate.say(
            "objection",
            f"The recording has {len(timeline.turns)} turns, but they do not calibrate the gyro.{because} {reason} "
            "With --procedure multi-position the accelerometers' part is judged alone.",
        )


def check_prior(tasks: Sequence[Task], knowledge: StableKnowledge, estimate: Estimate) -> None:
    """Object to a prior that the poses contradict, where they can tell the angles without it.

    Parameters
    ----------
    tasks : recordings of one unit, that tell its angles together.
    knowledge : the prior.
    estimate : gets an objection, or a caution where nothing can be checked.
    """
    from tumble.calibration.prior import find_contradiction, weighted_knowledge

    seen = [own for own in map(_own_angles, tasks) if own is not None]
    if not seen:
        estimate.say(
            "caution",
            "The prior is taken on trust: the poses are too few to check it against them, and with another unit's the "
            "result would look the same and be wrong. Be sure that it is this unit's, or record nine poses or more.",
        )
        return
    contradiction = find_contradiction(knowledge, weighted_knowledge(seen))
    if contradiction is not None:
        estimate.say("objection", contradiction)


def _own_angles(task: Task) -> StableKnowledge | None:
    """What a recording's poses tell of the angles without any prior; None where they are too few."""
    from tumble.calibration import calibrate_multi_position
    from tumble.calibration.prior import stable_knowledge

    try:
        alone = calibrate_multi_position(task.recording, task.means, task.site)
    except (ObservabilityError, ConvergenceError):
        return None
    assert alone.model.accelerometer is not None
    return stable_knowledge(alone.model.accelerometer.matrix, alone.covariance[:9, :9])
