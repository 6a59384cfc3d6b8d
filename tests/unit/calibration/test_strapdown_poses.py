"""Poses of a strapdown rotation that are off by more than stated do not matter, and are no objection."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl

import tumble
from second_simulator import GRADES, PROCEDURES


def test_a_fixture_twice_as_bad_as_stated_is_no_objection_where_no_number_stands_on_it(
    tmp_path: Path,
) -> None:
    made = PROCEDURES["strapdown-rotation"](
        GRADES["tactical"], np.random.default_rng(31), None, error=1e-3, rate=50.0
    )
    stated = f"uncertainty_deg: {np.degrees(2e-3)}"
    assert stated in made.protocol
    file = tmp_path / "protocol.yaml"
    file.write_text(made.protocol.replace(stated, f"uncertainty_deg: {np.degrees(4e-4)}"), encoding="utf-8")
    found = tumble.calibrate(pl.DataFrame(made.columns()), protocol=file, rate="50±0.0001").calibration
    assert found.quality.variance_components["placement beyond what the protocol says, rad"] > 8e-4
    assert found.verdict.fit
    truth = made.truth.terms(found.frame.name)
    assert found.accelerometer is not None
    bias = np.array(found.accelerometer.bias) - truth["accelerometer.bias"]
    sigma = [p.standard_uncertainty for p in found.parameters if p.name.startswith("accelerometer bias")]
    assert np.max(np.abs(bias) / sigma) < 4.5
