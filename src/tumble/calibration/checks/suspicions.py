"""Do biases jump or drift during the recording, by a knock, the supply or warming up? Then numbers are less certain.

A table that did not turn as the protocol says: in one rotation, at one rate, about one axis, or in all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from tumble.arrays import AnyArray, Series, Vectors
from tumble.calibration.equations.adjustment import JointAdjustment
from tumble.calibration.equations.causes import RATE_WANDER
from tumble.calibration.equations.imu_unknowns import LAYOUT, force_matrix, gyro_matrix
from tumble.calibration.equations.observed import TableRotation
from tumble.calibration.equations.rotation_equations import TableRate
from tumble.calibration.outcome.settled import BiasCourse
from tumble.calibration.prior import together
from tumble.estimation import (
    Alternative,
    Equations,
    Found,
    Linear,
    Suspect,
    covariance_about_the_mean,
    find,
    first_of_neighbours,
)

# Chance that what a triad's biases wander by looks like a jump on any axis anywhere, which makes a right result unfit,
# or like a drift, which is counted.
JUMP_FALSE_ALARM, DRIFT_FALSE_ALARM = 0.0005, 0.005
# Holds needed on either side of a jump to tell it from one odd hold.
SMALLEST_SIDE = 4
# Time constants of drifts that are tried, in lengths of the recording: the longest is all but a straight line.
TIME_CONSTANTS = (0.05, 0.1, 0.2, 0.4, 1.0, 5.0)
# Beyond so many holds and turns neighbours are taken together: the cost grows with the square of the stretches.
MOST_STRETCHES = 60
# Of a jump, as a share of its squares: what less is left of is hidden.
HIDDEN = 0.02
# Of a course's largest size: axes that do less are counted, and not said.
SAID = 0.1


def hidden_jumps(up: Vectors) -> list[int]:
    """Return the holds after which biases could jump and nothing in the holds would show it.

    A jump is hidden where it is the same as other scale factors, angles and biases: where "after it" is, over all
    holds, a number and a linear function of the direction up. So it is where all faces up come before all faces down.

    Parameters
    ----------
    up : (holds, 3) unit vectors of the corrected specific force, in the order of time.
    """
    holds = len(up)
    design, _ = np.linalg.qr(np.hstack([np.ones((holds, 1)), up]))
    # Squares of ones up to each hold, zeros after it: less the design's part, and less the mean.
    earlier = np.arange(1.0, holds)
    left = earlier - np.sum(np.cumsum(design, axis=0)[:-1] ** 2, axis=1)
    shown = left / (earlier * (1.0 - earlier / holds))
    return np.flatnonzero(shown < HIDDEN).tolist() if holds > design.shape[1] + 1 else []


class TriadBiases:
    """The biases of a triad, that may jump or drift: what is declared of them, and what follows from what is found.

    Parameters
    ----------
    task : settled.
    source : of the wander that they have without a fault.
    """

    def __init__(self, task: JointAdjustment, source: str) -> None:
        base, self.of_gyros = task.data.base, source == RATE_WANDER
        self.source, self.name = source, "gyros" if self.of_gyros else "accelerometers"
        self.start, self.stop = base.time[base.head[:, 0]], base.time[base.tail[:, 1] - 1]
        turns = task.data.turns if self.of_gyros else np.array(sorted(task.data.rotations), dtype=int)
        matrix = gyro_matrix(task.unknowns) if self.of_gyros else force_matrix(task.unknowns)
        self._raw = np.linalg.norm(matrix, axis=1)
        begin = np.concatenate([self.start, self.stop[turns]])
        end = np.concatenate([self.stop, self.start[turns + 1]])
        order, first = np.argsort(begin, kind="stable"), first_of_neighbours(begin.size, MOST_STRETCHES)
        begin, end = begin[order][first], np.maximum.reduceat(end[order], first)
        group = np.searchsorted(first, np.argsort(order), side="right") - 1
        self._of_hold, self._of_turn = group[: self.start.size], np.full(self.start.size, -1)
        self._of_turn[turns] = group[self.start.size :]
        self._middle = 0.5 * (begin + end)
        wanders = (
            covariance_about_the_mean(begin, end, (float(begin[0]), float(end.max()))),
            np.eye(begin.size),
        )
        self._suspect = Suspect(self._columns, begin.size, 3, wanders, apart=self.of_gyros)
        # Of holds that are taken together the first one is the first after a jump.
        after = np.unique(self._of_hold, return_index=True)[1]
        self._before = after[(after >= SMALLEST_SIDE) & (after <= self.start.size - SMALLEST_SIDE)] - 1
        self._constants = np.array(TIME_CONSTANTS) * max(float(np.ptp(self._middle)), 1e-9)

    def _columns(self, equations: Equations, linear: Linear) -> AnyArray | None:
        """By the bias over each stretch of holds, turns and rotations."""
        held, turned = ("rate", ("turn", "links")) if self.of_gyros else ("force", ("windows",))
        if equations.kind != held and equations.kind not in turned:
            return None
        assert linear.by_bias is not None
        terms, width, _ = linear.by_bias.shape
        place = (self._of_hold if equations.kind == held else self._of_turn)[equations.place]
        made = np.zeros((terms, width, self._suspect.places, 3))
        made[np.arange(terms), :, np.broadcast_to(place, terms)] = linear.by_bias
        return made.reshape(terms, width, -1)

    @cached_property
    def jumps(self) -> Alternative:
        """Between any two holds, on any axes."""
        later = np.arange(self._suspect.places) >= self._of_hold[self._before + 1][:, None]
        shapes = np.asarray(later, dtype=np.float64)
        return Alternative(f"jump of the {self.name}", self._suspect, shapes, JUMP_FALSE_ALARM, self._jump)

    @cached_property
    def drifts(self) -> Alternative:
        """That fade."""
        shapes = np.exp(-(self._middle - self._middle[0]) / self._constants[:, None])
        name = f"drift of the {self.name}"
        return Alternative(name, self._suspect, shapes, DRIFT_FALSE_ALARM, self._drift, all_axes=True)

    def course(self, found: Found) -> BiasCourse:
        """Return how the biases go by what was found, raw.

        Parameters
        ----------
        found : of one of the families.
        """
        until = 0.5 * float(self.start[-1] + self.stop[-1])
        if found.alternative is self.drifts:
            constant = float(self._constants[found.shape])
            return BiasCourse(None, constant, float(self._middle[0]), until, found.size)
        k = int(self._before[found.shape])
        return BiasCourse(k, np.inf, 0.5 * float(self.stop[k] + self.start[k + 1]), until, found.size)

    def _jump(self, found: Found) -> str:
        course = self.course(found)
        assert course.after is not None
        where = f"between hold {course.after + 1} and hold {course.after + 2}, at about {course.since:.0f} s"
        return (
            f"The biases of the {self.name} jump {where}, {self._sizes(found.size, found.sigma)}: the unit was "
            "switched on anew or knocked there, or it is another unit's recording from there on. The stated biases are "
            "means of both; their uncertainties count how far the last ones are off. Calibrate each part by itself, or "
            "with --turn-ons if both are this unit's."
        )

    def _drift(self, found: Found) -> str:
        course = self.course(found)
        change = -course.departure(np.array([course.since]))[0]
        sigma = found.sigma * np.abs(change) / np.maximum(np.abs(found.size), 1e-300)
        return (
            f"The biases of the {self.name} drift {self._sizes(change, sigma)}, from the first hold to the last (time "
            f"constant about {course.constant:.2g} s), as of a unit that warms up. The stated biases are means; the "
            "uncertainties count how far the last ones are off, and what that does to other numbers. Let the unit warm "
            "up before recording."
        )

    def _sizes(self, raw: Series, sigma: Series) -> str:
        """By how much each axis that does so changes, in words."""
        unit, factor = ("°/s", np.degrees(1.0)) if self.of_gyros else ("mm/s²", 1e3)
        size, sigma = factor * raw / self._raw, factor * sigma / self._raw
        axes = np.flatnonzero(np.abs(size) > SAID * np.max(np.abs(size))).tolist()
        return "by " + ", ".join(f"{'xyz'[k]} {size[k]:+.2g} ± {sigma[k]:.1g}" for k in axes) + f" {unit}"


def find_courses(task: JointAdjustment, sources: Sequence[str]) -> list[tuple[TriadBiases, Found]]:
    """Return how the biases of the triads jump or drift.

    Parameters
    ----------
    task : settled.
    sources : of the wanders of the triads that the recording has.

    Raises
    ------
    ObservabilityError
        If what was recorded does not determine the unknowns.

    Notes
    -----
    What biases wander by is no noise here: it is taken away, and sought anew with each alternative. Were a part of it
    counted as noise that each hold has for itself, too, a wander that neighbours share would look like a jump.
    """
    found: list[tuple[TriadBiases, Found]] = []
    for source in sources:
        triad, trials = TriadBiases(task, source), [task.copy()]
        kind = "rate" if triad.of_gyros else "force"
        trials[0].noise, trials[0].data = task.noise.copy(), task.data.without_wander(kind)
        trials[0].noise.added[kind] = 0.0
        # Where there is no gyro nothing of its rate takes part.
        if not np.all(task.taking_part[kind]):
            trials.append(trials[0].copy())
            trials[1].taking_part[kind][:] = True
        found += [(triad, one) for one in find(trials, [triad.jumps, triad.drifts])]
    return sorted(found, key=lambda one: one[1].rarity)


# Chance that right rates look wrong in any of these ways.
FALSE_ALARM = 1e-3
# Rates on a table's display are further apart than this share; the Earth's rotation adds less to one of them.
SAME_RATE = 0.02
# A share that no gyro's nonlinearity reaches.
LEAST = 0.002
# Turns tell of attitudes a millionth of what a table's display tells of its angle.
TELLING = 1e-7


class WrongRates:
    """A table's rotations with believed rates, and what may be wrong with them: amplitudes are angles, rad.

    Parameters
    ----------
    task : settled.
    believed : share by which the rates are believed to be off at most, one sigma; None if nobody says: then what all of
        them have in common is no contradiction.
    """

    def __init__(self, task: JointAdjustment, believed: float | None) -> None:
        self.task, self.believed, self.spins = task, believed or 0.0, _believed_spins(task)
        self._at = {k: at for at, k in enumerate(self.spins)}
        turns = [k for k in task.data.turns.tolist() if k not in task.data.rotations]
        self._turn = {k: len(self._at) + 3 * at for at, k in enumerate(turns)}
        places = len(self._at) + 3 * len(turns)
        time, rates = task.data.base.time, np.array([abs(s.turn_rate or 0.0) for s in self.spins.values()])
        angles = rates * [time[s.centres[-1]] - time[s.centres[0]] for s in self.spins.values()]
        self._groups = _groups(task, self.spins, rates)
        if believed is None:
            del self._groups[""]
        shapes = np.zeros((len(self._groups), places))
        for shape, own in zip(shapes, self._groups.values(), strict=True):
            shape[own] = angles[own]
        turned = np.arange(places) < len(self._at)
        kinds = ~turned, turned, np.ones(places, dtype=bool)
        wanders = [np.asarray(np.diag(1.0 * of), dtype=np.float64) for of in kinds]
        suspect = Suspect(self._columns, places, 1, wanders, telling=TELLING)
        self.alternative = Alternative("wrong rate", suspect, shapes, FALSE_ALARM, self._say)

    def _columns(self, equations: Equations, linear: Linear) -> AnyArray | None:
        """By how far each rotation went beyond what was believed, and by what else each turn shows."""
        width, places = linear.residual.shape[1], self.alternative.suspect.places
        if isinstance(equations, TableRate) and width == 1 and equations.stretch.k in self._at:
            return -np.eye(1, places, self._at[equations.stretch.k])[:, None]
        if equations.kind != "turn":
            return None
        made = np.zeros((len(linear.residual), 3, places))
        for at, k in enumerate(equations.place.tolist()):
            made[at, :, self._turn[k] : self._turn[k] + 3] = np.eye(3)
        return made

    def trial(self) -> JointAdjustment:
        """Return the task without the noise that wrong rates may have left there, and with the belief as a prior."""
        trial = self.task.copy()
        trial.noise = self.task.noise.copy()
        trial.noise.added.update({"turn": 0.0, "table rate": 0.0})
        (place,) = LAYOUT.indices("table_rate")
        if place not in trial.unknowns.free and self.believed > 0.0:
            trial.unknowns = trial.unknowns.with_free(np.union1d(trial.unknowns.free, [place]))
            trial.prior = together(
                trial.prior, LAYOUT.sparse_prior(trial.unknowns.values, {"table_rate": self.believed})
            )
        return trial

    def matters(self, found: Found) -> bool:
        """Whether it is more than gyros bend, where not all rates are wrong alike."""
        return not self._named(found)[0] or abs(float(found.size[0])) > LEAST

    def _named(self, found: Found) -> tuple[str, int]:
        """Which rotations it is about, in words, and how many they are."""
        name, own = list(self._groups.items())[found.shape]
        return name, own.size

    def _say(self, found: Found) -> str:
        off, sigma = 100.0 * float(found.size[0]), 100.0 * float(found.sigma[0])
        name, count = self._named(found)
        if not name:
            return (
                f"The turns between the holds show that the table turned {abs(off):.2g} % (± {sigma:.1g} %) "
                f"{'faster' if off > 0.0 else 'slower'} than the protocol says. It promises "
                f"{1e6 * self.believed:.2g} ppm. Check its rates and the sample rate, or state what the table keeps "
                "(`uncertainty_ppm`)."
            )
        if count > 1:
            return (
                f"The {count} spins {name} show {off:+.2g} % (± {sigma:.1g} %) more than the others: the table did not "
                "turn as the protocol says, or the gyros saturate or bend there."
            )
        return (
            f"In {name} the gyros show {abs(off):.2g} % (± {sigma:.1g} %) {'more' if off > 0.0 else 'less'} than the "
            "rate that the protocol states. Look at the table's rate there."
        )


def _groups(task: JointAdjustment, spins: dict[int, TableRotation], rates: Series) -> dict[str, np.ndarray]:
    """In words, which rotations may be wrong together: all, those at one rate, those about one axis, each."""
    order = np.argsort(rates)
    axis = np.array([int(np.argmax(np.abs(task.rotations[k].axis_b))) for k in spins])
    step = np.flatnonzero(np.diff(np.log(np.maximum(rates[order], 1e-30))) > SAME_RATE) + 1
    alike = {f"at {np.degrees(rates[own[0]]):.4g}°/s": own for own in np.split(order, step)}
    alike |= {f"about {'xyz'[a]}": np.flatnonzero(axis == a) for a in sorted({*axis.tolist()})}
    some = {name: own for name, own in alike.items() if 1 < own.size < order.size}
    return {"": order} | some | {spin.name: np.array([at]) for at, spin in enumerate(spins.values())}


def find_wrong_rates(task: JointAdjustment, believed: float | None) -> list[str]:
    """Return sentences on rates of a table that what was recorded contradicts.

    Parameters
    ----------
    task : settled.
    believed : share by which the rates are believed to be off at most, one sigma; None if nobody says.
    """
    if not _believed_spins(task):
        return []
    suspected = WrongRates(task, believed)
    return [one.said for one in find([suspected.trial()], [suspected.alternative]) if suspected.matters(one)]


def _believed_spins(task: JointAdjustment) -> dict[int, TableRotation]:
    """Rotations whose rate is believed, and of which it was not left out, by the hold before."""
    taking_part = task.taking_part["table rate"]
    rated = {k: s for k, s in task.data.rotations.items() if s.turn_rate is not None and taking_part[k]}
    return {k: spin for k, spin in rated.items() if len(spin.windows) > 1}
