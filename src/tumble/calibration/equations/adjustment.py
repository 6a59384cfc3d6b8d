"""What is adjusted of one recording: its observations, what is believed, and where every unknown is.

Attitudes are those of b against a level frame w of each section (an unbroken run of holds): down is its third axis,
and its heading is the first hold's own. The Earth rate in w is three unknowns of the section. An attitude error is a
rotation vector in w: ``C_true = (1 + [phi]) C``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, replace
from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import AnyArray, Matrices, Series, Square, Vector
from tumble.calibration.equations.imu_unknowns import PLAIN, force_matrix
from tumble.calibration.equations.observed import Observed
from tumble.earth import EARTH_RATE, Site
from tumble.estimation import (
    Balanced,
    ChainFactor,
    Component,
    Eliminated,
    Noise,
    Outlier,
    Prior,
    Screen,
    Settled,
    Spread,
    Unknowns,
    balance,
    solve,
)
from tumble.records import dataclass

if TYPE_CHECKING:
    from tumble.calibration.equations.stretches import RecordingStretch

HEAD, MIDDLE, TAIL = slice(0, 3), slice(3, 6), slice(6, 9)
"""Where a hold's three attitudes stand in its node."""
NODE = 9
EARTH = slice(0, 3)
"""Where a section's Earth rate stands in its border; outside unknowns follow."""
# Below this share of its size the horizontal Earth rate's own sigma lets its known size help: the square of it,
# halved, is what the direction's error takes off the length.
SEES_NORTH = 0.03
LEAST_SWAY = 1e-16  # rad²: 10 nrad, far below what any unit sees
# A hundredth of what a hold's mean tells of its tilt is nothing, too; a smaller sway would weigh so much more than
# anything else that round-off takes the Earth rate's place.
SWAY_SHARE = 1e-4
# Where the search for the sway begins, and down to where round-off lets it go; below, the holds' parts decide.
START_SWAY, SMALLEST_SWAY = 1e-8, 1e-12  # rad²
# Sigmas from which everything else begins. With variances that are yet to be balanced, the last thousandth of a sigma
# took three steps of four.
START_TOLERANCE = 0.5
# A table that shakes: its windows' noise is raised where chance does so more rarely than this.
SHAKING_FALSE_ALARM = 1e-3
# Mean square of an axis's residuals beyond which it wobbles more than was believed; it takes four of them.
WOBBLES, AXIS_UNKNOWNS = 2.0, 4
SCREENED = ("force", "rate", "turn", "tilt", "pose", "table rate")
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
class JointAdjustment:
    """One recording, adjusted or to be adjusted: a task for `tumble.estimation.solve` and `balance`.

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

    @property
    def state(self) -> JointAdjustment:
        """What equations are asked at: this."""
        return self

    def stretch(self) -> RecordingStretch:
        """Return everything that was observed."""
        from tumble.calibration.equations.stretches import RecordingStretch

        return RecordingStretch(self)

    @property
    def components(self) -> list[Component]:
        """Variances that residuals may ask for."""
        return [
            # Whether a hold is still, its parts and the gyros say: a sway that is all but nothing leaves no residual
            # of its own.
            Component("sway", "rest", SMALLEST_SWAY, still_sway, ("parts", "swing"), single=True),
            Component("force", "force"),
            Component("rate", "rate"),
            Component("turn", "turn"),
            Component("placement", "tilt"),
            Component("placement", "pose"),
            Component("table rate", "table rate"),
        ]

    @property
    def chain_factors(self) -> list[ChainFactor]:
        """Tables that wobble, and tables that shake."""
        return [
            ChainFactor("axis", taken=AXIS_UNKNOWNS, limit=WOBBLES),
            ChainFactor("windows", false_alarm=SHAKING_FALSE_ALARM),
        ]

    @property
    def screens(self) -> list[Screen]:
        """What gross errors are looked for in."""
        return [*(Screen(kind) for kind in SCREENED), Screen("angle", given=True)]

    def leave_out(self, outlier: Outlier) -> None:
        """Let an observation take no part; what was raised to bear a misread angle goes with it."""
        if outlier.kind == "angle":
            self.noise.factors.pop("windows", None)
            self.noise.factors.pop("axis", None)
        self.taking_part["pose" if outlier.kind == "tilt" else outlier.kind][outlier.group] = False

    def snapshot(self) -> Callable[[], None]:
        """Return a function that puts unknowns, attitudes and noise back where they are now.

        The sections and rotations stay the same objects: a solution that was settled here holds again.
        """
        unknowns, noise = self.unknowns, self.noise.copy()
        sections = [(section, replace(section)) for section in self.sections]
        rotations = [(rotation, replace(rotation)) for rotation in self.rotations.values()]

        def back() -> None:
            self.unknowns, self.noise = unknowns, noise
            # Arrays are replaced when they move, and never written into but where they are new.
            for section, was in sections:
                section.C_wb, section.earth_w, section.sees_north = was.C_wb, was.earth_w, was.sees_north
            for rotation, was in rotations:
                rotation.C_wb, rotation.axis_b, rotation.axis_w = was.C_wb, was.axis_b, was.axis_w
                rotation.own, rotation.anchor = was.own, was.anchor

        return back

    def copy(self, free: np.ndarray | None = None) -> JointAdjustment:
        """Return an adjustment of its own; with other unknowns free, the terms that are then held are zero.

        Parameters
        ----------
        free : indices of the unknowns to adjust; None for the same, with all values as they are.
        """
        unknowns = self.unknowns.copy() if free is None else self.unknowns.with_free(free).only_free()
        unknowns.values[PLAIN] = self.unknowns.values[PLAIN]
        return replace(
            self,
            unknowns=unknowns,
            sections=[section.copy() for section in self.sections],
            rotations={k: rotation.copy() for k, rotation in self.rotations.items()},
            noise=self.noise.copy(),
            taking_part={kind: active.copy() for kind, active in self.taking_part.items()},
        )

    def reads_angle(self, k: int) -> bool:
        """Whether the angle of the rotation after a hold was read, and is believed."""
        return self.data.rotations[k].angle is not None and bool(self.taking_part["angle"][k])

    def sees_heading(self, section: Section) -> bool:
        """Whether a believed heading tells where a section's north is."""
        poses = self.data.poses
        return poses is not None and bool(np.any(poses.has_heading[poses.of(section.first, section.last)]))

    def stepped(self, chain: Eliminated, cofactor: Square) -> bool:
        """Note the sections whose gyros know the horizontal Earth rate well enough for its length to help."""
        if self.site.latitude is None:
            return False
        known, before = EARTH_RATE * float(np.cos(self.site.latitude)), [s.sees_north for s in self.sections]
        for section, (_, inner) in zip(self.sections, chain.within, strict=True):
            covariance = Spread(inner, cofactor).border[:2, :2]
            seen, spread = float(np.linalg.norm(section.earth_w[:2])), float(np.sqrt(np.trace(covariance)))
            section.sees_north = spread < SEES_NORTH * known and abs(seen - known) < known / 2.0
        return before != [s.sees_north for s in self.sections]


def still_sway(task: JointAdjustment) -> float:
    """Return the sway (rad²) that is none for these accelerometers.

    Parameters
    ----------
    task : observations, and where the accelerometers' scale factors are.
    """
    base = task.data.base
    scale = np.sum(force_matrix(task.unknowns) ** 2, axis=1)
    mean = np.min(base.force_sample_variance / scale) / max(float(np.max(base.hold_samples)), 1.0)
    return float(np.clip(SWAY_SHARE * mean / task.site.gravity**2, LEAST_SWAY, SMALLEST_SWAY))


def balance_recording(task: JointAdjustment) -> Balanced:
    """Adjust, add variance where residuals ask for it, and leave out what is no noise.

    Parameters
    ----------
    task : moved; its noise and what takes part are changed.

    Raises
    ------
    ConvergenceError, ObservabilityError
        From the adjustment.
    """
    task.noise.added["sway"] = max(task.noise["sway"], START_SWAY)
    return balance(task)


def solve_recording(task: JointAdjustment) -> Settled:
    """Adjust with the noise as it is and everything that takes part, as near as it takes to start from.

    Parameters
    ----------
    task : moved.

    Raises
    ------
    ConvergenceError, ObservabilityError
        From the adjustment.
    """
    task.noise.added["sway"] = max(task.noise["sway"], START_SWAY)
    return solve(task, tolerance=START_TOLERANCE)
