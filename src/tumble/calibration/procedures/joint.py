"""The joint estimator on whatever was recorded, from the start that the recording's own procedure gives."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from tumble.calibration.procedure import Procedure, find_procedure
from tumble.errors import ConvergenceError, ObservabilityError

if TYPE_CHECKING:
    from tumble.calibration.estimate import Estimate
    from tumble.calibration.outcome.estimate import JointOutcome
    from tumble.calibration.session import Session


def run_joint(
    session: Session,
    start: Estimate | None = None,
    *,
    frame: str = "accelerometer-x",
    partly: bool = True,
    keep: Callable[[JointOutcome], None] | None = None,
    clocked: bool = True,
) -> Estimate:
    """Adjust everything at once, from the start that the recording's own procedure gives.

    Parameters
    ----------
    session : what is known of the recording.
    start : another procedure's estimate; None runs the recording's own first.
    frame, partly : see `calibrate_joint`.
    keep : is handed the settled solution, see `calibrate_joint`.
    clocked : adjust what clock and table may be off by; else whoever goes on from the solution states it.
    """
    from tumble.calibration.checks.unseen import unseen_table
    from tumble.calibration.joint import calibrate_joint

    table = None if session.protocol is None else unseen_table(session.protocol)
    alike = {"clock": session.clock.sigma, "table_rate": 0.0 if table is None else table.sigma}
    first = _start(session) if start is None else start

    def kept(outcome: JointOutcome) -> None:
        session.joint = outcome
        if keep is not None:
            keep(outcome)

    matching, has_gyro = session.matching, session.recording.angular_rate is not None
    return calibrate_joint(
        session.recording,
        session.timeline,
        session.means,
        session.site,
        first,
        rotations=session.rotations if matching is not None and matching.spins and has_gyro else [],
        poses=session.believed_poses,
        frame=frame,
        partly=partly,
        prior=session.prior,
        alike=alike if clocked else None,
        optional_terms=session.options.optional_terms,
        sought=frozenset() if session.protocol is None else find_procedure(session.protocol.procedure).seeks,
        progress=session.say,
        keep=kept,
    )


def _start(session: Session) -> Estimate | None:
    """The protocol's own procedure if it tells something, else the hand-held one; None where neither does."""
    own = None if session.protocol is None else find_procedure(session.protocol.procedure)
    if own is None or not own.starts_joint:
        own = find_procedure("hand-held")
    try:
        return own.run(session)
    except (ObservabilityError, ConvergenceError):
        return None


PROCEDURE = Procedure(
    "joint",
    run_joint,
    "accelerometer-x",
    "any of these",
    "what the procedure needs that the recording was made for",
    "the same from one adjustment of everything that was recorded, with a budget of uncertainty",
    "../joint.md",
    takes=frozenset({"prior"}),
    starts_joint=False,
)
