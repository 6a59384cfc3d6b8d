"""A joint adjustment that has settled, with everything behind it: estimates, budgets and objections are made of it.

And what each observation of a recording does to its unknowns: biases that wander, which holds have in common, and
courses that biases take.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from functools import partial

import numpy as np

from tumble.arrays import AnyArray, Series, Vector, inverted
from tumble.calibration.equations import causes
from tumble.calibration.equations.adjustment import JointAdjustment
from tumble.calibration.equations.hold_equations import Rate
from tumble.calibration.equations.imu_unknowns import force_matrix, gyro_matrix, raw_force
from tumble.calibration.equations.observed import Observed, wander_logarithm
from tumble.calibration.estimate import TermTest
from tumble.calibration.prior import StableKnowledge, Untold
from tumble.earth import Site
from tumble.estimation import Balanced, Influences, Settled, influences_of, settled_at
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.segmentation import RestParts, find_density

# Of which density is found: more show nothing more.
MOST_HOLDS = 60


@dataclass(frozen=True)
class BiasCourse:
    """A jump or a drift of biases.

    Attributes
    ----------
    after : hold after which they jump; None of a drift.
    constant : s, time constant of an exponential; infinite of a jump.
    since : s, when they jump, or when the drift begins.
    until : s, the middle of the last hold.
    size : (axes,) of the jump, or by how much they are off at the beginning of the drift.
    """

    after: int | None
    constant: float
    since: float
    until: float
    size: Series

    def departure(self, time: Series) -> AnyArray:
        """Return (times, axes) by what the biases differ from those of the last hold.

        Parameters
        ----------
        time : s.
        """
        if self.after is not None:
            return -self.size * (time < self.since)[:, None]
        decayed = np.exp(-(np.append(time, self.until) - self.since) / self.constant)
        return self.size * (decayed[:-1] - decayed[-1])[:, None]


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


def outcome_influences(outcome: JointOutcome) -> Influences:
    """Return those of a settled outcome, courses of its biases among them.

    Parameters
    ----------
    outcome : whose courses are known.
    """
    return with_courses(recording_influences(outcome.task), outcome.courses)


def with_courses(influences: Influences, courses: Mapping[str, Sequence[BiasCourse]]) -> Influences:
    """Return influences that count what courses of biases do to each unknown.

    Parameters
    ----------
    influences, courses : of one solution; see `JointOutcome`.
    """

    def departure(own: Sequence[BiasCourse], time: Series) -> AnyArray:
        return sum((course.departure(time) for course in own), np.zeros((len(time), 3)))

    for source, own in courses.items():
        influences = influences.with_course(source, causes.COURSES[source], partial(departure, own))
    return influences


def recording_influences(task: JointAdjustment, settled: Settled | None = None) -> Influences:
    """Return what each observation of a recording does to its unknowns at the solution.

    Parameters
    ----------
    task : settled.
    settled : its solution; None linearises once more.

    Raises
    ------
    ObservabilityError
        If shared unknowns are not determined.
    """
    data, u, between = task.data, task.unknowns, _between(task)
    octaves, wanders = wander_logarithm(data.base, data.span), dict[str, tuple[Vector, float]]()
    for source, floor, variance, matrix in (
        (causes.FORCE_WANDER, data.force_density, task.noise["force"], force_matrix(u)),
        (causes.RATE_WANDER, data.rate_density, task.noise["rate"], gyro_matrix(u)),
    ):
        # What holds scatter by beyond their noise is wander as far as their parts show one, and may be a bump's.
        added = variance * np.sum(matrix**2, axis=1) / octaves
        told = floor + np.minimum(added, between.get(source, 0.0))
        wanders[source] = floor + added, float(np.sum(told) / max(float(np.sum(floor + added)), 1e-300))
    span = float(data.base.time[0]), float(data.base.time[-1])
    return influences_of(*(settled or settled_at(task), task.prior, wanders, span), between, data.wander_once)


def _between(task: JointAdjustment) -> dict[str, Vector]:
    """Source -> (3,) raw² per unit of ``ln f``: the densities by which biases wander, as all rests show them.

    Rests of one face lie near each other in time and share most of it: they scatter less among themselves than the
    faces do.
    """
    parts = task.data.base.parts
    # Holds that are too short to be cut into parts show no wander.
    if parts is None or parts.force is None:
        return {}
    made = {causes.FORCE_WANDER: _force_density(task, parts)}
    if parts.rate is not None:
        made[causes.RATE_WANDER] = _rate_density(task, parts)
    return made


def _holds(task: JointAdjustment, parts: RestParts, kind: str) -> np.ndarray:
    holds = np.intersect1d(np.flatnonzero(task.taking_part[kind]), parts.hold)
    return holds[:: max(1, -(-holds.size // MOST_HOLDS))]


def _rate_density(task: JointAdjustment, parts: RestParts) -> Vector:
    data, u = task.data, task.unknowns
    assert parts.rate is not None
    holds = _holds(task, parts, "rate")
    shown, up_b = np.zeros((data.holds, 3)), np.zeros((data.holds, 3))
    for section in task.sections:
        (linear,) = Rate(section).linearise(task)
        shown[section.holds] = linear.residual + data.base.rate_mean[section.holds]
        up_b[section.holds] = section.C_wb[:, 1, 2]
    columns = [np.ones(data.holds), *(up_b.T if u.is_free("gyro.g_sensitivity") else ())]
    design, signal = np.column_stack(columns)[holds], parts.rate - shown[parts.hold]
    return find_density(parts, signal, parts.rate_white, holds=holds, design=design)


def _force_density(task: JointAdjustment, parts: RestParts) -> Vector:
    """By the poses where most are believed; else by gravity's size, which is known of every hold.

    A unit that stays on its table from hold to spin is placed once: that one hold of seven shows nothing of a wander.
    Two holds show along gravity as much of one wander as their directions up have in common.
    """
    data, u, poses = task.data, task.unknowns, task.data.poses
    if poses is not None and data.holds < 2 * poses.hold.size <= 2 * MOST_HOLDS:
        at = np.isin(poses.hold, np.flatnonzero(task.taking_part["force"]))
        holds, up_b, sigma = poses.hold[at], poses.up_f[at], poses.sigma[at, None]
        moved = float(np.max(np.linalg.norm(data.base.force_mean[holds], axis=1))) * sigma
        spread = moved**2 * (np.maximum(1.0 - up_b**2, 0.0) + 2.0 * sigma**2)
        design = np.column_stack([np.ones(len(holds)), up_b])
        return find_density(parts, parts.force, parts.force_white, holds=holds, design=design, spread=spread)
    assert parts.force is not None
    up_b = -np.concatenate([section.C_wb[:, 1, 2] for section in task.sections])
    shown = raw_force(u, task.site.gravity * up_b)
    # What is seen along gravity, m/s², of a raw number: the others' part in it is a tilt's.
    along = np.einsum("ni,nij->nj", up_b, inverted(shown.by_true))
    columns = u.columns({name: along[:, None] @ block for name, block in shown.by_blocks.items()}, 0)[:, 0]
    holds, scale = _holds(task, parts, "force"), np.sum(force_matrix(u) ** 2, axis=1)
    signal = np.einsum("nj,nj->n", along[parts.hold], parts.force - shown.value[parts.hold])
    density = find_density(
        parts,
        signal[:, None],
        np.mean(parts.force_white / scale, keepdims=True),
        holds=holds,
        design=columns[holds],
        alike=up_b[holds] @ up_b[holds].T,
    )
    return density[0] * scale
