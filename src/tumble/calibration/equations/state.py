"""Where a recording's adjustment stands: observations, what is believed, and where every unknown is.

Attitudes are those of b against a level frame w of each section (an unbroken run of holds): down is its third axis,
and its heading is the first hold's own. The Earth rate in w is three unknowns of the section. An attitude error is a
rotation vector in w: ``C_true = (1 + [phi]) C``.
"""

from __future__ import annotations

from dataclasses import field, replace

import numpy as np

from tumble.arrays import AnyArray, Matrices, Series, Vector
from tumble.calibration.equations.observed import Observed
from tumble.earth import Site
from tumble.estimation import Noise, Prior, Unknowns
from tumble.records import dataclass

HEAD, MIDDLE, TAIL = slice(0, 3), slice(3, 6), slice(6, 9)
"""Where a hold's three attitudes stand in its node."""
NODE = 9
EARTH = slice(0, 3)
"""Where a section's Earth rate stands in its border; outside unknowns follow."""
LEAST_SWAY = 1e-16  # rad²: 10 nrad, far below what any unit sees
TAKING_PART = ("force", "rate", "turn", "pose", "angle", "table rate")
"""Kinds of which single observations may be left out; a swing is left out with its rate, a tilt is a pose."""


@dataclass
class Section:
    """The state of one unbroken run of holds.

    Attributes
    ----------
    first, last : half-open range of holds.
    C_wb : (holds, 3, 3, 3) attitudes at the head, in the middle and at the tail of each hold.
    earth_w : (3,) rad/s.
    sees_north : whether its horizontal part is known well enough for its known length to help.
    """

    first: int
    last: int
    C_wb: AnyArray
    earth_w: Vector
    sees_north: bool = False

    @property
    def holds(self) -> np.ndarray:
        """Indices of its holds."""
        return np.arange(self.first, self.last)

    def copy(self) -> Section:
        """Return a state of its own."""
        return replace(self, C_wb=self.C_wb.copy(), earth_w=self.earth_w.copy())


@dataclass
class RotationState:
    """Where a table rotation's own unknowns are.

    Attributes
    ----------
    C_wb : (windows, 3, 3) attitudes at the windows' centres.
    axis_b, axis_w : (3,) unit vectors, the axis in the unit and in the room, along the turn.
    own : lever arm, axis, wander of the accelerometers and of the gyros, see `rotation_equations.Layout`; the axis's
        place in it stays zero, for it is moved itself.
    anchor : (3, 3) the first window's attitude once more, where a rate is believed; else None.
    """

    C_wb: Matrices
    axis_b: Vector
    axis_w: Vector
    own: Series
    anchor: AnyArray | None = None

    def copy(self) -> RotationState:
        """Return a state of its own."""
        return replace(self, C_wb=self.C_wb.copy(), own=self.own.copy())


def rest_noise() -> Noise:
    """Return nothing beyond what is seen at rest."""
    return Noise({"sway": LEAST_SWAY})


@dataclass
class RecordingState:
    """What the equations of one recording are asked at.

    Attributes
    ----------
    data, site : observations, gravity and latitude.
    unknowns : both triads, and what they share with no hold.
    sections : attitudes and Earth rate of each run of holds.
    rotations : of each rotation of a table, by the hold before it.
    noise : what is added to the noise at rest: ``force`` (m/s²)², by which an accelerometer's bias wanders from hold to
        hold; ``rate`` (rad/s)², the same of the gyros; ``turn`` rad² about each axis, what else a turn shows; ``sway``
        rad² about each axis, by which a pose changes from head to middle and from there to the tail; ``placement``
        rad², by which believed poses scatter beyond their own sigma. Factors are of single holds (``sway``) and of a
        rotation's ``windows`` and ``axis``.
    taking_part : kind -> (holds,) of bool, which observations do.
    prior : of all unknowns, or None.
    """

    data: Observed
    site: Site
    unknowns: Unknowns
    sections: list[Section] = field(default_factory=list[Section])
    rotations: dict[int, RotationState] = field(default_factory=dict[int, RotationState])
    noise: Noise = field(default_factory=rest_noise)
    taking_part: dict[str, np.ndarray] = field(default_factory=dict[str, np.ndarray])
    prior: Prior | None = None

    def __post_init__(self) -> None:
        """Let everything take part that was not said to be left out."""
        for kind in TAKING_PART:
            self.taking_part.setdefault(kind, np.ones(self.data.holds, dtype=bool))

    def reads_angle(self, k: int) -> bool:
        """Whether the angle of the rotation after a hold was read, and is believed."""
        return self.data.rotations[k].angle is not None and bool(self.taking_part["angle"][k])


def undetermined(where: str, time: Series, start: int, stop: int) -> str:
    """Return what to say to people where what was recorded does not determine the unit's attitude.

    Parameters
    ----------
    where : in words, as "in hold 3".
    time : (samples,) s.
    start, stop : half-open range of samples.
    """
    first, last = (time[[start, stop - 1]] - time[0]).tolist()
    return (
        f"What was recorded does not determine the unit's attitude {where} ({first:.1f} to {last:.1f} s). Hold the "
        "unit still in each pose and keep the gyro within its range, and record again."
    )
