"""The named protocols: the field's tests, step by step, without a site.

What is known of the poses is what the classical test asks for: a six-position test levels its faces, a
multi-position test only wants the poses to differ.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from tumble.arrays import Vector
from tumble.attitude import twenty_six_directions
from tumble.errors import ProtocolError
from tumble.protocol.steps import HoldStep, Pose, Protocol, RampStep, SoakStep, SpinStep, Step, TurnStep
from tumble.protocol.strapdown_rotation import strapdown_rotation_steps
from tumble.units import DEGREE

# A cube's face on a levelled plate; and a box that a hand props up on an edge.
LEVELLED, BY_HAND = 0.5 * DEGREE, 5.0 * DEGREE
HOLD, TURN = 30.0, 3.0  # s
# Ten thousand times the Earth's rate, which is what the thesis (4.4.1) finds to be enough.
TABLE_RATE = 1e4 * 7.292115e-5  # rad/s
RATES = tuple(rate * DEGREE for rate in (10.0, 50.0, 100.0, 200.0))
# Whole revolutions at every rate: 36 s at 10°/s, and at least 18 s.
LEAST_SPIN = 18.0
# An arc-second-grade table, and the time that it rests and turns (Zhang et al. 2010, section 5).
TABLE_SIGMA = 2.0 * DEGREE / 3600.0
TABLE_HOLD, TABLE_REST = 100.0, 20.0  # s
TABLE_TURN, TABLE_SPEED, TABLE_RAMP = 10.0 * np.pi, 10.0 * DEGREE, 2.0  # five turns; rad/s; s
# The axes of the unit, and one edge in each plane, each with a direction across it to point up.
TABLE_AXES = (
    ((1, 0, 0), (0, 0, 1)),
    ((0, 1, 0), (1, 0, 0)),
    ((0, 0, 1), (0, 1, 0)),
    ((1, 1, 0), (0, 0, 1)),
    ((1, 0, 1), (0, 1, 0)),
    ((0, 1, 1), (1, 0, 0)),
)
# Faces, and one edge in each coordinate plane: the nine directions make nine unknowns observable.
NINE = (0, 1, 2, 3, 4, 5, 6, 7, 10)


def _direction_name(up_b: Vector) -> str:
    parts = "".join(
        f"{'+' if v > 0 else '-'}{axis}" for v, axis in zip(up_b, "xyz", strict=True) if abs(v) > 1e-9
    )
    count = len(parts) // 2
    if count == 1:
        return f"{parts[1]} {'up' if parts[0] == '+' else 'down'}"
    return f"{'edge' if count == 2 else 'corner'} {parts} up"


def _holds(directions: np.ndarray, sigma: float) -> tuple[Step, ...]:
    steps: list[Step] = []
    for up_b in directions:
        if steps:
            steps.append(TurnStep(TURN))
        steps.append(HoldStep(HOLD, Pose(up_b, None, sigma), _direction_name(up_b)))
    return tuple(steps)


def _multi_position(count: int) -> tuple[Step, ...]:
    chosen = np.array(NINE) if count == 9 else np.arange(count)
    return _holds(twenty_six_directions()[chosen], BY_HAND)


def _hand_held() -> tuple[Step, ...]:
    steps = list(_holds(twenty_six_directions(), BY_HAND))
    return tuple(HoldStep(4.0, s.pose, s.name) if isinstance(s, HoldStep) else TurnStep(2.0) for s in steps)


def _spin(rate: float, name: str) -> SpinStep:
    period = 2.0 * np.pi / abs(rate)
    way = "counter-clockwise" if rate > 0 else "clockwise"
    return SpinStep(float(np.ceil(LEAST_SPIN / period - 1e-9) * period), rate, name=f"{name}, {way}")


def _spun(directions: np.ndarray, rates: tuple[float, ...], sigma: float, hold: float) -> tuple[Step, ...]:
    """Each pose on the table, at rest before every spin and after the last."""
    steps: list[Step] = []
    for up_b in directions:
        name = _direction_name(up_b)
        if steps:
            steps.append(TurnStep(TURN))
        for rate in rates:
            steps.append(HoldStep(hold, Pose(up_b, None, sigma), name))
            steps.append(_spin(rate, f"{name}, {abs(rate) / DEGREE:.4g}°/s"))
        steps.append(HoldStep(hold, Pose(up_b, None, sigma), name))
    return tuple(steps)


def _rate_table() -> tuple[Step, ...]:
    both = tuple(sign * rate for rate in RATES for sign in (1.0, -1.0))
    return _spun(twenty_six_directions()[[0, 1, 2, 3, 4, 5]], both, LEVELLED, 10.0)


def _modified_multi_position() -> tuple[Step, ...]:
    chosen = [*range(6), 6, 8, 10, 12, 14, 17]
    return _spun(twenty_six_directions()[chosen], (-TABLE_RATE, TABLE_RATE), BY_HAND, HOLD)


# Five temperatures, three of them come to from below and from above; and a slow sweep between the outer two.
SOAKS = (20.0, 0.0, -20.0, 0.0, 20.0, 40.0, 60.0, 40.0, 20.0)  # °C
SOAK, SWEEP = 1800.0, 0.5 / 60.0  # s, K/s
FRIDGE, ROOM = 4.0, 22.0  # °C


def _thermal_soak() -> tuple[Step, ...]:
    poses = _holds(twenty_six_directions()[list(NINE)], BY_HAND)
    steps: list[Step] = []
    for celsius in SOAKS:
        steps.append(SoakStep(SOAK, celsius, name=f"{celsius:g} °C"))
        steps += [TurnStep(TURN), *poses]
    return tuple(steps[:1] + steps[2:])


def _thermal_ramp(tumbled: float) -> tuple[Step, ...]:
    low, high = min(SOAKS), max(SOAKS)
    seconds = (high - low) / SWEEP
    return (
        HoldStep(HOLD, Pose(np.array([0.0, 0.0, 1.0]), None, LEVELLED), "z up"),
        SoakStep(SOAK, low, name="cold"),
        RampStep(seconds, low, high, tumbled, "up"),
        SoakStep(SOAK, high, name="hot"),
        RampStep(seconds, high, low, tumbled, "down"),
    )


def _thermal_fridge() -> tuple[Step, ...]:
    # Carried from one pose to another: that it was moved is then seen, and no small tilt taken for a bias.
    x_up, z_up = (Pose(twenty_six_directions()[k], None, BY_HAND) for k in (0, 2))
    return (
        HoldStep(HOLD, x_up, "x up"),
        SoakStep(300.0, FRIDGE, name="in the fridge, cold all through"),
        TurnStep(10.0),
        HoldStep(HOLD, z_up, "z up"),
        SoakStep(5400.0, ROOM, name="on the table"),
    )


def _unit(direction: tuple[int, int, int]) -> Vector:
    vector = np.array(direction, dtype=float)
    return vector / np.linalg.norm(vector)


def _both_ways(axis_b: Vector, pose: Pose, name: str) -> tuple[Step, ...]:
    """Five turns of the table counter-clockwise, five back, at rest before, between and after."""
    # A ramp turns half of what the same time at the rate does, and there are two.
    duration = TABLE_TURN / TABLE_SPEED - TABLE_RAMP
    rest = HoldStep(TABLE_REST, pose, f"{name}, at rest")
    spins = tuple(
        SpinStep(
            duration,
            sign * TABLE_SPEED,
            axis_b,
            ramp=TABLE_RAMP,
            name=f"{name}, {'counter-clockwise' if sign > 0 else 'clockwise'}",
            angle=sign * TABLE_TURN,
            angle_sigma=TABLE_SIGMA,
        )
        for sign in (1.0, -1.0)
    )
    return (TurnStep(TURN), rest, spins[0], rest, spins[1], rest)


def _turntable(chosen: tuple[int, ...]) -> tuple[Step, ...]:
    steps = [
        replace(s, duration=TABLE_HOLD) if isinstance(s, HoldStep) else s
        for s in _holds(twenty_six_directions()[list(chosen)], BY_HAND)
    ]
    for axis, up in TABLE_AXES:
        axis_b = _unit(axis)
        name = f"about {_direction_name(axis_b).removesuffix(' up')}"
        steps.extend(_both_ways(axis_b, Pose(_unit(up), None, BY_HAND), name))
    return tuple(steps)


def _laboratory_pose(axis: int, sign: float, quarter: int) -> Pose:
    """Return the pose with an axis up or down and the next one north, west, south or east."""
    forward = (axis + 1) % 3
    C_nb = np.zeros((3, 3))
    C_nb[:, axis] = [0.0, 0.0, -sign]
    C_nb[:, forward] = [[1, 0, 0], [0, -1, 0], [-1, 0, 0], [0, 1, 0]][quarter]
    C_nb[:, (axis + 2) % 3] = np.cross(C_nb[:, axis], C_nb[:, forward])
    pose = Pose.from_matrix(C_nb, TABLE_SIGMA)
    # Whole quarters of a turn, to the last digit.
    heading = round((pose.heading or 0.0) / (np.pi / 2)) * (np.pi / 2)
    return Pose(np.round(pose.up_b) + 0.0, heading, TABLE_SIGMA)


def _laboratory() -> tuple[Step, ...]:
    steps: list[Step] = []
    for axis in range(3):
        for sign, way in ((1.0, "up"), (-1.0, "down")):
            for quarter, where in enumerate(("north", "west", "south", "east")):
                name = f"{'xyz'[axis]} {way}, {'xyz'[(axis + 1) % 3]} {where}"
                steps += [TurnStep(TURN)] if steps else []
                steps.append(HoldStep(TABLE_HOLD, _laboratory_pose(axis, sign, quarter), name))
    # About the vertical: the table bears the unit's weight along its axis and turns evenly, gravity does not
    # alternate in the gyros, and nothing but the table is needed, because no accelerometer is asked.
    for axis in range(3):
        pose = _laboratory_pose(axis, 1.0, 0)
        steps.extend(_both_ways(pose.up_b, pose, f"about {'xyz'[axis]}"))
    return tuple(steps)


_STEPS: dict[str, Callable[[], tuple[Step, ...]]] = {
    "six-position": lambda: _holds(twenty_six_directions()[:6], LEVELLED),
    "multi-position-26": lambda: _multi_position(26),
    "multi-position-18": lambda: _multi_position(18),
    "multi-position-10": lambda: _multi_position(10),
    "multi-position-9": lambda: _multi_position(9),
    "rate-table": _rate_table,
    "modified-multi-position": _modified_multi_position,
    "turntable-9": lambda: _turntable(NINE),
    "turntable-18": lambda: _turntable(tuple(range(18))),
    "laboratory": _laboratory,
    "strapdown-rotation": strapdown_rotation_steps,
    "thermal-soak": _thermal_soak,
    "thermal-ramp": lambda: _thermal_ramp(0.0),
    "thermal-ramp-tumbled": lambda: _thermal_ramp(60.0),
    "thermal-fridge": _thermal_fridge,
    "hand-held": _hand_held,
}
# Their procedures and what they are for, which is shown where no YAML is read.
_SAID = json.loads(Path(__file__).with_name("library.json").read_text(encoding="utf-8"))

PROTOCOLS: dict[str, str] = {name: _SAID[name]["description"] for name in _STEPS}
"""What each named protocol is for, in a sentence."""

REST = "rest"
"""Name of the protocol that is no calibration's: a unit that lies still, for its noise."""


def rest_protocol(duration: float) -> Protocol:
    """Return one hold of a duration in s, z up.

    Parameters
    ----------
    duration : s.
    """
    hold = HoldStep(duration, Pose(np.array([0.0, 0.0, 1.0]), None, BY_HAND), "z up")
    return Protocol(REST, "multi-position", (hold,), description="At rest, for the noise of every channel.")


def named_protocol(name: str) -> Protocol:
    """Return the protocol of that name, without a site.

    Parameters
    ----------
    name : one of `PROTOCOLS`.

    Raises
    ------
    ProtocolError
        If there is none; the message lists those that there are.
    """
    if name not in _STEPS:
        raise ProtocolError(f"There is no protocol {name!r}: choose one of {', '.join(PROTOCOLS)}.")
    return Protocol(name, _SAID[name]["procedure"], _STEPS[name](), description=PROTOCOLS[name])
