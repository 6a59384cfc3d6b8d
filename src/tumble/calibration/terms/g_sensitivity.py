"""G-sensitivity of the gyros: what each shows of the specific force along each axis."""

import numpy as np

from tumble.calibration.terms.term import PAIRS_OF_AXES, Term
from tumble.estimation.unknowns import Block

TERM = Term(
    "g_sensitivity",
    "g-sensitivity of the gyros",
    "with gyros",
    "`tumble apply` takes it out",
    Block(
        "gyro.g_sensitivity",
        tuple(f"g-sensitivity of gyro {a} to force {b}" for a, b in PAIRS_OF_AXES),
        tuple(f"long holds with {b} up and with {b} down" for _, b in PAIRS_OF_AXES),
    ),
    lambda raw: np.repeat(1e-3 * raw, 3),
    "gyroscope",
    "gyro",
    gives_way=2,
)
