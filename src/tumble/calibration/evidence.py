"""What an estimate rests on, for those who look at it: one record a kind, and the report has one renderer a kind.

Evidence that grows in another room stands there: `ThermalCurves` in `thermal`, `TurnOns` in `turn_ons`, and `Beside`,
an estimate in itself, next to `Estimate`.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np

from tumble.arrays import Series, Vectors
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
