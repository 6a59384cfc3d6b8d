"""Tumbled by hand: rests in many poses, and turns between them that the gyros follow.

Nothing is believed but gravity: the accelerometers see it in each hold, and the gyros carry it over each turn.
"""

from __future__ import annotations

from tumble.calibration.procedure import Procedure, Suits
from tumble.calibration.session import Session

SMALLEST_TURNS = 5
"""Fewer turns between holds than this do not determine a gyro."""


def _suits(session: Session) -> Suits:
    recording, timeline = session.recording, session.timeline
    if recording.specific_force is None or recording.angular_rate is None:
        return Suits(False, "the recording has one triad only")
    turns = sum(turn.usable for turn in timeline.turns)
    if turns < SMALLEST_TURNS:
        return Suits(
            False,
            f"{turns} turns between holds can be used, and the hand-held procedure needs {SMALLEST_TURNS}",
        )
    return Suits(True, f"{len(timeline.holds)} holds and {turns} turns suffice")


PROCEDURE = Procedure(
    "hand-held",
    "accelerometer-x",
    "nothing but hands",
    "both triads, nine or more poses, five or more turns between them that can be integrated",
    "everything: both triads in full, the rotation between them, g-sensitivity of the gyros if the data want it",
    "hand-held.md",
    promises=("accelerometers", "gyros"),
    suits=_suits,
    otherwise="multi-position",
)
