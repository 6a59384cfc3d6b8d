"""The magnetometer in the joint adjustment: its twelve unknowns, the local field, and what each hold shows of it.

The field is one vector of the place, in the level frame w of each section, in units of its norm: dip below the level,
and an azimuth that belongs to the section as its heading does. What a hold shows is ``M C_wb' f + h`` (Kok and Schön
2016, (12)): with C_wb from gravity that is norm and dip alone; with headings that the gyros carry, the whole vector.

The adjustment starts at a linear solution with the poses that both other triads tell.

The field may move while it is recorded: a current that is switched on, a motor, a unit that is magnetised. A change
in the room turns with the field of the place; one on the unit is a change of its bias. Both are tried as what grows
steadily and as what begins between two holds, each by the step that the adjustment would make with it.
"""

from __future__ import annotations

from dataclasses import field, fields, replace
from operator import attrgetter
from typing import cast

import numpy as np

from tumble.arrays import AnyArray, Matrices, Matrix, Series, Table, Vectors, inverted
from tumble.attitude import skews
from tumble.calibration.equations.adjustment import JointAdjustment, RecordingStretch, SectionStretch
from tumble.calibration.equations.hold_equations import HoldEquations
from tumble.calibration.equations.holds_and_turns import HoldsAndTurns
from tumble.calibration.equations.imu_unknowns import LAYOUT
from tumble.calibration.equations.state import HEAD, MIDDLE, NODE, TAIL, RecordingState, Section
from tumble.errors import ObservabilityError
from tumble.estimation import (
    Alternative,
    Block,
    ChainFactor,
    Component,
    Equations,
    Found,
    Layout,
    Linear,
    Outlier,
    Place,
    Prior,
    Screen,
    Suspect,
    Unknowns,
    View,
    find,
)
from tumble.records import dataclass
from tumble.segmentation import rounding_variance, step_at_rests

MATRIX, BIAS, DIP, AZIMUTH, IN_ROOM, ON_UNIT = (
    "magnetometer.matrix",
    "magnetometer.bias",
    "field.dip",
    "field.azimuth",
    "field.change",
    "magnetometer.bias_change",
)
FIELD_NOISE, FIELD = "field", "field"
# A hold with fewer samples of the magnetometer takes no part.
FEWEST_SAMPLES = 3


@dataclass(frozen=True)
class FieldMeans:
    """The magnetometer's mean in each hold.

    Attributes
    ----------
    mean, covariance : (holds, 3), (holds, 3, 3) raw; of a hold without samples zero and one.
    count : (holds,) samples.
    time : (holds,) s, the middle of each hold.
    """

    mean: Vectors
    covariance: Matrices
    count: np.ndarray
    time: Series

    @property
    def seen(self) -> np.ndarray:
        """(holds,) whether there are samples enough."""
        return self.count >= FEWEST_SAMPLES


def field_means(time: Series, values: Vectors, base: HoldsAndTurns) -> FieldMeans:
    """Return the means of a magnetometer over the holds.

    Parameters
    ----------
    time, values : (samples,) s on the recording's own time axis, and (samples, 3) raw; rows that are not finite are
        left out.
    base : the holds.

    Notes
    -----
    White noise falls with the root of the samples, by the scatter within the holds, the same for all of them. What
    rounding leaves stays (`tumble.segmentation.rounding`).
    """
    finite = np.isfinite(time) & np.all(np.isfinite(values), axis=1)
    time, values = time[finite], values[finite]
    edges = np.column_stack([base.time[base.head[:, 0]], base.time[base.tail[:, 1] - 1]])
    first, last = np.searchsorted(time, edges[:, 0]), np.searchsorted(time, edges[:, 1], side="right")
    count = last - first
    some = count >= FEWEST_SAMPLES
    rests = [[pair] for pair in zip(first[some].tolist(), last[some].tolist(), strict=True)]
    rows = [values[slice(*pair)] for (pair,) in rests]
    mean, stays = np.zeros((base.holds, 3)), np.zeros((base.holds, 3))
    mean[some] = np.array([of.mean(axis=0) for of in rows]).reshape(-1, 3)
    stays[some] = rounding_variance(values, rests, mean[some])
    # Of neighbours: what drifts slowly is no noise of a sample.
    scatter = [0.5 * np.mean(np.diff(of, axis=0) ** 2, axis=0) for of in rows]
    variance = np.median(scatter, axis=0) if scatter else np.ones(3)
    white = np.maximum(variance, step_at_rests(values, rests) ** 2 / 12.0)
    samples = np.maximum(count, 1)[:, None]
    spread = np.maximum(white / samples + stays, (1e-9 * max(float(np.max(np.abs(mean))), 1e-300)) ** 2)
    spread = np.where(some[:, None], spread, 1.0)
    return FieldMeans(mean, spread[:, :, None] * np.eye(3), count, edges.mean(axis=1))


def _field_layout(sections: int) -> Layout:
    """Return the unknowns of both triads, and after them those of the magnetometer and of the field."""
    pairs = [(a, b) for a in "xyz" for b in "xyz"]
    scale, across = "scale factor of magnetometer {0}", "what magnetometer {0} shows of a field along {1}"
    level = ("change of the level field", "change of the field's azimuth", "change of the upright field")
    currents = "a recording with the same currents from start to end"
    by_three = "holds with {} along the field, against it and across it"
    one_and_one = "a hold with {} along the field and one against it"
    made = {
        MATRIX: [((scale if a == b else across).format(a, b), by_three.format(b)) for a, b in pairs],
        BIAS: [(f"bias of magnetometer {a}", one_and_one.format(a)) for a in "xyz"],
        DIP: [("dip of the field", "holds with different faces up")],
        AZIMUTH: [(f"azimuth of the field in part {s + 1}", "more holds") for s in range(sections)],
        IN_ROOM: [(of, "a recording in a field that stays") for of in level],
        ON_UNIT: [(f"change of the bias of magnetometer {a}", currents) for a in "xyz"],
    }
    own = (Block(name, *map(tuple, zip(*words, strict=True))) for name, words in made.items())
    return Layout((*LAYOUT.blocks, *own))


@dataclass
class FieldAdjustment(JointAdjustment):
    """One recording with its magnetometer: everything of the joint adjustment, and the field in each hold.

    Attributes
    ----------
    seen : what the holds show of the field.
    course : (holds,) how far a change of the field, or of the bias, has come in each hold, 0 to 1.
    """

    seen: FieldMeans = field(default_factory=lambda: FieldMeans(*(np.zeros(0),) * 4))
    course: Series = field(default_factory=lambda: np.zeros(0))

    @staticmethod
    def of(task: JointAdjustment, seen: FieldMeans) -> FieldAdjustment:
        """Return a settled adjustment of both triads with the magnetometer, whose unknowns are zero as yet.

        Parameters
        ----------
        task : settled; it is copied.
        seen : the magnetometer's means.
        """
        own = task.copy()
        kept = {one.name: getattr(own, one.name) for one in fields(JointAdjustment)}
        made = FieldAdjustment(**kept, seen=seen, course=np.zeros(own.data.holds))
        layout = _field_layout(len(own.sections))
        more = 0, layout.size - LAYOUT.size
        free = np.union1d(own.unknowns.free, layout.indices(MATRIX, BIAS, DIP, AZIMUTH))
        made.unknowns = Unknowns(layout, np.pad(own.unknowns.values, more), free)
        if own.prior is not None:
            made.prior = Prior(np.pad(own.prior.mean, more), np.pad(own.prior.precision, more))
        made.taking_part = {**own.taking_part, FIELD: seen.seen & own.taking_part["force"]}
        return made

    def stretch(self) -> FieldStretch:
        """Return everything that was observed, the field too."""
        return FieldStretch(self)

    @property
    def components(self) -> list[Component]:
        """By which the field differs from hold to hold; what the triads' own noise is has been settled before."""
        return [Component(FIELD_NOISE, FIELD)]

    @property
    def chain_factors(self) -> list[ChainFactor]:
        """None: tables were judged before."""
        return []

    @property
    def screens(self) -> list[Screen]:
        """Holds in which the field is another."""
        return [Screen(FIELD)]

    def leave_out(self, outlier: Outlier) -> None:
        """Let the field of a hold take no part."""
        self.taking_part[FIELD][outlier.group] = False

    def copy(self, free: np.ndarray | None = None) -> FieldAdjustment:
        """Return an adjustment of its own, see `JointAdjustment.copy`."""
        return cast("FieldAdjustment", JointAdjustment.copy(self, free))

    def field_w(self, section: int, course: Series) -> tuple[AnyArray, AnyArray, AnyArray, AnyArray]:
        """Return the field in w at each hold of a section, and its derivatives.

        Parameters
        ----------
        section : its index.
        course : (holds,) of its holds.

        Returns
        -------
        (holds, 3) the field, (holds, 3, 1) by dip, (holds, 3, 1) by azimuth, (3, 3) by its change in a hold.
        """
        u = self.unknowns
        dip, azimuth, change = float(u[DIP][0]), float(u[AZIMUTH][section]), u[IN_ROOM]
        along = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        across, down = np.array([-along[1], along[0], 0.0]), np.array([0.0, 0.0, 1.0])
        axes = np.column_stack([along, across, down])
        moved = (axes @ change)[None] * course[:, None]
        value = np.cos(dip) * along + np.sin(dip) * down + moved
        by_dip = np.cos(dip) * down - np.sin(dip) * along
        by_azimuth = np.column_stack([-value[:, 1], value[:, 0], np.zeros(len(value))])
        by_dip = np.broadcast_to(by_dip, value.shape)[:, :, None]
        return value, by_dip, by_azimuth[:, :, None], axes


def magnetometer_matrix(u: Unknowns) -> Matrix:
    """Return (3, 3) raw units per unit of the field."""
    return u[MATRIX].reshape(3, 3)


class FieldStretch(RecordingStretch):
    """All sections of a recording, with what its magnetometer shows."""

    def __init__(self, task: FieldAdjustment) -> None:
        super().__init__(task)
        self.within = []
        for index, section in enumerate(task.sections):
            made = SectionStretch(task, section)
            made.equations.append(FieldSeen(section, index))
            self.within.append((Place(), made))


class FieldSeen(HoldEquations):
    """The field in each hold: ``M C' f + h`` less the magnetometer's mean, C' the mean over the hold.

    Parameters
    ----------
    section, index : the run of holds, and which it is.
    """

    kind, cause = FIELD, "field that differs from hold to hold"
    words = (
        "hold",
        "the magnetic field is another there than in the others, {times}: is iron or a current near?",
    )

    def __init__(self, section: Section, index: int) -> None:
        super().__init__(section)
        self.index = index
        # Of each hold, by a change of the field there: (holds, 3, 3).
        self.by_change: dict[str, AnyArray] = {}

    def linearise(self, state: RecordingState) -> list[Linear]:
        """Return three residuals a hold, raw."""
        assert isinstance(state, FieldAdjustment)
        u, k = state.unknowns, self.place
        value, by_dip, by_azimuth, by_room = state.field_w(self.index, state.course[k])
        shares = hold_shares(state, k)
        backward = np.swapaxes(self.section.C_wb, 2, 3)
        mean = np.einsum("kp,kpij->kij", shares, backward)
        matrix = magnetometer_matrix(u)
        true = np.einsum("kij,kj->ki", mean, value)
        came = state.course[k, None]
        residual = true @ matrix.T + u[BIAS] + came * u[ON_UNIT] - state.seen.mean[k]
        by_node = np.zeros((k.size, 3, NODE))
        crossed = skews(value)
        for part, at in enumerate((HEAD, MIDDLE, TAIL)):
            by_node[:, :, at] = shares[:, part, None, None] * (matrix @ backward[:, part] @ crossed)
        shown = matrix @ mean
        self.by_change = {"room": shown @ by_room, "unit": np.broadcast_to(np.eye(3), shown.shape)}
        azimuths = np.zeros((k.size, 3, len(state.sections)))
        azimuths[:, :, self.index] = (shown @ by_azimuth)[:, :, 0]
        blocks: dict[str, AnyArray] = {
            MATRIX: _rows(true),
            BIAS: np.broadcast_to(np.eye(3), (k.size, 3, 3)),
            DIP: shown @ by_dip,
            AZIMUTH: azimuths,
            **{name: came[:, :, None] * self.by_change[where] for where, name in CHANGES.items()},
        }
        covariance = state.seen.covariance[k] + state.noise[FIELD_NOISE] * (matrix @ matrix.T)
        active = state.taking_part[FIELD][k]
        return [Linear(residual, covariance, u.columns(blocks, 3), self.node, by_node, None, active)]

    def views(self, state: RecordingState, linear: Linear) -> list[View]:
        """Return all three."""
        return [View(FIELD, None, np.sum(magnetometer_matrix(state.unknowns) ** 2, axis=1))]

    def directions(self, state: RecordingState) -> Table:
        """Return an error along each axis."""
        return magnetometer_matrix(state.unknowns)


def hold_shares(state: RecordingState, k: np.ndarray) -> Table:
    """Return (holds, 3), which shares of each hold are its head, its middle and its tail.

    Parameters
    ----------
    state, k : holds and which.
    """
    base = state.data.base
    head = (base.head[k, 1] - base.head[k, 0]).astype(float)
    tail = (base.tail[k, 1] - base.tail[k, 0]).astype(float)
    whole = np.maximum((base.tail[k, 1] - base.head[k, 0]).astype(float), head + tail)
    return np.column_stack([head, whole - head - tail, tail]) / whole[:, None]


def _rows(true: AnyArray) -> AnyArray:
    """(holds, 3, 9) of each sensor by its own row of the matrix."""
    made = np.zeros((len(true), 3, 3, 3))
    made[:, range(3), range(3)] = true[:, None, :]
    return made.reshape(-1, 3, 9)


def mean_attitudes(state: RecordingState) -> Matrices:
    """Return (holds, 3, 3) C_wb, the mean over each hold."""
    made = np.zeros((state.data.base.holds, 3, 3))
    for section in state.sections:
        made[section.holds] = np.einsum("kp,kpij->kij", hold_shares(state, section.holds), section.C_wb)
    return made


def field_of_holds(state: FieldAdjustment) -> tuple[Series, Series]:
    """Return the norm of the corrected field in each hold (holds,), and its dip (holds,) rad.

    Parameters
    ----------
    state : settled.
    """
    u = state.unknowns
    field_b = (state.seen.mean - u[BIAS]) @ inverted(magnetometer_matrix(u)).T
    field_w = np.einsum("kij,kj->ki", mean_attitudes(state), field_b)
    level = np.hypot(field_w[:, 0], field_w[:, 1])
    return np.linalg.norm(field_b, axis=1), np.arctan2(field_w[:, 2], level)


# Holds beyond so many times the median residual count for less, in so many rounds.
ROBUST, ROUNDS = 2.5, 12
# A section of so many holds tells its field by itself; of shorter ones, norm and dip alone serve.
LONG_SECTION = 4


def start_field(task: FieldAdjustment) -> None:
    """Give the magnetometer and the field values to start from.

    Parameters
    ----------
    task : its unknowns of the magnetometer and of the field are set.

    Raises
    ------
    ObservabilityError
        If the holds are fewer than the unknowns, or all alike.

    Notes
    -----
    With ``y = A r + c`` the calibrated field of raw numbers r, ``C y = f`` is linear and homogeneous in A, c and the
    field f of each section; so is ``down' y = v`` where nobody carries headings. The solution is the singular vector of
    the least singular value, with holds that contradict it counting for less. Its sign is free: A that is not mirrored
    is taken.
    """
    active = np.flatnonzero(task.taking_part[FIELD])
    raw = task.seen.mean[active]
    if active.size < 6:
        raise ObservabilityError(
            f"The magnetometer has {active.size} holds: record twelve or more in different attitudes."
        )
    centre = np.median(raw, axis=0)
    size = float(np.sqrt(np.mean((raw - centre) ** 2)))
    if not size > 0.0:
        raise ObservabilityError("The magnetometer shows the same in all holds: it is constant.")
    scaled, C = (raw - centre) / size, mean_attitudes(task)[active]
    firsts = [section.first for section in task.sections]
    place = np.searchsorted(firsts, active, side="right") - 1
    rows, groups = _equations(place, len(firsts), C, scaled)
    solution = _robust(rows, groups, active.size)
    upright = 1.0 if np.linalg.det(solution[:9].reshape(3, 3)) > 0.0 else -1.0
    if not np.linalg.cond(solution[:9].reshape(3, 3)) < 1e8:
        raise ObservabilityError("The magnetometer's axes all show one direction in all holds.")
    A, c = upright * solution[:9].reshape(3, 3), upright * solution[9:12]
    field_b = scaled @ A.T + c
    field_w, norm = np.einsum("kij,kj->ki", C, field_b), float(np.median(np.linalg.norm(field_b, axis=1)))
    # Of a section without a hold that takes part along x.
    along: Vectors = np.tile(np.array([1.0, 0.0, 0.0]), (len(firsts), 1))
    for section in np.unique(place).tolist():
        along[section] = np.median(field_w[place == section], axis=0)
    u, matrix = task.unknowns, norm * size * inverted(A)
    u[MATRIX][:] = matrix.ravel()
    u[BIAS][:] = centre - matrix @ c / norm
    level = np.hypot(along[:, 0], along[:, 1])
    u[DIP][:] = float(np.median(np.arctan2(along[:, 2], level)))
    u[AZIMUTH][:] = np.arctan2(along[:, 1], along[:, 0])


def _equations(place: np.ndarray, sections: int, C: Matrices, scaled: Vectors) -> tuple[AnyArray, np.ndarray]:
    """Rows of the homogeneous system, and which hold each belongs to."""
    rows = np.concatenate([(C[:, :, :, None] * scaled[:, None, None, :]).reshape(-1, 3, 9), C], axis=2)
    long = np.flatnonzero(np.bincount(place, minlength=sections) >= LONG_SECTION)
    if not long.size:
        return np.column_stack([rows[:, 2], -np.ones(len(rows))]), np.arange(len(rows))
    kept = np.flatnonzero(np.isin(place, long))
    which = np.eye(long.size)[np.searchsorted(long, place[kept])]
    field = (which[:, None, :, None] * np.eye(3)[:, None, :]).reshape(kept.size, 3, -1)
    return np.concatenate([rows[kept], -field], axis=2).reshape(3 * kept.size, -1), np.repeat(kept, 3)


def _robust(rows: AnyArray, groups: np.ndarray, holds: int) -> Series:
    weight = np.ones(holds)
    solution = np.zeros(rows.shape[1])
    for _ in range(ROUNDS):
        solution = np.linalg.svd(weight[groups, None] * rows, full_matrices=False)[2][-1]
        square = np.bincount(groups, (rows @ solution) ** 2, minlength=holds)
        off = np.sqrt(square)
        limit = ROBUST * float(np.median(off[np.unique(groups)])) + 1e-12
        weight = np.where(off > limit, limit / np.maximum(off, 1e-300), 1.0)
    return solution


FALSE_ALARM = 1e-3
"""Chance that a recording in a field that stays is said to move."""
# Holds on either side of a change, so that a single one that is off is no change.
LEAST_HOLDS = 3
# Of many holds so many are tried as the last one before a step; one between is seen by its neighbours.
MOST_STEPS = 24
# Where a change is, and its unknowns.
CHANGES = {"room": IN_ROOM, "unit": ON_UNIT}


@dataclass(frozen=True)
class Moving:
    """A change of the field while it is recorded.

    Attributes
    ----------
    where : "room" or "unit".
    before : the hold after which it begins; -1 for what grows steadily.
    share : its size as a share of the field's norm.
    probability : that chance does it, of all that was tried.
    """

    where: str
    before: int
    share: float
    probability: float


def find_moving(task: FieldAdjustment) -> Moving | None:
    """Return the most significant change of the field; None where chance explains all.

    Parameters
    ----------
    task : settled.

    Raises
    ------
    ObservabilityError
        If what was recorded does not determine the unknowns.
    """
    trial, courses, holds = task.copy(), _courses(task), task.seen.time.size
    # What holds differ by is sought anew beside each change.
    trial.noise = task.noise.copy()
    trial.noise.added[FIELD_NOISE] = 0.0
    found: list[Found] = []
    for where in CHANGES if courses else ():

        def columns(equations: Equations, linear: Linear, where: str = where) -> AnyArray | None:
            if not isinstance(equations, FieldSeen):
                return None
            made = np.zeros((len(linear.residual), 3, holds, 3))
            made[np.arange(len(made)), :, equations.place] = equations.by_change[where] * _told(task, where)
            return made.reshape(len(made), 3, -1)

        suspect = Suspect(columns, holds, 3, [np.eye(holds)])
        shapes = np.array(list(courses.values()))
        found += find(
            [trial], [Alternative(where, suspect, shapes, 0.5 * FALSE_ALARM, attrgetter("alternative.name"))]
        )
    if not found:
        return None
    best = min(found, key=attrgetter("rarity"))
    size = best.size if best.said == "room" else inverted(magnetometer_matrix(task.unknowns)) @ best.size
    return Moving(best.said, list(courses)[best.shape], float(np.linalg.norm(size)), best.probability)


def with_change(task: FieldAdjustment, moving: Moving) -> FieldAdjustment:
    """Return the adjustment with a change of the field among its unknowns.

    Parameters
    ----------
    task, moving : as it was before, and what was found.
    """
    u = task.unknowns
    chosen = u.layout.indices(CHANGES[moving.where])[_told(task, moving.where)]
    active = np.flatnonzero(task.taking_part[FIELD])
    course = _growth(task, active) if moving.before < 0 else _step(task, moving.before)
    return replace(task.copy(), unknowns=u.with_free(np.union1d(u.free, chosen)).copy(), course=course)


def _growth(task: FieldAdjustment, active: np.ndarray) -> Series:
    time = task.seen.time
    return (time - time[active[0]]) / (time[active[-1]] - time[active[0]])


def _step(task: FieldAdjustment, before: int) -> Series:
    return (np.arange(task.seen.time.size) > before).astype(float)


def _told(task: FieldAdjustment, where: str) -> np.ndarray:
    """Which components of a change anything shows: without a gyro nothing determines its azimuth."""
    alone = max(section.last - section.first for section in task.sections) < LEAST_HOLDS
    return np.array([True, not (alone and where == "room"), True])


def _courses(task: FieldAdjustment) -> dict[int, Series]:
    """What may happen: steady growth (-1), and a step after a hold."""
    active = np.flatnonzero(task.taking_part[FIELD])
    if active.size < 2 * LEAST_HOLDS:
        return {}
    inner = active[LEAST_HOLDS - 1 : -LEAST_HOLDS]
    steps = {k: _step(task, k) for k in inner[:: -(-inner.size // MOST_STEPS)].tolist()}
    return {-1: _growth(task, active), **steps}
