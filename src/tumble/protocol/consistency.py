"""Whether the turns that a protocol names lead from pose to pose as it says."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Matrix
from tumble.attitude import matrix_from_turn, rotation_angle
from tumble.errors import ProtocolError
from tumble.protocol.steps import HoldStep, Pose, Protocol, RampStep, SoakStep, SpinStep, Step

# What poses and turns contradict one another by, beyond their uncertainties: digits of a file, rad.
SAME_POSE = 1e-3
# So many sigmas a turn may miss the pose that it is said to lead to.
CONTRADICTION = 5.0


def refuse_contradicting_turns(protocol: Protocol) -> None:
    """Refuse a protocol in which a turn does not lead to the pose of the hold after it.

    Checked is every hold with a pose that named turns alone, with axis and angle, join to an earlier
    one. Where a heading is not known, or not since the unit was last placed, only what is up is compared.
    Where a spin leaves the unit nobody knows before it was done.

    Parameters
    ----------
    protocol : what was to be done.

    Raises
    ------
    ProtocolError
        Naming the step of the hold, and those of the turns.
    """
    nominal: Matrix | None = None
    headed, doubt = False, 0.0
    turns: list[int] = []
    before: Step | None = None
    for number, step in enumerate(protocol.steps):
        if isinstance(step, HoldStep):
            if before is None or isinstance(before, HoldStep):
                nominal = None  # brought there somehow
            if step.pose is not None:
                if nominal is not None:
                    sought = step.pose if headed else Pose(step.pose.up_b)
                    wanted = sought.C_nb(nearest_heading(sought, nominal))
                    refuse_contradiction(protocol, number, turns, nominal, wanted, doubt, step.pose.sigma)
                headed = step.pose.heading is not None or (headed and nominal is not None)
                heading = 0.0 if nominal is None else nearest_heading(step.pose, nominal)
                nominal, doubt, turns = step.pose.C_nb(heading), 0.0, []
        elif isinstance(step, SoakStep) or (isinstance(step, RampStep) and not step.tumbled):
            continue
        elif isinstance(step, SpinStep | RampStep) or step.axis_b is None or step.angle is None:
            nominal = None
        elif nominal is not None:
            nominal = nominal @ matrix_from_turn(step.axis_b, step.angle)
            doubt = float(np.hypot(doubt, step.sigma))
            turns.append(number)
        before = step


def refuse_contradiction(
    protocol: Protocol,
    number: int,
    turns: list[int],
    nominal: Matrix,
    wanted: Matrix,
    doubt: float,
    sigma: float,
) -> None:
    """Refuse a hold that is not where the turns before it lead.

    Parameters
    ----------
    protocol, number, turns : the hold's step and those of the turns, from 0.
    nominal, wanted : (3, 3) attitudes to which the turns lead, and which the hold names.
    doubt, sigma : rad, standard uncertainties of the turns together and of the hold's pose.

    Raises
    ------
    ProtocolError
        If they are further apart than five standard uncertainties.
    """
    away = rotation_angle(nominal.T @ wanted)
    if away <= CONTRADICTION * np.hypot(doubt, sigma) + SAME_POSE:
        return
    before = ", ".join(str(turn + 1) for turn in turns)
    where = "the turns before it lead"
    if turns:
        where = f"the turn of step {before} leads" if len(turns) == 1 else f"the turns of steps {before} lead"
    raise ProtocolError(
        f"The protocol {protocol.name} contradicts itself: step {number + 1}{_named(protocol.steps[number])} is a "
        f"hold in a pose {np.degrees(away):.1f} degrees away from where {where}. Put right the pose, or the axis, "
        "angle or sign of the turn."
    )


def nearest_heading(pose: Pose, C_nb: Matrix) -> float:
    """Return the heading with which a pose comes nearest to an attitude; its own, where it has one.

    Parameters
    ----------
    pose : with or without a heading.
    C_nb : (3, 3) one attitude.
    """
    if pose.heading is not None:
        return pose.heading
    turn = C_nb @ pose.C_nb().T
    return float(np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1]))


def _named(step: Step) -> str:
    return f" ({step.name})" if step.name else ""
