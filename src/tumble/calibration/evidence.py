"""What an estimate rests on, for those who look at it: one record a kind, and the report has one renderer a kind.

Evidence that grows in another room stands there: `ThermalCurves` in `thermal`, `TurnOns` in `turn_ons`, and `Beside`,
an estimate in itself, next to `Estimate`.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np

from tumble.arrays import Series, Vector, Vectors
from tumble.calibration.checks.uncertainty_statement import UncertaintyStatement
from tumble.records import dataclass


class Evidence:
    """A kind of evidence: at most one record of each kind stands in an estimate."""

    __slots__ = ()


def _nothing() -> Series:
    return np.zeros(0)


@dataclass(frozen=True, slots=True)
class RestlessHold:
    """A hold that sways more than the others.

    Attributes
    ----------
    hold : its index.
    start, stop : s from the recording's first sample.
    sway, others : rad about each axis, one sigma, from its start to its middle and from there to its end: its own,
        and what the others sway by.
    """

    hold: int
    start: float
    stop: float
    sway: float
    others: float


@dataclass(frozen=True, slots=True)
class Holds(Evidence):
    """How well the corrected specific force of each hold has the norm of gravity.

    Attributes
    ----------
    norms : (holds,) corrected norm minus gravity, m/s².
    sigmas : (holds,) what it is expected to be (root mean square), m/s².
    restless : holds that sway more than the others, and count for less.
    """

    norms: Series = field(default_factory=_nothing)
    sigmas: Series = field(default_factory=_nothing)
    restless: tuple[RestlessHold, ...] = ()


@dataclass(frozen=True, slots=True)
class Turns(Evidence):
    """How well the corrected gyros carry gravity over the turn after each hold.

    Attributes
    ----------
    angles : (holds,) rad, from where gravity is carried to where it is seen; NaN where no turn follows.
    sigmas : (holds,) rad, what the angle is expected to be.
    sizes : (holds,) rad, how far the turn went.
    """

    angles: Series = field(default_factory=_nothing)
    sigmas: Series = field(default_factory=_nothing)
    sizes: Series = field(default_factory=_nothing)

    @property
    def found(self) -> Series:
        """The angles of the turns that there are, rad."""
        return self.angles[np.isfinite(self.angles)]


@dataclass(frozen=True, slots=True)
class Spins(Evidence):
    """How well the corrected gyros show the rates of a table.

    Attributes
    ----------
    rates : (spins,) rad/s, the reference rate of each spin with its sign.
    residuals, sigmas : (spins, 3) rad/s, what each gyro shows beyond the model, and its sigma.
    names : what each spin is, in words.
    """

    rates: Series = field(default_factory=_nothing)
    residuals: Vectors = field(default_factory=lambda: np.zeros((0, 3)))
    sigmas: Vectors = field(default_factory=lambda: np.zeros((0, 3)))
    names: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class TurnedAngle:
    """One rotation of a table: its display's angle, and what the calibrated gyros made of it.

    Attributes
    ----------
    spin : index into the estimate's spins.
    angle : rad, the table's, with its sign.
    residual, sigma : rad, gyros minus table about the common axis, and its standard deviation.
    seconds : s that it took.
    from_rest : whether it is from rest to rest; if not, at the constant rate.
    """

    spin: int
    angle: float
    residual: float
    sigma: float
    seconds: float
    from_rest: bool


@dataclass(frozen=True, slots=True)
class RotationFit:
    """Rotations both ways about one axis, as both triads saw it.

    Attributes
    ----------
    name : the axis in words.
    axis_b : (3,) unit vector in b, as the calibrated gyros show it.
    inclination : rad, of the axis against the vertical, 0 to pi / 2.
    missed, missed_sigma : rad, angle between the axes of both triads after calibration, and the standard
        deviation of each of its two components; NaN where the accelerometers do not tell it.
    plane_residual : m/s², rms distance of the specific forces from their plane.
    angles : of each rotation.
    why : why it takes no part in the inter-triad angles; empty if it does.
    """

    name: str
    axis_b: Vector
    inclination: float
    missed: float
    missed_sigma: float
    plane_residual: float
    angles: tuple[TurnedAngle, ...]
    why: str = ""


@dataclass(frozen=True, slots=True)
class Rotations(Evidence):
    """What a table's rotations showed, an axis each.

    Attributes
    ----------
    fits : of each axis.
    """

    fits: tuple[RotationFit, ...]


@dataclass(frozen=True, slots=True)
class SequenceFit:
    """A rotation sequence and what the solution leaves of its measurements.

    Attributes
    ----------
    name : as table 1 has it, or the protocol.
    rotations : (axis, angle in rad) one after another.
    residuals, sigmas : (4,) m/s²: two horizontal components, down at the start and at the end.
    seconds : s that it took, measurements included.
    """

    name: str
    rotations: tuple[tuple[int, float], ...]
    residuals: tuple[float, ...]
    sigmas: tuple[float, ...]
    seconds: float


@dataclass(frozen=True, slots=True)
class Sequences(Evidence):
    """What rotation sequences showed.

    Attributes
    ----------
    fits : of each sequence.
    passes : what each play-back of the recording changed, rms by group of errors, SI.
    """

    fits: tuple[SequenceFit, ...]
    passes: tuple[dict[str, float], ...]


@dataclass(slots=True)
class Budget(Evidence):
    """Where the standard uncertainties come from.

    Attributes
    ----------
    shares : what each source adds to the standard uncertainties of an estimate's parameters, in their order and units.
    statement : tests, degrees of freedom, reliability and what is not included, where the procedure has them.
    """

    shares: dict[str, Series]
    statement: UncertaintyStatement | None = None
