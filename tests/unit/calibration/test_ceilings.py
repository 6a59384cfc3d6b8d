"""Variances beyond what any unit does are objected to; those that units have are not."""

from __future__ import annotations

import numpy as np

from tumble.calibration.estimate import Estimate
from tumble.calibration.evidence import Holds
from tumble.calibration.verdict import beyond_ceilings
from tumble.sensor import ImuModel


def estimate(components: dict[str, float], norms: np.ndarray) -> Estimate:
    found = Estimate(
        "hand-held",
        ImuModel(None, None),
        [],
        np.zeros((0, 0)),
        [],
        np.zeros((0, 0)),
        1.0,
        1.0,
        9,
        2.0,
        1.0,
        components,
    )
    found.show(Holds(norms, np.ones_like(norms)))
    return found


def test_a_variance_beyond_all_units_names_the_worst_hold() -> None:
    norms = np.array([1e-3, -4e-2, 2e-3])
    said = beyond_ceilings(estimate({"accelerometer bias from hold to hold, m/s²": 0.025}, norms))
    assert len(said) == 1
    assert "25 mm/s²" in said[0]
    assert "hold 2" in said[0]


def test_a_table_that_leans_by_a_degree_is_objected_to() -> None:
    said = beyond_ceilings(estimate({"table's axis against the vertical, rad": np.radians(1.0)}, np.zeros(0)))
    assert "level the table" in said[0]


def test_what_a_phone_does_is_none() -> None:
    components = {
        "accelerometer bias from hold to hold, m/s²": 0.005,
        "gyro bias from hold to hold, rad/s": np.radians(0.05),
        "table's axis against the vertical, rad": np.radians(0.1),
        "direction after a turn, rad": 0.01,
    }
    assert beyond_ceilings(estimate(components, np.array([1e-3]))) == []
