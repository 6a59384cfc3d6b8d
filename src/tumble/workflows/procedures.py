"""Which procedure evaluates a recording, and what a user is told about the choice."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tumble.calibration import (
    FIRST_TRIED,
    Estimator,
    Procedure,
    Session,
    find_procedure,
    of_other_rests,
    say_of_recording,
    say_of_sheets,
    say_of_turns,
    state_rounding,
    state_unseen,
    triad_sheets,
)
from tumble.errors import ConvergenceError, ObservabilityError, UsageError
from tumble.recording import find_dead_channels

if TYPE_CHECKING:
    from tumble.calibration import Estimate
    from tumble.workflows.results import Clock

GROUP = "tumble.estimators"
"""The group of entry points: each names a mapping from an estimator's name to its record."""
CONTRADICTS = (
    " No one adjustment fits all that was recorded. Two units may be in one recording, a bias may have jumped, samples "
    "may be missing, or an angle, rate or pose of the protocol may be wrong."
)


def check_procedure(procedure: str | None, *, has_protocol: bool) -> None:
    """Refuse a procedure that there is not, or that lacks its protocol.

    Parameters
    ----------
    procedure : its name; None lets the recording decide.
    has_protocol : whether a protocol says what was done.

    Raises
    ------
    UsageError
        If the name is unknown, or it needs a protocol.
    """
    found = None if procedure is None else find_procedure(procedure)
    if found is not None and found.example and not has_protocol:
        raise UsageError(
            f"The procedure {procedure} has to know the table's rates and directions: write them into a protocol "
            f"file and give --protocol FILE. `tumble simulate {found.example} -o DIR` writes an example, "
            "DIR/protocol.yaml."
        )


def find_estimator(name: str, *, has_protocol: bool) -> Estimator:
    """Return the estimator of a name, of all that installed packages offer.

    Parameters
    ----------
    name : as ``--estimator`` takes it.
    has_protocol : whether a protocol says what was done.

    Raises
    ------
    UsageError
        If there is none, packages offer several, or it needs a protocol.
    """
    from importlib.metadata import entry_points  # a twentieth of what all of tumble takes to load

    found, names, broken = dict[Estimator, str](), list[str](), ""
    for point in entry_points(group=GROUP):
        package = point.dist.name if point.dist else point.value
        try:
            offered: Mapping[str, Estimator] = point.load()
            names += [f"{one.name} ({one.title}; {one.source})" for one in offered.values()]
            found |= {offered[name]: package} if name in offered else {}
        except Exception as error:  # noqa: BLE001 (one package's fault leaves the others)
            broken += f" Those of the package {package} cannot be imported ({type(error).__name__}: {error})."
    if not found:
        raise UsageError(f"There is no estimator {name!r}. There are: {'; '.join(names) or 'none'}.{broken}")
    if len(found) > 1:
        raise UsageError(f"The packages {' and '.join(found.values())} both have {name}: uninstall one.")
    one = found.popitem()[0]
    if one.needs_protocol and not has_protocol:
        raise UsageError(f"The estimator {name} has to know what a table did: give --protocol FILE.")
    return one


def find_holds(session: Session, intervals: str | os.PathLike[str] | None, clock: Clock) -> None:
    """Find holds and turns, and which step of the protocol each of them is.

    Parameters
    ----------
    session : of one recording.
    intervals : as for `calibrate`.
    clock : is told how long it takes.
    """
    session.say("finding holds and turns")
    from tumble.segmentation import read_intervals

    clock.lap("importing")
    session.intervals = None if intervals is None else read_intervals(Path(intervals))
    if session.by_temperature:
        from tumble.calibration import require_time_base

        require_time_base(session.recording, session.protocol)
    # Asked for now, so that what is wrong with holds is said before anything else.
    _ = session.means, session.matching
    clock.lap("segmenting")


def run_procedure(session: Session, procedure: str | None) -> tuple[Estimate, str]:
    """Calibrate by the procedure asked for, the protocol's own, or the one that the recording suits; say why.

    Parameters
    ----------
    session : what was recorded.
    procedure : as asked for; None for nothing.

    Raises
    ------
    ObservabilityError, ConvergenceError, SegmentationError
        If the recording cannot serve.
    """
    try:
        chosen, reason = _chosen(session, procedure)
        estimate = _calibrated(session, chosen)
    except (ObservabilityError, ConvergenceError) as error:
        # Rests that were put aside are why poses are too few, and a channel that is dead is why nothing settles.
        said = [*filter(None, [of_other_rests(session)]), *find_dead_channels(session.recording)]
        asked = CONTRADICTS if isinstance(error, ConvergenceError) else ""
        raise type(error)(" ".join([*said, f"{error}{asked}{_how_it_matched(session)}"])) from error
    made = estimate, session.recording, session.means
    state_unseen(*made, session.protocol)
    state_rounding(*made, session.timeline)
    return estimate, f"{reason}."


def _chosen(session: Session, procedure: str | None) -> tuple[Procedure, str]:
    """The procedure, and why it is that; what it assumes of a recording without a protocol is told to the session."""
    if procedure is not None:
        chosen, reason = find_procedure(procedure), f"Procedure {procedure}, as asked for"
    elif session.protocol is not None:
        chosen = find_procedure(session.protocol.procedure)
        reason = f"Procedure {chosen.name}, as the protocol {session.protocol.name} says"
    else:
        chosen, why = find_procedure(FIRST_TRIED), ""
        while chosen.otherwise and not (suits := chosen.suits(session)).fits:
            chosen, why = find_procedure(chosen.otherwise), suits.why
        reason = f"Procedure {chosen.name}: {why or chosen.suits(session).why}"
    if chosen.assumes is not None and session.protocol is None:
        session.protocol, session.matching = chosen.assumes(session.means, session.site)
    return chosen, reason


def _calibrated(session: Session, procedure: Procedure) -> Estimate:
    from tumble.calibration import calibrate

    if procedure.by_temperature and (session.prior is not None or session.options.data_sheet is not None):
        raise UsageError(f"--prior is not used by the procedure {procedure.name}: leave it out.")
    procedure = believed(session, procedure)
    estimate = _of_another_kind(session, procedure) or calibrate(session, procedure)
    if session.matching is not None:
        estimate.say("remark", *(r for r in session.matching.remarks if r not in estimate.remarks))
    return estimate


def _of_another_kind(session: Session, procedure: Procedure) -> Estimate | None:
    """The estimate without the data sheet where it contradicts the sheet: with it nothing may settle, or fit."""
    from tumble.calibration import calibrate

    given, sheets = session.options, triad_sheets(session.options.data_sheet, session.recording)
    estimate, session.options = None, replace(given, data_sheet=None)
    with suppress(ObservabilityError, ConvergenceError):
        estimate = calibrate(session, procedure) if sheets else None
    session.options = given
    joint = session.joint
    return (
        estimate
        if estimate and joint and say_of_sheets(estimate, joint, sheets, session.alike, alone=True)
        else None
    )


def believed(session: Session, procedure: Procedure) -> Procedure:
    """Return the record to calibrate by: where none is named, the protocol's own in the accelerometers' frame.

    Parameters
    ----------
    session, procedure : what was recorded, and what was asked for.
    """
    if procedure.promises or session.protocol is None:
        return procedure
    own = find_procedure(session.protocol.procedure)
    return procedure if own.by_temperature else replace(own, frame=procedure.frame)


def _how_it_matched(session: Session) -> str:
    """Return how much of the protocol was found, where something is missing: it may be another recording's."""
    matching, protocol = session.matching, session.protocol
    if matching is None or protocol is None or not (matching.missing or matching.extra):
        return ""
    found = len({match.step for match in (*matching.holds, *matching.spins)})
    extra = len(matching.extra)
    beside = f", and {extra} holds of the recording are not in it" if extra else ""
    return (
        f" Of the {found + len(matching.missing)} holds and spins of the protocol {protocol.name} {found} were found"
        f"{beside}: if that is not what was done, give another protocol."
    )


def add_remarks(
    session: Session,
    estimate: Estimate,
    procedure: str | None,
    reason: str,
    without_holds: Sequence[str] = (),
) -> None:
    """Say what was wrong with the sensors, and what a user who meant a whole calibration does not get."""
    recording, turns = session.recording, session.timeline.turns
    say_of_recording(estimate, session, without_holds)
    estimate.say("remark", *filter(None, [_of_hidden_jumps(session, estimate)]))
    if procedure is None and session.protocol is not None:
        return
    lost = [turn for turn in turns if not turn.usable]
    for turn in lost[:5]:
        estimate.say(
            "remark",
            f"The turn from hold {turn.before + 1} to hold {turn.after + 1} was not used: {turn.reason}.",
        )
    if len(lost) > 5:
        estimate.say("remark", f"{len(lost) - 5} more turns were not used for such reasons.")
    if procedure is None and recording.angular_rate is not None:
        say_of_turns(estimate, turns, reason)


def _of_hidden_jumps(session: Session, estimate: Estimate) -> str:
    """What is said of an order of poses in which a jump of the accelerometers' biases would not be seen."""
    from tumble.calibration import hidden_jumps

    triad, means = estimate.model.accelerometer, session.means
    if triad is None or means.specific_force is None or estimate.thermal is not None:
        return ""
    force = triad.correct(means.specific_force)
    hidden = hidden_jumps(force / np.linalg.norm(force, axis=1, keepdims=True))
    if not hidden:
        return ""
    when = f"between hold {hidden[0] + 1} and hold {hidden[0] + 2}"
    return (
        f"Had the accelerometers' biases jumped {when}, scale factors and angles would explain it, and nothing would "
        "show it: the opposite of each face before is held after it. Take each axis up and down in turn, or the first "
        "face once more at the end."
    )
