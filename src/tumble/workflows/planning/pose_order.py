"""What a search of poses is asked for: where poses can be, and what all that is for the design."""

from __future__ import annotations

import difflib
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.earth import Site
from tumble.errors import UsageError
from tumble.records import dataclass
from tumble.workflows.planning.plan import check_seed

if TYPE_CHECKING:
    from tumble.design.candidates import AxisRange
    from tumble.design.pose_plan import PoseTask, Reach
    from tumble.simulation import Grade


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


LEVELLED = math.radians(0.5)
"""One sigma to which faces on a plate are levelled."""
# Seconds of a pose and of a turn, and the fewest poses that are planned without being asked.
DEFAULTS = {"multi-position": (30.0, 3.0, 9), "hand-held": (4.0, 2.0, 26), "six-position": (30.0, 3.0, 6)}
MOST_POSES = 200


@dataclass(frozen=True, slots=True)
class PoseOrder:
    """What a search of poses is asked for.

    Attributes
    ----------
    procedure : one of `tumble.workflows.planning.plan.SEARCHED`.
    imu : grade of the unit.
    data_sheet : a grade whose spreads are believed beforehand, as `calibrate --data-sheet` does.
    poses, minutes : how many poses of `hold` seconds each, or how long the whole test may last with as many poses and
        dwells as is best; by default nine poses.
    hold, turn : s of a pose, and of the turn to the next.
    criterion : one of `tumble.design.criteria.CRITERIA`.
    wanted : parameters that matter, by group or name, with commas; None for all.
    reach : "26", "sphere", "two-axis" or a file of poses.
    outer, inner : of "two-axis", MIN,MAX,STEP in degrees.
    given : a calibration, or a recording of this unit, that is there already.
    targets : wished-for standard uncertainties, as "bias=50,scale=100,misalignment=20" in µg, ppm and arc-seconds.
    site : gravity; latitude 45° by default.
    seed : of the search's starts.
    rate : of the samples of a hand-held test with its standard uncertainty, as for `plan_any_protocol`.
    """

    procedure: str
    imu: str = "consumer-mems"
    data_sheet: str | None = None
    poses: int | None = None
    minutes: float | None = None
    hold: float | None = None
    turn: float | None = None
    criterion: str = "A"
    wanted: str | None = None
    reach: str = "26"
    outer: str | None = None
    inner: str | None = None
    given: str | os.PathLike[str] | None = None
    targets: str | None = None
    site: Site | None = None
    seed: int = 0
    rate: str | None = None

    @property
    def usual(self) -> tuple[float, float, int]:
        """Seconds of a pose and of a turn, and the fewest poses, where nobody says."""
        return DEFAULTS[self.procedure]

    @property
    def is_six_position(self) -> bool:
        """Whether faces are levelled and believed."""
        return self.procedure == "six-position"

    @property
    def dwell(self) -> float:
        """Seconds of a pose, where the time of the test does not say."""
        return self.hold or self.usual[0]

    def check(self) -> None:
        """Refuse numbers that contradict one another or that no test has.

        Raises
        ------
        UsageError
            If there is one.
        """
        if self.poses is not None and self.minutes is not None:
            raise UsageError(
                "--poses and --time: give the number of poses or the time of the whole test, not both."
            )
        if self.minutes is not None and self.hold is not None:
            raise UsageError(
                "--hold and --time: with the time of the whole test the dwells follow; leave --hold out."
            )
        if self.poses is not None and not 1 <= self.poses <= MOST_POSES:
            raise UsageError(f"--poses {self.poses}: give 1 to {MOST_POSES}.")
        if self.minutes is not None and not 0.0 < self.minutes <= 10_000.0:
            raise UsageError(f"--time {self.minutes:g}: give minutes of the whole test, up to 10000.")
        if self.hold is not None and not 1.0 <= self.hold <= 100_000.0:
            raise UsageError(f"--hold {self.hold:g}: give 1 to 100000 seconds of rest in each pose.")
        if self.turn is not None and not 0.5 <= self.turn <= 3600.0:
            raise UsageError(
                f"--turn-seconds {self.turn:g}: give 0.5 to 3600 seconds from one pose to the next."
            )
        check_seed(self.seed)


def pose_task(order: PoseOrder, grade: Grade, place: Site) -> PoseTask:
    """Return the design's task.

    Parameters
    ----------
    order, grade, place : what is asked, of which unit, where.

    Raises
    ------
    UsageError
        If an option is none that a test has.
    """
    from tumble.design.pose_plan import PoseTask

    return PoseTask(
        grade.accelerometer.noise,
        _criterion(order.procedure, order.criterion, order.wanted),
        grade.rate,
        order.usual[1] if order.turn is None else order.turn,
        place.gravity,
        _sheet(order.data_sheet, place.gravity),
        *_placed(order, grade),
    )


def _criterion(procedure: str, name: str, wanted: str | None) -> Any:
    from tumble.design.candidates import GROUPS, PARAMETERS
    from tumble.design.criteria import CRITERIA
    from tumble.design.pose_plan import criterion_of

    known = {one.lower(): one for one in CRITERIA}
    if name.lower() not in known:
        raise UsageError(f"--criterion {name}: choose one of {', '.join(CRITERIA)}.")
    chosen: list[int] = []
    for part in (wanted or "").split(","):
        word = " ".join(part.split())
        if not word:
            continue
        if word in GROUPS:
            chosen += GROUPS[word]
        elif word in PARAMETERS:
            chosen.append(PARAMETERS.index(word))
        else:
            raise UsageError(
                f"--for {word}: choose of scale, misalignment, bias, or one of them such as {PARAMETERS[0]!r}, "
                f"{PARAMETERS[3]!r}, {PARAMETERS[6]!r}, with commas between them."
            )
    if procedure == "six-position":
        levelled = [*GROUPS["scale"], *GROUPS["bias"]]
        if set(chosen) - set(levelled):
            raise UsageError(
                "--for misalignment: a six-position test determines scale factors and biases alone."
            )
        chosen = chosen or levelled
    return criterion_of(known[name.lower()], np.array(sorted(set(chosen))) if chosen else None)


def _sheet(name: str | None, gravity: float) -> Any:
    """The information of a data sheet's spreads."""
    if name is None:
        return None
    from tumble.calibration.prior import prior_of_sheet
    from tumble.workflows.given.data_sheet import find_sheet

    prior = prior_of_sheet(find_sheet(name), "accelerometer", "m/s^2")
    if prior is None:
        return None
    # Biases come last here, and in units of gravity.
    order, scale = np.array([3, 4, 5, 6, 7, 8, 0, 1, 2]), np.repeat([1.0, gravity], [6, 3])
    return prior.precision[np.ix_(order, order)] * np.outer(scale, scale)


def _placed(order: PoseOrder, grade: Grade) -> tuple[float, float]:
    """What levelling adds to a face's own reading (its square, and its product with misalignment), and its mean."""
    if not order.is_six_position:
        return 0.0, 0.0
    own = math.sqrt(2.0) * LEVELLED * grade.accelerometer.misalignment
    return math.hypot(LEVELLED**2, own), LEVELLED**2
