"""Where the two axes of a fixture have to stand for the poses and turns of a protocol."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tumble.arrays import Vector
from tumble.attitude import matrix_from_turn
from tumble.errors import UsageError
from tumble.protocol import (
    SAME_POSE,
    HoldStep,
    Pose,
    Protocol,
    RampStep,
    SoakStep,
    SpinStep,
    Step,
    TurnStep,
    sequence_steps,
)
from tumble.records import dataclass

_QUARTER = 0.5 * np.pi
_Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class FixtureAngles:
    """Where a fixture has to stand for a protocol.

    Attributes
    ----------
    azimuth : rad, of the outer axis, clockwise from north; None where no pose determines it.
    stops : for each step (inner, outer), rad, at its end; of a turn without an axis that of the hold after it.
    """

    azimuth: float | None
    stops: tuple[tuple[float, float], ...]


def fixture_angles(protocol: Protocol) -> FixtureAngles:
    """Return the angles of a two-axis fixture, its inner axis along the unit's z, at every step of a protocol.

    Parameters
    ----------
    protocol : holds with poses, and turns.

    Raises
    ------
    UsageError
        If the fixture cannot be where a pose is, or cannot turn as a step does; the message names it.
    """
    azimuth = _azimuth(protocol)
    stops: list[tuple[float, float]] = []
    here: tuple[float, float] | None = None
    for number, step in enumerate(protocol.steps):
        if isinstance(step, SpinStep):
            raise UsageError(f"{where(number, step)} is a spin, which the two-axis fixture does not make.")
        if isinstance(step, SoakStep | RampStep):
            raise UsageError(f"{where(number, step)} needs a chamber, in which there is no two-axis fixture.")
        if isinstance(step, TurnStep):
            if step.axis_b is None or step.angle is None:
                here = None
                stops.append((np.nan, np.nan))
                continue
            if here is None:
                raise UsageError(
                    f"{where(number, step)} begins where nothing is known: put a hold with a pose before it."
                )
            here = _turned(number, step, here)
        elif number == 0 or here is None or isinstance(protocol.steps[number - 1], HoldStep):
            here = _placed(protocol, number, step, azimuth)
        stops.append(here)
    return FixtureAngles(azimuth, tuple(stops))


def _azimuth(protocol: Protocol) -> float | None:
    """Where the outer axis points: along a rotation that is not about z, or across z and the vertical."""
    starts = [sequence.start for sequence in sequence_steps(protocol)]
    others = [number for number in range(len(protocol.steps)) if number not in starts]
    fallback: float | None = None
    for number in (*starts, *others):
        step = protocol.steps[number]
        if not isinstance(step, HoldStep) or step.pose is None or step.pose.heading is None:
            continue
        axis_b, told = _outer_axis_b(protocol, number, step.pose)
        north, east, _ = step.pose.C_nb() @ axis_b
        if told:
            return float(np.arctan2(east, north))
        fallback = float(np.arctan2(east, north)) if fallback is None else fallback
    return fallback


def _outer_axis_b(protocol: Protocol, number: int, pose: Pose) -> tuple[Vector, bool]:
    """The outer axis in b at a hold, and whether anything told it: else it is along y."""
    turned = np.eye(3)
    for step in _named_turns(protocol, number):
        assert step.axis_b is not None
        assert step.angle is not None
        axis_b = unit(step.axis_b)
        if abs(axis_b[2]) < 1.0 - SAME_POSE:
            return turned @ axis_b, True
        turned = turned @ matrix_from_turn(axis_b, step.angle)
    across = np.cross(_Z, -unit(pose.up_b))
    if np.linalg.norm(across) > SAME_POSE:
        return unit(across), True
    return np.array([0.0, 1.0, 0.0]), False


def _named_turns(protocol: Protocol, number: int) -> Iterator[TurnStep]:
    for step in protocol.steps[number + 1 :]:
        if not isinstance(step, TurnStep) or step.axis_b is None or step.angle is None:
            return
        yield step


def _placed(protocol: Protocol, number: int, step: HoldStep, azimuth: float | None) -> tuple[float, float]:
    """The angles that bring the unit into the pose of a hold."""
    if step.pose is None:
        raise UsageError(f"{where(number, step)} has no pose: say where the fixture shall bring the unit.")
    if step.pose.heading is None or azimuth is None:
        # Whatever the heading is, the outer axis is level and across z.
        outer_b = _outer_axis_b(protocol, number, step.pose)[0]
        inner = float(np.arctan2(outer_b[0], outer_b[1]))
        down_t = matrix_from_turn(_Z, inner) @ -unit(step.pose.up_b)
        outer, off = float(np.arctan2(-down_t[0], down_t[2])), abs(float(down_t[1]))
    else:
        C_tb = matrix_from_turn(_Z, azimuth - _QUARTER).T @ step.pose.C_nb()
        outer = float(np.arctan2(C_tb[0, 2], C_tb[2, 2]))
        inner, off = float(np.arctan2(C_tb[1, 0], C_tb[1, 1])), abs(float(C_tb[1, 2]))
    if off > SAME_POSE:
        raise UsageError(
            f"{where(number, step)}: a fixture with a level outer axis and the unit's z along its "
            "inner axis cannot bring the unit there. z would have to lie "
            f"{np.degrees(np.arcsin(min(off, 1.0))):.1f} degrees off the plane that the inner axis "
            "sweeps."
        )
    return inner, outer


def _turned(number: int, step: TurnStep, here: tuple[float, float]) -> tuple[float, float]:
    """The angles after a named turn."""
    assert step.axis_b is not None
    assert step.angle is not None
    axis_b, (inner, outer) = unit(step.axis_b), here
    if abs(axis_b[2]) > 1.0 - SAME_POSE:
        return inner + float(np.sign(axis_b[2])) * step.angle, outer
    along = float((matrix_from_turn(_Z, inner) @ axis_b)[1])
    if abs(along) < 1.0 - SAME_POSE:
        raise UsageError(
            f"{where(number, step)} turns about an axis of the unit that then lies along neither axis of the "
            "fixture: the inner one is along z, the outer one level and across it."
        )
    return inner, outer + float(np.sign(along)) * step.angle


def where(number: int, step: Step) -> str:
    """Return a step of a protocol as the user knows it."""
    return f"Step {number + 1}" + (f" ({step.name})" if step.name else "")


def unit(vector: Vector | tuple[int, int, int]) -> Vector:
    """Return a vector of length one.

    Parameters
    ----------
    vector : (3,) not zero.
    """
    return np.asarray(vector, dtype=np.float64) / np.linalg.norm(vector)
