"""What a test knows to be there, for whoever checks types."""

from typing import TypeVar

from tumble.arrays import AnyArray
from tumble.recording import Recording

Thing = TypeVar("Thing")


def given(thing: Thing | None) -> Thing:
    assert thing is not None
    return thing


def signals(recording: Recording) -> tuple[AnyArray, AnyArray]:
    """Specific force and angular rate of a recording that has both."""
    return given(recording.specific_force), given(recording.angular_rate)
