"""A lag between the triads: while a table turns gravity round, accelerometers that are read later see it where it was.

Gravity has moved by ``lag`` times the rate.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Table, Vectors
from tumble.calibration.terms.term import Parameters, Term
from tumble.estimation.unknowns import Block

LAG_NAME = "lag of the accelerometer behind the gyro"


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


TERM = Term(
    "time_lag",
    "a time lag between the triads",
    "where a table turns gravity round; by hand it is [tested apart](procedures/hand-held.md)",
    "stated; `tumble apply --shift-lag` takes it out, or give it to your filter",
    Block(
        "lag", ("lag of the accelerometers behind the gyros",), ("a turn of the table about a level axis",)
    ),
    lambda _: 0.01,  # s
    "accelerometer",
    "table",
    gives_way=3,
    parameters=Parameters(lambda _: [(LAG_NAME, "s")], lambda lag, _C_bf, _frame: lag, remark=_remark),
)
