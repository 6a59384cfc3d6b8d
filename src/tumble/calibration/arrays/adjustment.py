"""Units that move together on one fixture: common attitudes, a mounting and sensor parameters of each unit's own.

Attitudes of the first unit are the nodes of one chain. Another unit's attitude is ``C_wb = C_w1 C_1b`` with its
mounting C_1b the same in all holds. An error of the mounting, a rotation vector m in the first unit's axes, turns it in
the level frame by ``C_w1 m``: what a unit observes of its own attitude, it observes of the common one and of m. So each
unit's equations are added to the common chain node by node, their borders stand side by
side, and the mounting's equations follow by congruence. What is known of the motion itself (rest, Earth rate) counts
once.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Square
from tumble.attitude.rotations import find_nearest_rotation, matrix_from_rotation_vector
from tumble.calibration.equations.adjustment import EARTH, JointAdjustment, Section
from tumble.calibration.equations.stretches import SectionStretch
from tumble.errors import ConvergenceError, UsageError
from tumble.estimation.chain import Chain, Eliminated, move_all
from tumble.estimation.gauss_helmert import invert_normal_matrix
from tumble.estimation.solve import ROUND_OFF, TOLERANCE, longest
from tumble.records import dataclass

if TYPE_CHECKING:
    from tumble.calibration.outcome.estimate import JointOutcome

NODE = SectionStretch.size
ROUNDS = 30
# Turns of two units are the same to this, half of them at least: a unit that slips moves one turn, not all.
LARGEST_APART = 0.05  # rad


@dataclass(slots=True)
class ArrayUnit:
    """One unit of an array.

    Attributes
    ----------
    name : of its recording, for words.
    outcome : of its own joint adjustment, without the others.
    task : its equations; their attitudes follow from the first unit's and the mounting.
    C_1b : (3, 3) from its axes to the first unit's.
    scale : variance of unit weight of its residuals by itself, 1 at least.
    """

    name: str
    outcome: JointOutcome
    task: JointAdjustment
    C_1b: Matrix
    scale: float

    @staticmethod
    def of(name: str, outcome: JointOutcome) -> ArrayUnit:
        """Return a unit that was adjusted by itself; the outcome stays as it is."""
        return ArrayUnit(name, outcome, outcome.task.copy(), np.eye(3), outcome.balanced.solution.unit_weight)

    @property
    def free(self) -> np.ndarray:
        """Indices of its unknowns that are adjusted."""
        return self.task.unknowns.free


@dataclass(slots=True)
class ArraySolution:
    """A settled adjustment of an array.

    Attributes
    ----------
    units : at the solution.
    covariance : of each unit's free unknowns, unit by unit, and then of the mountings, three for each but the first.
    square_sum, redundancy : of all residuals, as they weigh.
    alone_sum, alone_redundancy : the same of the units by themselves.
    """

    units: list[ArrayUnit]
    covariance: Square
    square_sum: float
    redundancy: int
    alone_sum: float
    alone_redundancy: int

    def place(self, index: int) -> slice:
        """Return where a unit's free unknowns stand in the covariance."""
        start = sum(unit.free.size for unit in self.units[:index])
        return slice(start, start + self.units[index].free.size)

    def mounting_place(self, index: int) -> slice:
        """Return where a unit's mounting stands in the covariance; the first unit has none."""
        start = sum(unit.free.size for unit in self.units) + 3 * (index - 1)
        return slice(start, start + 3)


@dataclass(slots=True)
class _Common:
    """One section's equations of all units, eliminated."""

    chain: Eliminated
    parts: list[Chain]
    square_sum: float


def solve_array(names: Sequence[str], outcomes: Sequence[JointOutcome]) -> ArraySolution:
    """Adjust all units of an array together.

    Parameters
    ----------
    names : of the units, for words.
    outcomes : of each one's own adjustment, of the same holds.

    Raises
    ------
    UsageError
        If the units do not have the same holds, or did not move together.
    ObservabilityError
        If something is not determined.
    ConvergenceError
        If it does not settle.
    """
    units = [ArrayUnit.of(name, outcome) for name, outcome in zip(names, outcomes, strict=True)]
    _require_same_holds(units)
    for unit in units[1:]:
        _require_same_motion(units[0], unit)
        unit.C_1b = _start_mounting(units[0], unit)
        _follow(units[0], unit)
    before = np.inf
    for _ in range(ROUNDS):
        sections, normal, gradient = _linearise(units)
        covariance = invert_normal_matrix(normal)
        step = -covariance @ gradient
        _move(units, sections, step)
        size = longest(step, covariance)
        if size <= TOLERANCE or (size < ROUND_OFF and size >= before):
            return _solution(units, sections, covariance)
        before = size
    raise ConvergenceError(
        f"The adjustment of {len(units)} units together did not settle within {ROUNDS} rounds."
    )


def _require_same_holds(units: Sequence[ArrayUnit]) -> None:
    first = units[0]
    for unit in units[1:]:
        if not np.array_equal(unit.task.data.sections, first.task.data.sections):
            raise UsageError(
                f"{unit.name} does not have the same holds and usable turns as {first.name}: units of an array are "
                "recorded at the same time, on one clock."
            )


def _require_same_motion(first: ArrayUnit, unit: ArrayUnit) -> None:
    """Refuse a unit that turned by other angles than the first one from hold to hold, which no mounting changes."""
    angles = [
        [
            float(np.arccos(np.clip(0.5 * (np.trace(before.T @ after) - 1.0), -1.0, 1.0)))
            for section in one.task.sections
            for before, after in zip(section.C_wb[:-1, 1], section.C_wb[1:, 1], strict=True)
        ]
        for one in (first, unit)
    ]
    apart = np.abs(np.array(angles[0]) - np.array(angles[1]))
    if not apart.size or float(np.median(apart)) < LARGEST_APART:
        return
    worst = int(np.argmax(apart))
    raise UsageError(
        f"{unit.name} and {first.name} did not move together: in turn {worst + 1} the one turned by "
        f"{np.degrees(angles[1][worst]):.0f}°, the other by {np.degrees(angles[0][worst]):.0f}°. Units of an array are "
        "tumbled together and recorded on one clock."
    )


def _start_mounting(first: ArrayUnit, unit: ArrayUnit) -> Matrix:
    """From gravity's direction in all holds, each unit's as it sees it by itself."""
    together = np.zeros((3, 3))
    for own, common in zip(unit.task.sections, first.task.sections, strict=True):
        down_b, down_1 = own.C_wb[:, 1, 2], common.C_wb[:, 1, 2]
        together += down_1.T @ down_b
        if len(own.C_wb) > 1:
            # How the attitudes turn from hold to hold, whatever heading each section has by itself.
            for k in range(len(own.C_wb) - 1):
                turned_b = own.C_wb[k, 1].T @ own.C_wb[k + 1, 1]
                turned_1 = common.C_wb[k, 1].T @ common.C_wb[k + 1, 1]
                together += np.outer(_axis(turned_1), _axis(turned_b))
    return find_nearest_rotation(together)


def _axis(C: Matrix) -> Series:
    """The rotation's axis times the sine of its angle."""
    return 0.5 * np.array([C[2, 1] - C[1, 2], C[0, 2] - C[2, 0], C[1, 0] - C[0, 1]])


def _follow(first: ArrayUnit, unit: ArrayUnit) -> None:
    """Set a unit's attitudes from the first one's; the windows of a table's rotations turn with their section."""
    for own, common in zip(unit.task.sections, first.task.sections, strict=True):
        before = own.C_wb[0, 0].copy()
        own.C_wb = common.C_wb @ unit.C_1b
        own.earth_w, own.sees_north = common.earth_w.copy(), common.sees_north
        turned = own.C_wb[0, 0] @ before.T
        for k in range(own.first, own.last - 1):
            if k in unit.task.rotations:
                spin = unit.task.rotations[k]
                spin.C_wb, spin.axis_w = turned @ spin.C_wb, turned @ spin.axis_w


def _linearise(units: Sequence[ArrayUnit]) -> tuple[list[_Common], Square, Series]:
    """All sections' equations, and the normal matrix and gradient of all units' free unknowns and mountings."""
    sizes = [unit.free.size for unit in units]
    whole = sum(sizes) + 3 * (len(units) - 1)
    normal, gradient = np.zeros((whole, whole)), np.zeros(whole)
    sections: list[_Common] = []
    for number, section in enumerate(units[0].task.sections):
        parts = [
            Chain.of(
                SectionStretch(unit.task, unit.task.sections[number], of_motion=u == 0),
                unit.task,
                unit.free.size,
            )
            for u, unit in enumerate(units)
        ]
        made = _common(units, parts, section, sizes)
        normal += made.chain.matrix
        gradient += made.chain.right
        sections.append(made)
    for unit, start in zip(units, np.cumsum([0, *sizes]), strict=False):
        prior, own, u = unit.task.prior, slice(start, start + unit.free.size), unit.task.unknowns
        if prior is not None:
            normal[own, own] += prior.precision[np.ix_(u.free, u.free)]
            gradient[own] += (prior.precision @ (u.values - prior.mean))[u.free]
    return sections, normal, gradient


def _common(
    units: Sequence[ArrayUnit], parts: list[Chain], section: Section, sizes: Sequence[int]
) -> _Common:
    """Add all units' equations of one section, node by node."""
    nodes = section.last - section.first
    total = Chain.zero(nodes, NODE, 3, sum(sizes) + 3 * (len(units) - 1))
    start = 3
    turns = section.C_wb.reshape(nodes, NODE, 3)
    for u, (unit, part) in enumerate(zip(units, parts, strict=True)):
        at = np.r_[EARTH, start : start + sizes[u]]
        _add(total, part, at, 1.0 / unit.scale)
        if u:
            mounting = 3 + sum(sizes) + 3 * (u - 1) + np.arange(3)
            _add_mounting(total, part, at, mounting, turns, 1.0 / unit.scale)
        start += sizes[u]
    squares = sum(part.square_sum / unit.scale for unit, part in zip(units, parts, strict=True))
    return _Common(total.eliminated(), parts, squares)


def _add(total: Chain, chain: Chain, at: np.ndarray, weight: float) -> None:
    total.diagonal += weight * chain.diagonal
    total.lower += weight * chain.lower
    total.gradient += weight * chain.gradient
    total.border[:, :, at] += weight * chain.border
    total.corner[np.ix_(at, at)] += weight * chain.corner
    total.corner_gradient[at] += weight * chain.corner_gradient


def _add_mounting(
    total: Chain,
    chain: Chain,
    at: np.ndarray,
    mounting: np.ndarray,
    turns: AnyArray,
    weight: float,
) -> None:
    """Add what a unit's equations say of its mounting: (nodes, 9, 3) `turns` take it to the node's attitudes."""
    by = chain.diagonal @ turns
    by[1:] += chain.lower @ turns[:-1]
    by[:-1] += np.swapaxes(chain.lower, 1, 2) @ turns[1:]
    total.border[:, :, mounting] += weight * by
    across = weight * np.einsum("kdm,kdb->mb", turns, chain.border)
    total.corner[np.ix_(mounting, at)] += across
    total.corner[np.ix_(at, mounting)] += across.T
    total.corner[np.ix_(mounting, mounting)] += weight * np.einsum("kdm,kdn->mn", turns, by)
    total.corner_gradient[mounting] += weight * np.einsum("kdm,kd->m", turns, chain.gradient)


def _move(units: Sequence[ArrayUnit], sections: Sequence[_Common], step: Series) -> None:
    """Move everything by a step of what is adjusted."""
    starts = np.cumsum([0, *(unit.free.size for unit in units)])
    mountings = step[starts[-1] :].reshape(-1, 3)
    first = units[0]
    for number, made in enumerate(sections):
        border = np.concatenate([made.chain.own_step(step), step])
        earth, nodes = border[EARTH], made.chain.nodes_step(border)
        section = first.task.sections[number]
        turns = section.C_wb.reshape(len(nodes), NODE, 3)
        for u, part in enumerate(made.parts):
            own = nodes if u == 0 else nodes + turns @ mountings[u - 1]
            outside = np.concatenate([earth, step[starts[u] : starts[u + 1]]])
            inners: list[tuple[Eliminated, Series]] = []
            for place, inner in part.within:
                ends = [own[place.node, place.at_node], own[place.node + 1, place.at_next]]
                inners.append((inner, np.concatenate([*ends, outside])))
            move_all(inners)
        assert made.parts[0].stretch is not None
        made.parts[0].stretch.move(nodes, earth)
    for u, unit in enumerate(units):
        values = unit.task.unknowns.values.copy()
        values[unit.free] += step[starts[u] : starts[u + 1]]
        unit.task.unknowns = unit.task.unknowns.at(values)
        if u:
            unit.C_1b = matrix_from_rotation_vector(mountings[u - 1]) @ unit.C_1b
            for own, common in zip(unit.task.sections, first.task.sections, strict=True):
                own.C_wb, own.earth_w = common.C_wb @ unit.C_1b, common.earth_w.copy()


def _solution(units: list[ArrayUnit], sections: Sequence[_Common], covariance: Square) -> ArraySolution:
    """Sums of squares at the solution, and those of the units by themselves."""
    # Each part counts nodes and an Earth rate as its own: they are common to all.
    nodes = sum(NODE * (section.last - section.first) + 3 for section in units[0].task.sections)
    checks = sum(part.checks for made in sections for part in made.parts) + (len(units) - 1) * nodes
    known = sum(unit.task.prior.rank for unit in units if unit.task.prior is not None)
    alone = [unit.outcome.balanced.solution for unit in units]
    squares = sum(s.square_sum / unit.scale for s, unit in zip(alone, units, strict=True))
    return ArraySolution(
        units,
        covariance,
        sum(made.square_sum for made in sections),
        checks - len(covariance) + known,
        squares,
        sum(s.redundancy for s in alone),
    )
