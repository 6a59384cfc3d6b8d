"""One recording as a task for the solver: what its chains are made of, its variances, what is left out of it.

Windows stand in a rotation, rotations and holds in a section, sections in a recording.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tumble.arrays import Series, Square, Table
from tumble.attitude import matrices_from_rotation_vectors
from tumble.calibration.equations.hold_equations import Force, Rate, Rest, Swing
from tumble.calibration.equations.imu_unknowns import PLAIN, force_matrix
from tumble.calibration.equations.pose_equations import pose_equations
from tumble.calibration.equations.reference_equations import EarthRate, Heading, Loose
from tumble.calibration.equations.rotation_equations import RotationStretch
from tumble.calibration.equations.state import LEAST_SWAY, NODE, RecordingState, Section, undetermined
from tumble.calibration.equations.turn_equations import Turn
from tumble.earth import EARTH_RATE
from tumble.estimation import (
    Balanced,
    ChainFactor,
    Component,
    Eliminated,
    Equations,
    Outlier,
    Place,
    Screen,
    Settled,
    Spread,
    Stretch,
    balance,
    solve,
)
from tumble.records import dataclass

# Below this share of its size the horizontal Earth rate's own sigma lets its known size help: the square of it,
# halved, is what the direction's error takes off the length.
SEES_NORTH = 0.03
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


class SectionStretch:
    """An unbroken run of holds, with an Earth rate of its own.

    Parameters
    ----------
    task, section : whose.
    of_motion : with what is known of the motion itself: that holds rest, the site's Earth rate, a heading. Of several
        units that move together it counts once.
    """

    size, own = NODE, 3

    def __init__(self, task: JointAdjustment, section: Section, *, of_motion: bool = True) -> None:
        self.task, self.section, self.of_motion = task, section, of_motion
        self.nodes = section.last - section.first
        self.equations: list[Equations] = self._observed()
        self.within: list[tuple[Place, Stretch | Eliminated]] = self._rotations()

    def _observed(self) -> list[Equations]:
        """What holds, hand turns and poses show, and what fixes the frame."""
        task, section = self.task, self.section
        made: list[Equations] = [Force(section), Rate(section), Swing(section)]
        if self.of_motion:
            made.append(Rest(section))
        turns = [k for k in section.holds[:-1].tolist() if k not in task.data.rotations]
        if turns:
            made.append(Turn(section, np.array(turns)))
        if task.data.poses is not None:
            made += pose_equations(task.data.poses, section)
        return made + self._references() if self.of_motion else made

    def _references(self) -> list[Equations]:
        made: list[Equations] = [] if self.task.sees_heading(self.section) else [Heading()]
        gone = ~self.task.taking_part["force"][self.section.holds]
        if np.any(gone):
            made.append(Loose(self.section, gone))
        return [*made, EarthRate(self.section)]

    def _rotations(self) -> list[tuple[Place, Stretch | Eliminated]]:
        """A table's."""
        made: list[tuple[Place, Stretch | Eliminated]] = []
        for k in self.section.holds[:-1].tolist():
            if k in self.task.data.rotations:
                rotation = RotationStretch(self.task, self.section, k)
                made.append((rotation.joined, rotation))
        return made

    def undetermined(self, node: int) -> str:
        """Say which hold a node is."""
        base, k = self.task.data.base, int(self.section.holds[node])
        return undetermined(f"in hold {k + 1}", base.time, int(base.head[k, 0]), int(base.tail[k, 1]))

    def move(self, nodes: Table, own: Series) -> None:
        """Turn the attitudes, and move the Earth rate."""
        turned = matrices_from_rotation_vectors(nodes.reshape(-1, 3)) @ self.section.C_wb.reshape(-1, 3, 3)
        self.section.C_wb = turned.reshape(self.section.C_wb.shape)
        self.section.earth_w = self.section.earth_w + own


class RecordingStretch:
    """All sections of a recording; its unknowns are shared and no chain's own."""

    nodes, size, own = 0, NODE, 0

    def __init__(self, task: JointAdjustment) -> None:
        self.within: list[tuple[Place, Stretch | Eliminated]] = []
        for section in task.sections:
            self.within.append((Place(), SectionStretch(task, section)))
        self.equations: list[Equations] = []

    def undetermined(self, node: int) -> str:
        """Say it of the whole: it has no nodes."""
        return "What was recorded does not determine the unit's attitudes."

    def move(self, nodes: Table, own: Series) -> None:
        """Do nothing: sections move themselves."""


@dataclass
class JointAdjustment(RecordingState):
    """One recording, adjusted or to be adjusted: a task for `tumble.estimation.solve` and `balance`."""

    @property
    def state(self) -> JointAdjustment:
        """What equations are asked at: this."""
        return self

    def stretch(self) -> RecordingStretch:
        """Return everything that was observed."""
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
