"""A table that did not turn as the protocol says: in one rotation, at one rate, about one axis, or in all of them."""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.calibration.equations.adjustment import JointAdjustment
from tumble.calibration.equations.imu_unknowns import LAYOUT
from tumble.calibration.equations.observed import TableRotation
from tumble.calibration.equations.rotation_equations import TableRate
from tumble.calibration.prior import together
from tumble.estimation.alternatives import Alternative, Found, Suspect, find
from tumble.estimation.equations import Equations, Linear

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
