"""What a target cannot hold, as sentences with sizes in the units that people say."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tumble.arrays import Matrix, Vectors
from tumble.attitude import twenty_six_directions
from tumble.parameters import amount
from tumble.records import dataclass
from tumble.sensor import ImuModel, Triad
from tumble.units import STANDARD_GRAVITY

Pairs = Sequence[tuple[ImuModel, ImuModel]]
"""True models, and what stands in their place."""
_ROUND_OFF = 1e-9  # m/s² and rad/s, of a correction and its inverse


@dataclass(frozen=True)
class Loss:
    """Something that is not written.

    Attributes
    ----------
    text : what, and how large, without a full stop.
    size : of the true vector's length, where a limit makes sense.
    """

    text: str
    size: float | None = None


def of_matrix(triad: Triad, kept: Matrix, name: str, what: str) -> list[Loss]:
    """Return the loss of a matrix that is replaced by another one.

    Parameters
    ----------
    triad : the true one.
    kept : (3, 3) forward matrix that the target's correction takes out.
    name : of the sensors, in the plural.
    what : is left out.
    """
    wrong = np.linalg.solve(kept, triad.matrix) - np.eye(3)
    size = float(np.linalg.norm(wrong, 2))
    if size < 1e-9:
        return []
    where = f"{1e6 * size:.0f} µg in 1 g" if name == "accelerometers" else f"{size:.2g} rad/s at 1 rad/s"
    return [Loss(f"the {name}' {what} are left out: up to {1e6 * size:.0f} ppm, {where}", size)]


def of_bias(triad: Triad, name: str) -> list[Loss]:
    """Return the loss of a bias."""
    size = float(np.linalg.norm(np.linalg.solve(triad.matrix, triad.bias)))
    if size == 0.0:
        return []
    unit = "m/s^2" if name == "accelerometers" else "rad/s"
    return [Loss(f"the {name}' biases are left out: {amount(size, unit)}")]


def of_temperature(pairs: Pairs, celsius: float, span: str) -> Loss:
    """Return the loss of everything that changes with temperature.

    Parameters
    ----------
    pairs : the true models over the calibrated span, each with that of one temperature.
    celsius : that temperature.
    span : in words.
    """
    force, rate = _worst(pairs)
    return Loss(
        f"what changes with temperature is left out, the numbers hold at {celsius:g} °C: up to "
        f"{amount(force, 'm/s^2')} and {amount(rate, 'rad/s')}{span}"
    )


def in_all(pairs: Pairs, span: str, *, corrects: bool) -> list[Loss]:
    """Return how far corrected vectors are off if they are corrected by a file alone, with all that it does not hold.

    Parameters
    ----------
    pairs : the true model, and what the file has in its place.
    span : of temperature, in words.
    corrects : whether the file holds anything that corrects.
    """
    force, rate = _worst(pairs)
    if not force and not rate:
        return []
    what = "in all, what this file corrects is" if corrects else "this file corrects nothing: raw numbers are"
    return [
        Loss(
            f"{what} off by up to {amount(force, 'm/s^2')} and {amount(rate, 'rad/s')}, over 26 directions each of 1 g "
            f"and of 1 rad/s{span}"
        )
    ]


def _worst(pairs: Pairs) -> tuple[float, float]:
    """The largest errors, m/s² and rad/s, over 26 directions each of 1 g and of 1 rad/s."""
    directions = twenty_six_directions()
    force: Vectors = np.repeat(STANDARD_GRAVITY * directions, len(directions), axis=0)
    rate: Vectors = np.tile(directions, (len(directions), 1))
    off = np.zeros(2)
    for true, kept in pairs:
        got_force, got_rate = kept.correct(*true.distort(force, rate))
        here = [
            np.linalg.norm(got_force - force, axis=1).max(),
            np.linalg.norm(got_rate - rate, axis=1).max(),
        ]
        off = np.maximum(off, here)
    return tuple(np.where(off > _ROUND_OFF, off, 0.0).tolist())


def of_g_sensitivity(gyroscope: Triad, sensitivity: Matrix) -> Loss:
    """Return the loss of a g-sensitivity."""
    size = float(np.linalg.norm(np.linalg.solve(gyroscope.matrix, sensitivity), 2)) * STANDARD_GRAVITY
    return Loss(f"the gyros' g-sensitivity is left out: up to {amount(size, 'rad/s')} in 1 g")


def of_nonlinearity(triad: Triad, name: str) -> list[Loss]:
    """Return the loss of the curves that a triad has, at 1 g or 1 rad/s."""
    at = STANDARD_GRAVITY if name == "accelerometers" else 1.0
    own = at * np.linalg.norm(triad.matrix, axis=1)
    sizes = {one: float(np.max(np.abs(by) * own**curve.power)) for one, curve, by in triad.curves()}
    size = sum(sizes.values())
    if size == 0.0:
        return []
    where = "1 g" if name == "accelerometers" else "1 rad/s"
    what = " and ".join(sizes)
    return [Loss(f"the {name}' {what} terms are left out: up to {1e6 * size:.0f} ppm at {where}", size)]


def of_lever_arms(lever_arms: Matrix) -> Loss:
    """Return the loss of lever arms, at 1 rad/s."""
    apart = float(np.max(np.linalg.norm(lever_arms[:, None] - lever_arms[None], axis=2)))
    return Loss(
        f"the accelerometers' lever arms are left out: they are up to {1e3 * apart:.2g} mm apart, which is "
        f"{1e3 * apart:.2g} mm/s² at 1 rad/s"
    )
