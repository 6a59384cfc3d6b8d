"""What a planned test tells of both triads: the joint estimator's information, in the parameters' own names.

The information matrix is that of the estimator itself, linearised where the sensors are exact: every attitude, the
Earth rate and whatever belongs to one rotation is eliminated, as in a calibration.
"""

from __future__ import annotations

from dataclasses import field, replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Square, Table, inverted
from tumble.calibration.equations.adjustment import JointAdjustment, Section, still_sway
from tumble.calibration.equations.imu_unknowns import LAYOUT, PLAIN, imu_unknowns, unknowns_of
from tumble.calibration.equations.observed import Observed
from tumble.calibration.equations.reference_equations import Heading
from tumble.calibration.equations.stretches import RecordingStretch, SectionStretch
from tumble.calibration.equations.turn_equations import Link, Turn
from tumble.calibration.outcome.budget import recording_influences
from tumble.calibration.outcome.description import named_function
from tumble.calibration.start import start_adjustment
from tumble.earth import Site
from tumble.estimation import Prior
from tumble.estimation.chain import Chain, Eliminated
from tumble.estimation.influence import Influences
from tumble.estimation.reliability import WeakDirection, find_weak_directions
from tumble.estimation.solve import solve
from tumble.records import dataclass
from tumble.sensor import ImuModel
from tumble.sensor.conventions.shin import shin_from_matrix
from tumble.sensor.propagation import jacobian
from tumble.simulation import Grade

Complex = npt.NDArray[Any]

FREE = np.sort(np.concatenate([PLAIN, LAYOUT.indices("gyro.g_sensitivity")]))
"""The shared unknowns that a plan looks at: both triads and g-sensitivity."""
_TERMS = frozenset({"g_sensitivity"})
LABELS, _EVALUATE = named_function(_TERMS, "full", "accelerometer-x", ("m/s²", "rad/s"))
NAMES = tuple(name for name, _ in LABELS)
"""Of the thirty parameters, in the order of every matrix here."""
UNITS = tuple(unit for _, unit in LABELS)
GROUPS: dict[str, slice] = {
    "accelerometer bias": slice(0, 3),
    "accelerometer scale": slice(3, 6),
    "accelerometer misalignment": slice(6, 9),
    "gyro bias": slice(9, 12),
    "gyro scale": slice(12, 15),
    "gyro misalignment": slice(15, 18),
    "rotation between the triads": slice(18, 21),
    "g-sensitivity": slice(21, 30),
}
PARAMETERS = 30
WITHOUT_G = np.arange(21)
# A parameter is told when the test leaves less than this of what the data sheet leaves open.
TOLD = 0.9
# Of what is not told at all: so many times the data sheet's spread.
IGNORANCE = 1e2
# rad: nothing is known of a heading that nobody carries on, and the equations stay regular.
UNKNOWN_HEADING = 1e3
# What is known of gyro scale factors without the planned clock has less than this share of the clock's variance.
_BEYOND_CLOCK = 0.9
# No data sheet states that a gyro feels no gravity at all, 0.01 (°/s)/g.
_LEAST_G_SENSITIVITY = 0.01 * np.pi / 180.0 / 9.80665


def parameter_sizes(grade: Grade) -> Series:
    """Return (30,) one sigma by which units of a grade differ, of each parameter, SI.

    Parameters
    ----------
    grade : whose spreads the data sheet states.
    """
    force, gyro = grade.accelerometer, grade.gyroscope
    apart = float(np.hypot(force.misalignment, gyro.misalignment))
    threes = (
        force.bias,
        force.scale_factor,
        np.sqrt(2.0) * force.misalignment,
        gyro.bias,
        gyro.scale_factor,
        np.sqrt(2.0) * gyro.misalignment,
        apart,
    )
    least = max(grade.g_sensitivity, _LEAST_G_SENSITIVITY)
    sizes = np.concatenate([np.repeat(threes, 3), np.full(9, least)])
    return np.maximum(sizes, 1e-12)


def open_spreads(sizes: Series, *, sheet: bool) -> Series:
    """Return (30,) by how much each parameter is open before anything is observed.

    Parameters
    ----------
    sizes : (30,) of `parameter_sizes`.
    sheet : believe them.
    """
    return sizes * (1.0 if sheet else IGNORANCE)


@dataclass(frozen=True, slots=True)
class JointInformation:
    """What is known of the thirty parameters.

    Attributes
    ----------
    matrix : (30, 30) in the parameters' SI units.
    """

    matrix: Square

    def plus(self, other: JointInformation) -> JointInformation:
        """Return what both tell together."""
        return JointInformation(self.matrix + other.matrix)

    def beside_clock(self, sigma: float) -> JointInformation:
        """Return what is left where the sample rate is known by `sigma` (a share) alone: gyro scale factors share it.

        Parameters
        ----------
        sigma : one standard uncertainty; 0 for a perfect clock.
        """
        if not sigma:
            return self
        shown = self.matrix[:, GROUPS["gyro scale"]].sum(axis=1)
        by_clock = shown[GROUPS["gyro scale"]].sum() + sigma**-2
        return JointInformation(self.matrix - np.outer(shown, shown) / by_clock)

    def is_beyond_clock(self, sigma: float) -> bool:
        """Whether gyro scale factors are known better than a clock: by another one, or a table's rates.

        Parameters
        ----------
        sigma : of the clock, a share.
        """
        part = GROUPS["gyro scale"]
        return bool(_BEYOND_CLOCK * sigma**2 * self.matrix[part, part].sum() > 1.0)

    def covariance(self, sizes: Series, *, g_sensitivity: bool, sheet: bool = False) -> Square:
        """Return (30, 30), finite throughout: what is not told is open by a hundred times its spread.

        Parameters
        ----------
        sizes : (30,) of `parameter_sizes`.
        g_sensitivity : whether it is estimated; if not, it is taken to be nothing and has no covariance.
        sheet : believe the data sheet's spreads beforehand.
        """
        at = np.arange(PARAMETERS) if g_sensitivity else WITHOUT_G
        open_by = open_spreads(sizes, sheet=sheet)[at]
        scaled = _symmetric(self.matrix[np.ix_(at, at)] * np.outer(open_by, open_by))
        # By eigenvalues, of which round-off may have made those of nothing a little negative.
        values, vectors = np.linalg.eigh(scaled)
        inverse = (vectors / (np.maximum(values, 0.0) + 1.0)) @ vectors.T
        made = np.zeros((PARAMETERS, PARAMETERS))
        made[np.ix_(at, at)] = inverse * np.outer(open_by, open_by)
        return made

    def weak_directions(self, sizes: Series, *, g_sensitivity: bool) -> list[WeakDirection]:
        """Return the combinations that are told no better than the data sheet does, in those sizes, worst first.

        Parameters
        ----------
        sizes, g_sensitivity : as for `covariance`.
        """
        at = np.arange(PARAMETERS) if g_sensitivity else WITHOUT_G
        found = find_weak_directions(_symmetric(self.matrix[np.ix_(at, at)]), sizes[at], TOLD)
        left_out = (0, PARAMETERS - at.size)
        return [replace(weak, direction=np.pad(weak.direction, left_out)) for weak in found]


def _symmetric(matrix: Square) -> Square:
    return np.ascontiguousarray(0.5 * (matrix + matrix.T), dtype=np.float64)


@dataclass(slots=True)
class PlannedProblem:
    """A planned test at its true state: linearised again and again with other holds or noise.

    Attributes
    ----------
    task : the adjustment, at the truth.
    rotations : what each rotation says, by the hold before it, once it has been asked for.
    links : what the gyros carry over all turns of a section, by its first hold, once it has been asked for.
    """

    task: JointAdjustment
    rotations: dict[int, Eliminated] = field(default_factory=dict[int, Eliminated])
    links: dict[int, Link] = field(default_factory=dict[int, Link])

    def information(
        self,
        taking_part: dict[str, np.ndarray] | None = None,
        data: Observed | None = None,
        without: int | None = None,
    ) -> JointInformation:
        """Return what it determines.

        Parameters
        ----------
        taking_part : which holds and turns do; everything by default.
        data : the same motion with other noise of its holds; the problem's own by default.
        without : the hold after which a rotation is left out.
        """
        task = replace(
            self.task,
            taking_part=dict(taking_part or self.task.taking_part),
            data=data or self.task.data,
            unknowns=self.task.unknowns.with_free(FREE),
        )
        recording = RecordingStretch(task)
        for (_, stretch), section in zip(recording.within, task.sections, strict=True):
            assert isinstance(stretch, SectionStretch)
            self._prepare(task, stretch, section, without)
        normal = Chain.of(recording, task, FREE.size).eliminated().matrix
        return JointInformation(information_in_names(normal))

    def influences(self, known: Square, *, g_sensitivity: bool) -> Influences:
        """Return what each observation does to the unknowns, the wander that neighbours share in their covariance.

        Parameters
        ----------
        known : (30, 30) information of the parameters beside the test's own, that leaves none of them open.
        g_sensitivity : whether it is estimated.
        """
        values = self.task.unknowns.values
        slope = inverted(_back())
        precision = np.zeros((values.size, values.size))
        precision[np.ix_(FREE, FREE)] = slope.T @ known @ slope
        free = self.task.unknowns.with_free(FREE if g_sensitivity else PLAIN)
        return recording_influences(replace(self.task, unknowns=free, prior=Prior(values.copy(), precision)))

    def in_names(self, covariance: Table) -> Square:
        """Return the covariance (30, 30) of the parameters of that of the unknowns.

        Parameters
        ----------
        covariance : of both triads and g-sensitivity, or without the latter.
        """
        whole = np.zeros((FREE.size, FREE.size))
        whole[: len(covariance), : len(covariance)] = covariance
        slope = inverted(_back())
        return _symmetric(slope @ whole @ slope.T)

    def _prepare(
        self, task: JointAdjustment, stretch: SectionStretch, section: Section, without: int | None
    ) -> None:
        """Take rotations, which are most of the work, as they were eliminated before, and one of them out."""
        # What keeps a step finite is no knowledge.
        stretch.equations = [e for e in stretch.equations if e.kind != "loose"]
        for turns in stretch.equations:
            if isinstance(turns, Turn):
                if section.first not in self.links:
                    self.links[section.first] = turns.integrated(task)
                turns.given = self.links[section.first]
        outside = 9 + FREE.size
        for place, inner in stretch.within:
            k = place.node + section.first
            if k not in self.rotations and not isinstance(inner, Eliminated):
                self.rotations[k] = Chain.of(inner, task, outside).eliminated()
        kept = [(p, self.rotations[p.node + section.first]) for p, _ in stretch.within]
        stretch.within = [(p, inner) for p, inner in kept if p.node + section.first != without]
        if without is not None and section.first <= without < section.last - 1:
            # Across the gap the heading is not carried: the rest of the section has one of its own.
            stretch.equations.append(Heading(without + 1 - section.first, UNKNOWN_HEADING))


def information_in_names(normal: Square) -> Square:
    """Return the information (30, 30) of the named parameters of that of the unknowns, at exact sensors.

    Parameters
    ----------
    normal : of the joint estimator, with all of `FREE` free.
    """
    back = _back()
    return _symmetric(np.asarray(back.T @ normal @ back, dtype=np.float64))


@cache
def _back() -> Square:
    """(free, 30) derivatives of the free unknowns by the named parameters, at exact sensors."""
    slope = np.asarray(jacobian(_EVALUATE, unknowns_of(ImuModel.ideal())), dtype=np.float64)[:, FREE]
    made = inverted(np.ascontiguousarray(slope))
    made.flags.writeable = False
    return made


def planned_problem(data: Observed, site: Site, sizes: Series) -> PlannedProblem:
    """Return a planned test's equations where all unknowns are true: of exact sensors.

    Parameters
    ----------
    data : of `planned_data`, or of a recording.
    site : gravity and latitude.
    sizes : (30,) of `parameter_sizes`, that keep the adjustment in bounds where the test does not tell.
    """
    at = imu_unknowns(unknowns_of(ImuModel.ideal()), FREE)
    task = start_adjustment(data, at, site)
    task.prior = at.layout.sparse_prior(at.values, _spreads(sizes))
    # No smaller than what counts as none: a stiffer hold leaves weak directions to round-off.
    task.noise.set("sway", still_sway(task))
    # One step finds whether the gyros see north; attitudes are where they belong already.
    solve(task, once=True)
    task.unknowns, task.prior = at, None
    return PlannedProblem(task)


def _spreads(sizes: Series) -> dict[str, float | Series]:
    gyro = np.full((3, 3), float(np.hypot(sizes[15], sizes[18])))
    gyro[np.diag_indices(3)] = sizes[12:15]
    return {
        "force.bias": sizes[0:3],
        "force.scale": sizes[3:6],
        "force.angle": sizes[6:9],
        "gyro.matrix": gyro.ravel(),
        "gyro.bias": sizes[9:12],
        "gyro.g_sensitivity": sizes[21:30],
    }


def parameters_of(
    force: Complex, force_bias: Complex, gyro: Complex, gyro_bias: Complex, g_sensitivity: Complex
) -> Complex:
    """Return the thirty parameters of matrices and biases, analytically, for complex steps.

    Parameters
    ----------
    force, force_bias : (3, 3) lower triangular, (3,) of the accelerometers.
    gyro, gyro_bias, g_sensitivity : (3, 3), (3,) and (3, 3) of the gyros.
    """
    scale, angles = shin_from_matrix(force)
    unknowns = np.zeros(LAYOUT.size, dtype=complex)
    for name, values in (
        ("force.bias", force_bias),
        ("force.scale", scale),
        ("force.angle", angles),
        ("gyro.matrix", gyro.ravel()),
        ("gyro.bias", gyro_bias),
        ("gyro.g_sensitivity", g_sensitivity.ravel()),
    ):
        unknowns[LAYOUT[name]] = values
    return _EVALUATE(unknowns)
