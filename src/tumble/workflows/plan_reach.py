"""Where poses can be, from what a user says."""

from __future__ import annotations

import difflib
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tumble.errors import UsageError

if TYPE_CHECKING:
    from tumble.design.candidates import AxisRange
    from tumble.design.pose_plan import Reach

REACHES = ("26", "sphere", "two-axis")
"""Names of reaches; anything else is a file of poses."""


def choose_reach(reach: str, outer: str | None = None, inner: str | None = None) -> Reach:
    """Return the poses to choose from.

    Parameters
    ----------
    reach : one of `REACHES`, or a protocol file, whose holds are the poses that a jig knows.
    outer, inner : of a two-axis fixture, MIN,MAX,STEP in degrees; every 45° all round by default.

    Raises
    ------
    UsageError
        If there is no such reach, or an axis is none.
    ProtocolError
        If the file cannot be read.
    """
    from tumble.attitude.directions import twenty_six_directions
    from tumble.design.candidates import sphere_grid, two_axis_poses
    from tumble.design.pose_plan import Reach

    if reach != "two-axis" and (outer is not None or inner is not None):
        raise UsageError(
            "--outer and --inner are the axes of --reach two-axis: give that too, or leave them out."
        )
    if reach == "26":
        return Reach("the 26 directions", twenty_six_directions())
    if reach == "sphere":
        return Reach("the sphere", sphere_grid(), sphere=True)
    if reach == "two-axis":
        directions, angles = two_axis_poses(
            _axis("--outer", outer or "-180,135,45"), _axis("--inner", inner or "0,315,45")
        )
        names = tuple(f"outer {_degrees(first)}, inner {_degrees(second)}" for first, second in angles)
        return Reach("the two-axis fixture", directions, names)
    return _jig(reach)


def _jig(reach: str) -> Reach:
    """The poses of a protocol file's holds."""
    from tumble.design.candidates import ALIKE
    from tumble.design.pose_plan import Reach
    from tumble.protocol import HoldStep, read_protocol

    if not Path(reach).exists() and Path(reach).suffix not in (".yaml", ".yml"):
        near = difflib.get_close_matches(reach.lower(), REACHES, 1)
        meant = f" Did you mean {near[0]}?" if near else ""
        raise UsageError(
            f"--reach {reach}: give {', '.join(REACHES)}, or a protocol file whose holds are the jig's poses.{meant}"
        )
    protocol = read_protocol(reach)
    names: list[str] = []
    directions: list[np.ndarray] = []
    for number, step in enumerate(protocol.steps, 1):
        if not isinstance(step, HoldStep) or step.pose is None:
            continue
        up = step.pose.up_b
        if all(float(up @ other) < math.cos(ALIKE) for other in directions):
            directions.append(up)
            names.append(step.name or f"step {number}")
    if not directions:
        raise UsageError(f"--reach {reach}: none of its holds says what points up (`up:`).")
    return Reach(Path(reach).name, np.array(directions), tuple(names))


def _axis(option: str, text: str) -> AxisRange:
    from tumble.design.candidates import AxisRange

    try:
        numbers = [math.radians(float(part)) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 3:
        raise UsageError(f"{option} {text}: write MIN,MAX,STEP in degrees, for example {option} -90,90,15.")
    return AxisRange(*numbers)


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle) + 0.0:.6g}°"
