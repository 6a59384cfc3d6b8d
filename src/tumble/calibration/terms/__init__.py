"""Optional terms: kept if the data want them.

A term's record stands here with its physics. From it follow its unknowns among all others, its derivatives, its tests,
its parameters in the result, and its words. Lever arms are also taken out of samples here (`LeverArms`).

An asymmetry is half of the relative difference of the scale factors for both signs, or both ways round. A quadratic
term is the squared own input beside it; of gyros turns at several rates show it. G-sensitivity is what a gyro shows of
the specific force along each axis. A lag between the triads shows while a table turns gravity round, for accelerometers
that are read later see it where it was: gravity has moved by ``lag`` times the rate.

An accelerometer at ``r`` feels ``w x (w x r) + dw/dt x r`` more than the point that places are counted from (size
effect).

Which places can be told: each rotation has a lever arm of its own, from the axis to the unit, which takes up
all that is across its axis u. What is left is along it, ``w² (sum of u_i² u_j r_ij - u_j r_jj)`` over all i and j,
with accelerometer i's place along j: of each pair the place along j against accelerometer j's own, six in all, and
of the sum of the squares of u nothing. So the point to count from is free, and is chosen such that ``r_jj = 0``.
Axes x, y and z tell none of them, for nothing is left of ``u_i² u_j``; an edge between x and y tells one sum of
``r_xy`` and ``r_yx``, the other edge their difference. As parameters they are named one by one where the motion tells
each; where it tells only the sum or the difference of two, that is named.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Table, Vector, Vectors, inverted
from tumble.attitude import skews
from tumble.calibration.terms.term import KINDS, PAIRS_OF_AXES, Complex, Label, Parameters, Term
from tumble.errors import UsageError
from tumble.estimation import Block, Unknowns
from tumble.parameters import FAMILIES, LAG, parameter_of
from tumble.sensor import CURVES, ImuModel

# One and several of each curve's terms.
_CURVES = {"asymmetry": ("asymmetry", "asymmetries"), "quadratic": ("quadratic term", "quadratic terms")}


PAIRS = ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))
"""Of the lever arms that are unknown: whose, and along which axis."""
# Accelerometers of a unit sit so far apart, one sigma.
APART = 0.03  # m
# What is less certain than this share of what a unit may have, itself counted, is no result: 0.5 / √1.25 of `prior`.
WORTH_NAMING = 0.45
# Two lever arms whose sum or difference is so much better known than they are by themselves are named by these.
TOGETHER = 0.5
_ARM, _ARMS = FAMILIES["accelerometer lever arm"], FAMILIES["accelerometer lever arms"]
# Across a longer gap between samples an angular acceleration says nothing.
LONGEST_STEP = 0.1  # s


class LeverArms:
    """Lever arms at work on consecutive blocks of a recording: the last sample of a block is kept for the next."""

    def __init__(self, arms: Matrix, matrix: Matrix) -> None:
        """Begin at the start of a recording.

        Parameters
        ----------
        arms : (3, 3) m in b, a row each accelerometer.
        matrix : (3, 3) of the accelerometers, true to raw.
        """
        self.arms, self.matrix = arms, matrix
        self._back = inverted(matrix)
        self._last: tuple[float, Vector] | None = None

    @staticmethod
    def of(arms: Sequence[Sequence[float]] | None, model: ImuModel) -> LeverArms | None:
        """Return them as a document has them; None where there are none."""
        if arms is None or model.accelerometer is None:
            return None
        return LeverArms(np.array(arms, dtype=np.float64), model.accelerometer.matrix)

    def taken_out(self, force: Vectors, rate: Vectors, time: Series | None) -> Vectors:
        """Return the specific force (m/s²) at the point that lever arms are counted from.

        The angular acceleration is what the rate changed by since the sample before, over the time between: it
        comes half a sample late, and adds up to the change of the rate exactly.

        Parameters
        ----------
        force, rate : (samples, 3) corrected otherwise, in b, m/s² and rad/s.
        time : (samples,) s.

        Raises
        ------
        UsageError
            If there is no time.
        """
        if not len(force):
            return force
        if time is None:
            raise UsageError(
                "The calibration has lever arms of the accelerometers, which need the angular acceleration: give the "
                "time of the samples."
            )
        turned = skews(rate)
        by_place = turned @ turned + skews(self._accelerations(rate, np.asarray(time, dtype=np.float64)))
        felt: AnyArray = np.einsum("nij,aj->nai", by_place, self.arms)
        # Each accelerometer along its own sensing axis, which leans a little.
        raw = np.einsum("ab,nab->na", self.matrix, felt)
        return np.asarray(force - raw @ self._back.T, dtype=np.float64)

    def _accelerations(self, rate: Vectors, time: Series) -> Vectors:
        before = (time[0], rate[0]) if self._last is None else self._last
        self._last = (float(time[-1]), rate[-1].copy())
        step = np.diff(time, prepend=before[0])
        change = np.diff(rate, axis=0, prepend=before[1][None])
        usable = (step > 0.0) & (step <= LONGEST_STEP)
        return np.where(usable[:, None], change / np.where(usable, step, 1.0)[:, None], 0.0)


def forces_apart(u: Unknowns, centripetal: AnyArray) -> AnyArray | None:
    """Return (windows, 3, 3) m/s² that each accelerometer feels beyond the unit; None where all are at one place.

    Parameters
    ----------
    u : where the unknowns are.
    centripetal : (windows, 3, 3) 1/s², the squared cross matrix of the rate.
    """
    arms = u["lever_arms"].reshape(3, 3)
    return np.einsum("nij,aj->nai", centripetal, arms) if np.any(arms) else None


def by_lever_arms(by_true: AnyArray, centripetal: AnyArray) -> AnyArray:
    """Return (windows, 3, 9) derivatives of the raw force by the lever arms, sensor by sensor.

    Parameters
    ----------
    by_true : (windows, 3, 3) derivatives by the true force.
    centripetal : of the windows.
    """
    own = np.einsum("nab,nbj->naj", by_true, centripetal)
    made = np.zeros((len(own), 3, 3, 3))
    made[:, range(3), range(3)] = own
    return made.reshape(-1, 3, 9)


def centripetal_by_rate(by_true: AnyArray, rates: Table, arms: AnyArray) -> AnyArray:
    """Return (windows, 3, 3) derivatives of the raw force by the rate, of what is centripetal at each accelerometer.

    Parameters
    ----------
    by_true : (windows, 3, 3) derivatives by the true force.
    rates : (windows, 3) rad/s.
    arms : (windows, 3, 3) m, from the axis to each accelerometer (second).
    """
    own = np.einsum("nab,nb,nac->nac", by_true, rates, arms)
    along = np.einsum("nb,nab->na", rates, arms)[:, :, None] * by_true
    return own + along - 2.0 * np.einsum("nab,nab,nc->nac", by_true, arms, rates)


def lever_arms_of(arms: Series, terms: frozenset[str], C_bf: Matrix) -> Matrix | None:
    """Return (3, 3) m where each accelerometer sits in the frame of the result; None where it is not known.

    Parameters
    ----------
    arms, terms : (9,) as they were adjusted, and the terms that were kept.
    C_bf : from the frame of the result to the sensors' own.
    """
    return np.asarray(arms.reshape(3, 3) @ C_bf, dtype=np.float64) if "lever_arms" in terms else None


def _arm_labels(frame: str) -> list[Label]:
    """In turned axes there are nine, and none that are told together."""
    if frame != "accelerometer-x":
        return _ARM.labels()
    return [*_ARM.labels(axes=tuple("xyz"[i] + "xyz"[j] for i, j in PAIRS)), *_ARMS.labels()]


def _arm_values(own: Complex, C_bf: Complex, frame: str) -> Complex:
    arms = own.reshape(3, 3)
    if frame != "accelerometer-x":
        return (arms @ C_bf).ravel()
    single = [arms[i, j] for i, j in PAIRS]
    return np.array([*single, *(arms[i, j] + s * arms[j, i] for i, j in PAIRS if i < j for s in (1.0, -1.0))])


def _arm_told(labels: list[Label], sigmas: Series) -> np.ndarray:
    """Each pair of lever arms, or else its sum or difference."""
    keep = np.ones(len(labels), dtype=bool)
    parameters = [parameter_of(name) for name, _ in labels]
    at = {one.axes: k for k, one in enumerate(parameters) if one.family in (_ARM, _ARMS)}
    for axes, k in at.items():
        keep[k] = sigmas[k] < WORTH_NAMING * APART
        if axes in _ARMS.axes:
            single = [at[axes[:2]], at[axes[3:]]]
            both = [at[f"{axes[:2]}{sign}{axes[3:]}"] for sign in "+-"]
            as_sum = np.min(sigmas[both]) < TOGETHER * np.max(sigmas[single])
            keep[k] &= as_sum
            keep[single] &= not as_sum
    return keep


def _arm_remark(named: dict[str, tuple[float, float]]) -> str:
    largest = max(
        (abs(value) for name, (value, _) in named.items() if parameter_of(name).family.kind == "lever arm"),
        default=0.0,
    )
    return (
        f"The accelerometers sit at different places of the unit, up to {1e3 * largest:.2g} mm "
        "apart by the rotations. Lever arm ij is the place of accelerometer i along j, counted "
        "from accelerometer j. The estimate takes them into account, and `tumble apply` takes "
        "out what they feel while the unit turns."
    )


def by_lag(by_true: AnyArray, rates: Table, gravity_b: Vectors) -> AnyArray:
    """Return (windows, 3) derivatives of the raw force by the lag.

    Parameters
    ----------
    by_true : (windows, 3, 3) derivatives by the true force.
    rates, gravity_b : (windows, 3) rad/s, and m/s² of the part that goes round.
    """
    return np.einsum("nab,nb->na", by_true, np.cross(rates, gravity_b))


def _remark(named: dict[str, tuple[float, float]]) -> str:
    if LAG.name not in named:
        return ""
    lag, sigma = named[LAG.name]
    earlier = "earlier" if lag > 0 else "later"
    return (
        f"A sample of the accelerometer is of an instant {abs(1e3 * lag):.2g} ms (± "
        f"{1e3 * sigma:.1g} ms) {earlier} than the gyro's with the same stamp. The estimate takes "
        "it into account. `tumble apply --shift-lag` takes it out, or give it to your filter."
    )


def _curve(
    of: Literal["accelerometer", "gyroscope"],
    curve: str,
    shown_by: Literal["force", "gyro", "table"],
    gives_way: int,
    plate: float,
    tried: str,
    remedy: str,
) -> Term:
    """Return the term of a curve that each sensor of a triad has for itself."""
    (begins, called), (one, several), power = KINDS[of], _CURVES[curve], CURVES[curve].power
    labels = tuple(f"{one} of {called} {axis}" for axis in "xyz")
    return Term(
        # The first of all terms has no other's name beside it.
        curve if (of, curve) == ("accelerometer", "quadratic") else f"{called}_{curve}",
        f"{several} of the {called}s",
        tried,
        "taken out",
        Block(f"{begins}.{curve}", labels, tuple(remedy.format(axis) for axis in "xyz")),
        lambda raw: plate / np.maximum(raw, 1e-300) ** power,
        of,
        shown_by,
        gives_way,
        curve=curve,
    )


_AT_RATES, _WITH_RATES = (
    "where a table turns at several rates both ways",
    "turns about {} at several rates, both ways",
)
_TERMS = (
    _curve("accelerometer", "asymmetry", "force", 0, 0.01, "always", "holds with {} up, down and level"),
    _curve("gyroscope", "asymmetry", "gyro", 1, 0.01, "with gyros", "turns both ways about {}"),
    Term(
        "g_sensitivity",
        "g-sensitivity of the gyros",
        "with gyros",
        "`tumble apply` takes it out",
        Block(
            "gyro.g_sensitivity",
            tuple(name for name, _ in FAMILIES["gyro g-sensitivity"].labels()),
            tuple(f"long holds with {b} up and with {b} down" for _, b in PAIRS_OF_AXES),
        ),
        lambda raw: np.repeat(1e-3 * raw, 3),
        "gyroscope",
        "gyro",
        gives_way=2,
    ),
    Term(
        "time_lag",
        "a time lag between the triads",
        "where a table turns gravity round; by hand it is [tested apart](procedures/hand-held.md)",
        "stated; `tumble apply --shift-lag` takes it out, or give it to your filter",
        Block(
            "lag",
            ("lag of the accelerometers behind the gyros",),
            ("a turn of the table about a level axis",),
        ),
        lambda _: 0.01,  # s
        "accelerometer",
        "table",
        gives_way=3,
        parameters=Parameters(lambda _: LAG.labels(), lambda lag, _C_bf, _frame: lag, remark=_remark),
    ),
    Term(
        "lever_arms",
        "lever arms of the accelerometers",
        "where a table turns about axes between x, y and z, fast enough",
        "taken out",
        Block(
            "lever_arms",
            tuple(f"lever arm of accelerometer {a} along {b}" for a, b in PAIRS_OF_AXES),
            tuple(f"fast turns of the table about both edges between {a} and {b}" for a, b in PAIRS_OF_AXES),
        ),
        lambda _: APART,
        "accelerometer",
        "table",
        gives_way=4,
        columns=np.array([3 * i + j for i, j in PAIRS]),
        in_part=True,
        parameters=Parameters(_arm_labels, _arm_values, _arm_told, _arm_remark),
    ),
    _curve("gyroscope", "quadratic", "table", 5, 1e-3, _AT_RATES, _WITH_RATES),
    _curve(
        "accelerometer", "quadratic", "force", 6, 1e-3, "always", "a hold with {0} up and one with {0} down"
    ),
)
TERMS = {term.name: term for term in _TERMS}
"""All optional terms by name, those first that give way last."""
