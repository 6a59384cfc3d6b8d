"""A joint adjustment that has settled, with everything behind it: estimates, budgets and objections are made of it."""

from __future__ import annotations

from dataclasses import field

from tumble.arrays import Series
from tumble.calibration.checks.suspicions import BiasCourse
from tumble.calibration.equations.adjustment import JointAdjustment
from tumble.calibration.equations.observed import Observed
from tumble.calibration.estimate import TermTest
from tumble.calibration.prior import StableKnowledge, Untold
from tumble.earth import Site
from tumble.estimation import Balanced
from tumble.recording import Recording
from tumble.records import dataclass


@dataclass
class JointOutcome:
    """A settled joint estimate with everything behind it.

    Attributes
    ----------
    recording : what was recorded.
    task, balanced : observations with their noise, all unknowns, solution and tests.
    terms : tests of optional terms.
    untold : what the motion does not tell; None if it shows everything.
    frame : in which the result is asked for.
    has_gyro : whether the recording has one.
    knowledge : of the accelerometers' angles, from an earlier calibration; None for none.
    untried : optional terms that what was recorded does not determine.
    table_sigma : share by which a table's rates are believed to be off, one sigma, zero for exact ones; None if nobody
        says.
    courses : source -> raw, what biases do besides that wander.
    jumps : what is said of those that jump.
    has_force : whether the recording has accelerometers, or believed poses stand in for them.
    """

    recording: Recording
    task: JointAdjustment
    balanced: Balanced
    terms: list[TermTest]
    untold: Untold | None = None
    frame: str = "accelerometer-x"
    has_gyro: bool = True
    knowledge: StableKnowledge | None = None
    untried: list[str] = field(default_factory=list[str])
    table_sigma: float | None = None
    has_force: bool = True
    courses: dict[str, list[BiasCourse]] = field(default_factory=dict[str, list[BiasCourse]])
    jumps: list[str] = field(default_factory=list[str])

    @property
    def data(self) -> Observed:
        """What was observed."""
        return self.task.data

    @property
    def site(self) -> Site:
        """Where."""
        return self.task.site

    @property
    def values(self) -> Series:
        """All unknowns at the solution."""
        return self.task.unknowns.values

    @property
    def kept(self) -> frozenset[str]:
        """Names of the optional terms that were kept."""
        return frozenset(test.name for test in self.terms if test.kept)
