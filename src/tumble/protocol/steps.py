"""What is done to a unit: holds, turns and spins, soaks and ramps, one after another, as plain data.

A protocol says what is *known* of the motion and how well. Simulation plays it, segmentation matches a
recording with it, calibration takes from it what it may believe. Frames: n north-east-down, b the
unit's body frame (its axes as the recording's columns name them). Angles are right-handed: positive
is counter-clockwise for someone whom the axis points at.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import Matrix, Vector
from tumble.attitude import matrix_from_rotation_vector, rotation_between, rotation_vector_from_matrix
from tumble.earth import Site
from tumble.records import dataclass

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

UP_N = np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True)
class Pose:
    """What is known of b's attitude during a hold.

    Attributes
    ----------
    up_b : (3,) unit vector in b that points up, against gravity.
    heading : rad, or None if it is not known. From b along north-east-down, the shortest turn brings
        `up_b` up (about the north axis where that is half a turn); then b is turned about the vertical
        by the heading, clockwise seen from above.
    sigma : rad, standard uncertainty of the pose about each axis; zero for an exact table reading.
    """

    up_b: Vector
    heading: float | None = None
    sigma: float = 0.0

    @staticmethod
    def from_matrix(C_nb: Matrix, sigma: float = 0.0) -> Pose:
        """Return the pose of an attitude (3, 3) that is known in full."""
        up_b = UP_N @ C_nb
        about_vertical = rotation_vector_from_matrix(C_nb @ _turn_up(up_b).T)
        return Pose(up_b, float(about_vertical[2]), sigma)

    def C_nb(self, heading: float = 0.0) -> Matrix:
        """Return (3, 3) the nominal attitude; an unknown heading is `heading`, rad."""
        about_vertical = self.heading if self.heading is not None else heading
        return matrix_from_rotation_vector(np.array([0.0, 0.0, about_vertical])) @ _turn_up(self.up_b)

    def rotation_nb(self, heading: float = 0.0) -> Rotation:
        """Return `C_nb` as a rotation of scipy."""
        from scipy.spatial.transform import Rotation

        return Rotation.from_matrix(self.C_nb(heading))


def _turn_up(up_b: Vector) -> Matrix:
    """Return the shortest rotation that brings `up_b` up; about north where it is half a turn."""
    return np.diag([1.0, -1.0, -1.0]) if up_b[2] > 1.0 - 1e-12 else rotation_between(up_b, UP_N)


@dataclass(frozen=True, kw_only=True)
class _Placed:
    """Where a step is in what was recorded: a file, and from where to where on its clock, s; None for anywhere."""

    file: str | None = None
    interval: tuple[float, float] | None = None


@dataclass(frozen=True)
class HoldStep(_Placed):
    """The unit rests.

    Attributes
    ----------
    duration : s.
    pose : what is known of the attitude; None for nothing but that it rests.
    name : as the user calls the step.
    file : the recording of this step alone, if it has one of its own.
    interval : (start, stop) s on the recording's clock, if it is known when the step was.
    """

    duration: float
    pose: Pose | None = None
    name: str = ""


@dataclass(frozen=True)
class TurnStep(_Placed):
    """The unit is brought from one pose to another, it does not matter how fast.

    Attributes
    ----------
    duration : s.
    axis_b : (3,) unit vector in b; None if it is not known.
    angle : rad about `axis_b`, with sign; may exceed a turn. None if it is not known.
    sigma : rad, standard uncertainty of the angle; zero for an exact table reading.
    name, file, interval : as for `HoldStep`.
    """

    duration: float
    axis_b: Vector | None = None
    angle: float | None = None
    sigma: float = 0.0
    name: str = ""


ASSUMED_RATE = 1e-3
"""Share by which a table's rate is taken to be uncertain, one sigma, where nobody says: 0.1 %, as motors hold it that
no crystal times. A laboratory's rate table is ten to a hundred times better, and its data sheet says so."""


@dataclass(frozen=True)
class SpinStep(_Placed):
    """A table turns the unit at a constant rate.

    Attributes
    ----------
    duration : s at the constant rate.
    rate : rad/s against the Earth about the axis, with sign.
    axis_b : (3,) unit vector in b along the table's axis; None for a vertical axis that points up,
        wherever that is in b.
    sigma : standard uncertainty of the rate as a share of it; zero for an exact table, None where nobody says.
    ramp : s that the table takes to come to its rate, and to stop.
    name, file, interval : as for `HoldStep`.
    angle : rad that the table's display says it turned, from the rest before to the rest after, ramps
        included, with the sign of the rate; None if nobody read it. Smaller than what rate and duration
        say where the table stopped early.
    angle_sigma : rad, standard uncertainty of that angle; zero for an exact display.
    """

    duration: float
    rate: float
    axis_b: Vector | None = None
    sigma: float | None = None
    ramp: float = 2.0
    name: str = ""
    angle: float | None = None
    angle_sigma: float = 0.0

    @property
    def period(self) -> float:
        """Seconds a revolution takes."""
        return 2.0 * np.pi / abs(self.rate)

    @property
    def rate_sigma(self) -> float:
        """Standard uncertainty of the rate as a share of it: as stated, or what is assumed of any table."""
        return ASSUMED_RATE if self.sigma is None else self.sigma


@dataclass(frozen=True)
class SoakStep(_Placed):
    """The unit lies as it lies while its surroundings come to a temperature and stay there.

    What follows, up to the next soak or ramp, is done at that temperature.

    Attributes
    ----------
    duration : s, from when the former temperature is left until the next step begins.
    temperature_celsius : of a chamber, a fridge or a room.
    tolerance : K, within which of it the unit has to be for the soak to count as done.
    name, file, interval : as for `HoldStep`.
    """

    duration: float
    temperature_celsius: float
    tolerance: float = 1.0
    name: str = ""


@dataclass(frozen=True)
class RampStep(_Placed):
    """The temperature of the surroundings goes slowly from one to another.

    Attributes
    ----------
    duration : s, from the one temperature to the other.
    start_celsius, stop_celsius : of a chamber.
    tumbled : s, so often the unit is turned to another pose meanwhile; zero for a unit at rest in the pose
        of the hold before.
    name, file, interval : as for `HoldStep`.
    """

    duration: float
    start_celsius: float
    stop_celsius: float
    tumbled: float = 0.0
    name: str = ""

    @property
    def rate(self) -> float:
        """How fast it goes, K/s, with sign."""
        return (self.stop_celsius - self.start_celsius) / self.duration


Step = HoldStep | TurnStep | SpinStep | SoakStep | RampStep


@dataclass(frozen=True)
class Protocol:
    """The steps of a test in order, and what else its evaluation needs.

    Between two holds without a turn the unit is turned somehow. Before and after a spin the table
    stands still.

    Attributes
    ----------
    name : such as ``multi-position-26``.
    procedure : the procedure that evaluates it, by name.
    steps : in order.
    site : where it is performed; None in the library, where nobody has said yet.
    description : one or two sentences for people.
    recordings : the files that were recorded, in order, relative to the protocol's own folder.
    units, columns : of those files, as the command line's options of that name take them.
    rate : Hz, of files without stamps.
    """

    name: str
    procedure: str
    steps: tuple[Step, ...]
    site: Site | None = None
    description: str = ""
    recordings: tuple[str, ...] = ()
    units: str | None = None
    columns: str | None = None
    rate: float | None = None

    @property
    def duration(self) -> float:
        """Seconds of all steps together, ramps included."""
        return sum(s.duration + (2.0 * s.ramp if isinstance(s, SpinStep) else 0.0) for s in self.steps)
