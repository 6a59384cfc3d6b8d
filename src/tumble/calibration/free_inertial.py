"""What a calibration is worth to a user: errors of attitude after a turn, and of position without aiding.

To first order, and in closed form. A unit that is calibrated with parameter errors dp shows, where the true
specific force is f and the true rate is w,

    df = -D^-1 (dM f + db + ...),    dw = -M_g^-1 (dM_g w + dG f + db_g + G df)

At rest f is g upwards. After t seconds from a known attitude, velocity and position

    position error = df t²/2 + (dw x f) t³/6

because the attitude is off by dw t and takes gravity for an acceleration. During a turn by the angle a about n,
each radian adds ``(dM_g n)`` in the axes that the unit has then, which sums to
``a (n.e) n + sin a e_across + (1 - cos a) n x e_across``, and the same with the bias over the turn's time.

Left out: the sensors' noise and the wander of their biases, the Earth's rate times the scale errors, and the
Schuler oscillation, which holds the growth back by 4 % after ten minutes.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from tumble.arrays import Square, Table, Vector, inverted
from tumble.attitude import left_jacobian, skew
from tumble.records import dataclass
from tumble.sensor import CURVES, ImuModel, Triad

LONGEST = 600.0
"""s, beyond which the closed forms are off by more than 4 %."""
_ENTRIES = (
    *(f"{kind}.{term}" for kind in ("accelerometer", "gyroscope") for term in ("bias", "matrix", *CURVES)),
    "gyroscope.g_sensitivity",
)


@dataclass(frozen=True)
class Predicted:
    """A predicted error of three components, in b.

    Attributes
    ----------
    covariance : (3, 3) m² or rad².
    parts : group of parameters -> (3, 3), each alone; with the correlations between them they add up.
    """

    covariance: Square
    parts: dict[str, Square]

    def across(self, direction: Vector) -> float:
        """Return the root sum square of both standard uncertainties across a unit vector."""
        plane = np.eye(3) - np.outer(direction, direction)
        return float(np.sqrt(max(float(np.trace(plane @ self.covariance @ plane)), 0.0)))

    def shares_across(self, direction: Vector) -> dict[str, float]:
        """Return group -> its own share of the variance across a unit vector, 0 to 1 or so."""
        plane = np.eye(3) - np.outer(direction, direction)
        whole = max(self.across(direction) ** 2, 1e-300)
        return {name: float(np.trace(plane @ part @ plane)) / whole for name, part in self.parts.items()}


@dataclass(frozen=True)
class CalibratedUnit:
    """A sensor model with the covariance of its parameters.

    Attributes
    ----------
    model : both triads or one.
    names, covariance : canonical parameters, as `calibration.json` lists them.
    gravity : m/s².
    """

    model: ImuModel
    names: Sequence[str]
    covariance: Square
    gravity: float

    def position_error(self, seconds: float, up_b: Vector) -> Predicted:
        """Return the position error at rest after some time of free inertial navigation, m in b.

        Parameters
        ----------
        seconds : s since attitude, velocity and position were known.
        up_b : (3,) unit vector, which direction of b points up.

        Raises
        ------
        ValueError
            If the time is not between 0 and ten minutes.
        """
        if not 0.0 < seconds <= LONGEST:
            raise ValueError(
                f"free inertial navigation is predicted for up to {LONGEST:g} s, not {seconds:g} s"
            )
        force = self.gravity * up_b
        by_force, by_rate = self.output_errors(force, np.zeros(3))
        moved = position_from(by_force, by_rate, force, seconds)
        return self._predicted(moved)

    def attitude_error(self, axis_b: Vector, angle: float, seconds: float, up_b: Vector) -> Predicted:
        """Return the attitude error after a turn, rad, in the axes that b has before it.

        Parameters
        ----------
        axis_b : (3,) unit vector about which it turns at a constant rate.
        angle, seconds : rad, and s that it takes.
        up_b : (3,) unit vector, which direction of b points up before the turn: for the g-sensitivity, which is
            taken with the force that acts then.

        Raises
        ------
        ValueError
            If the turn takes no time.
        """
        if not seconds > 0.0:
            raise ValueError("a turn takes some time")
        rate = angle / seconds
        _, by_rate = self.output_errors(self.gravity * up_b, rate * axis_b)
        return self._predicted(left_jacobian(angle * axis_b) @ by_rate * seconds)

    def output_errors(self, force: Vector, rate: Vector) -> tuple[Table, Table]:
        """Return by how much the corrected specific force and rate move with each parameter, (3, parameters).

        Parameters
        ----------
        force, rate : (3,) m/s² and rad/s in b, true.
        """
        by_force = triad_errors("accelerometer", self.model.accelerometer, self.names, force)
        by_rate = triad_errors("gyroscope", self.model.gyroscope, self.names, rate)
        if self.model.gyroscope is not None:
            inverse = inverted(self.model.gyroscope.matrix)
            columns, i, j = places_of(tuple(self.names))["gyroscope.g_sensitivity"]
            by_rate[:, columns] -= inverse[:, i] * force[j]
            if self.model.g_sensitivity is not None:
                by_rate -= inverse @ self.model.g_sensitivity @ by_force
        return by_force, by_rate

    def _predicted(self, moved: Table) -> Predicted:
        parts: dict[str, Square] = {}
        for group, (at, _, _) in places_of(tuple(self.names)).items():
            if at.size:
                parts[group] = moved[:, at] @ self.covariance[np.ix_(at, at)] @ moved[:, at].T
        return Predicted(moved @ self.covariance @ moved.T, parts)


def position_from(by_force: Table, by_rate: Table, force: Vector, seconds: float) -> Table:
    """Return the position error, m, of constant errors of specific force and rate at rest: (3, ...).

    Parameters
    ----------
    by_force, by_rate : (3, ...) m/s² and rad/s.
    force : (3,) the specific force at rest, g upwards.
    seconds : s from a known start.
    """
    return 0.5 * seconds**2 * by_force - (seconds**3 / 6.0) * (skew(force) @ by_rate)


def triad_errors(kind: str, triad: Triad | None, names: Sequence[str], true: Vector) -> Table:
    """Return (3, parameters) by how much the corrected output moves with each of the triad's own parameters.

    Parameters
    ----------
    kind, triad : "accelerometer" or "gyroscope", and it; None for none.
    names : of all parameters, as `calibration.json` lists them.
    true : (3,) m/s² or rad/s in b.
    """
    moved = np.zeros((3, len(names)))
    if triad is None:
        return moved
    own = triad.matrix @ true
    slope = triad.slope(own)
    inverse = inverted(slope[:, None] * triad.matrix)
    for entry, (columns, i, j) in places_of(tuple(names)).items():
        group, _, term = entry.partition(".")
        if group != kind or not columns.size or term == "g_sensitivity":
            continue
        # What the raw output would be more with the parameter larger by one.
        if term == "matrix":
            more = slope[i] * true[j]
        else:
            more = np.ones(i.size) if term == "bias" else CURVES[term].of(own)[i]
        moved[:, columns] = -inverse[:, i] * more
    return moved


@cache
def places_of(names: tuple[str, ...]) -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return group of parameters -> its columns among the names, and the axis and the input of each.

    Parameters
    ----------
    names : canonical, as `calibration.json` lists them.
    """
    made: dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
    for group in _ENTRIES:
        columns = [column for column, name in enumerate(names) if name.startswith(f"{group}[")]
        at = [[int(part) for part in names[c][len(group) + 1 : -1].split(",")] for c in columns]
        made[group] = (
            np.array(columns, dtype=int),
            np.array([one[0] for one in at], dtype=int),
            np.array([one[-1] for one in at], dtype=int),
        )
    return made


def nominal_errors(
    model: ImuModel, force: Vector, rate: Vector, factors: tuple[float | None, float | None]
) -> tuple[Vector, Vector] | None:
    """Return what an uncalibrated unit shows too much: (3,) m/s² and rad/s; None for counts.

    Parameters
    ----------
    model : the calibration, taken as true.
    force, rate : (3,) true, in b.
    factors : SI per raw unit of both triads, None for counts.
    """
    if factors[0] is None or factors[1] is None or model.accelerometer is None or model.gyroscope is None:
        return None
    raw_force, raw_rate = model.distort(force[None], rate[None])
    return np.asarray(factors[0] * raw_force[0] - force), np.asarray(factors[1] * raw_rate[0] - rate)


def sheet_unit(
    bias: tuple[float, float], scale: tuple[float, float], lean: tuple[float, float], gravity: float
) -> CalibratedUnit:
    """Return a unit as its data sheet has it: ideal triads with the sheet's spreads as independent uncertainties.

    Parameters
    ----------
    bias : m/s² and rad/s, one sigma.
    scale, lean : 1 and rad: scale factors and the leaning of a sensing axis in each direction.
    gravity : m/s².
    """
    names, variances = list[str](), list[float]()
    for at, kind in enumerate(("accelerometer", "gyroscope")):
        names += [f"{kind}.matrix[{i},{j}]" for i in range(3) for j in range(3)]
        names += [f"{kind}.bias[{i}]" for i in range(3)]
        spread = np.where(np.eye(3, dtype=bool), scale[at], lean[at])
        variances += [*np.square(spread).ravel().tolist(), *[bias[at] ** 2] * 3]
    ideal = ImuModel(Triad(np.eye(3), np.zeros(3)), Triad(np.eye(3), np.zeros(3)))
    return CalibratedUnit(ideal, tuple(names), np.diag(variances), gravity)
