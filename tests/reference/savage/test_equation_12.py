"""(12), written out by hand with its slips put right, against one error at a time through the simulation."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.protocol.strapdown_rotation import SEQUENCES
from tumble.sensor.conventions.savage import NAMES
from tumble_papers.savage.formulas import simulated_coefficients

PI = np.pi
X, Y, Z, START, END = range(5)
# Over g; biases over 1.
LINES: list[tuple[str, int, dict[str, float]]] = [
    ("1", X, {"kappa yy": -2 * PI, "kappa yyy": -2 * PI}),
    ("2", Y, {"kappa xx": 2 * PI, "kappa xxx": 2 * PI}),
    ("3", Y, {"kappa zz": -2 * PI, "kappa zzz": -2 * PI}),
    ("1a", X, {"kappa yy": 2 * PI, "kappa yyy": -2 * PI}),
    ("2a", Y, {"kappa xx": -2 * PI, "kappa xxx": 2 * PI}),
    ("3a", Y, {"kappa zz": 2 * PI, "kappa zzz": -2 * PI}),
    ("4", Y, {"upsilon yz": 4}),
    ("5", X, {"upsilon zx": 4}),
    ("6", Y, {"upsilon xy": 4}),
    ("7", X, {"mu xy": 2, "upsilon xy": 1}),
    ("8", X, {"mu xz": 2, "upsilon zx": 1}),
    ("9", Z, {"mu zx": 2, "upsilon zx": 1}),
    ("10", Z, {"mu zy": 2, "upsilon yz": 1}),
    ("11", Y, {"mu yz": 2, "upsilon yz": 1}),
    ("12", Y, {"mu yx": 2, "upsilon xy": 1}),
    ("7", Z, {"lambda z": -2, "kappa xx": -PI, "kappa xxx": -PI}),
    ("13", Y, {"lambda y": -2, "upsilon yz": -2}),
    ("14", X, {"lambda x": -2, "upsilon zx": -2}),
    *[
        (name, at, {f"lambda {a}{a}": -1, f"lambda {a}{a}{a}": sign, f"lambda {a}": sign})
        for name, a in (("7", "y"), ("8", "z"), ("9", "x"))
        for at, sign in ((START, 1), (END, -1))
    ],
]


@pytest.mark.parametrize(("sequence", "component", "terms"), LINES)
def test_each_measurement_has_these_coefficients_and_no_other(
    sequence: str, component: int, terms: dict[str, float]
) -> None:
    simulated, gravity = simulated_coefficients()
    found = simulated[[row.name for row in SEQUENCES].index(sequence), component]
    expected = np.zeros(24)
    for name, value in terms.items():
        expected[NAMES.index(name)] = value * (
            1.0 if name in ("lambda x", "lambda y", "lambda z") else gravity
        )
    # second order of errors of 1e-4 cancels between their signs; third order is 1e-8
    np.testing.assert_allclose(found, expected, atol=1e-5)
