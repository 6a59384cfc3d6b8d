"""Optional terms: kept if the data want them.

A term's record stands here, or with its physics in this room. From it follow its unknowns among all others, its
derivatives, its tests, its parameters in the result, and its words.

An asymmetry is half of the relative difference of the scale factors for both signs, or both ways round. A quadratic
term is the squared own input beside it; of gyros turns at several rates show it. G-sensitivity is what a gyro shows of
the specific force along each axis. A lag between the triads shows while a table turns gravity round, for accelerometers
that are read later see it where it was: gravity has moved by ``lag`` times the rate.
"""

from typing import Literal

import numpy as np

from tumble.arrays import AnyArray, Table, Vectors
from tumble.calibration.terms import lever_arms
from tumble.calibration.terms.term import KINDS, PAIRS_OF_AXES, Parameters, Term
from tumble.estimation import Block
from tumble.parameters import FAMILIES, LAG
from tumble.sensor import CURVES

LAG_NAME = LAG.name
# One and several of each curve's terms.
_CURVES = {"asymmetry": ("asymmetry", "asymmetries"), "quadratic": ("quadratic term", "quadratic terms")}


def by_lag(by_true: AnyArray, rates: Table, gravity_b: Vectors) -> AnyArray:
    """Return (windows, 3) derivatives of the raw force by the lag.

    Parameters
    ----------
    by_true : (windows, 3, 3) derivatives by the true force.
    rates, gravity_b : (windows, 3) rad/s, and m/s² of the part that goes round.
    """
    return np.einsum("nab,nb->na", by_true, np.cross(rates, gravity_b))


def _remark(named: dict[str, tuple[float, float]]) -> str:
    if LAG_NAME not in named:
        return ""
    lag, sigma = named[LAG_NAME]
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
    lever_arms.TERM,
    _curve("gyroscope", "quadratic", "table", 5, 1e-3, _AT_RATES, _WITH_RATES),
    _curve(
        "accelerometer", "quadratic", "force", 6, 1e-3, "always", "a hold with {0} up and one with {0} down"
    ),
)
TERMS = {term.name: term for term in _TERMS}
"""All optional terms by name, those first that give way last."""

__all__ = ["LAG_NAME", "TERMS", "Term", "by_lag"]
