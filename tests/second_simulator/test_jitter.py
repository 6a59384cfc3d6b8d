"""Stamps that jitter while a unit turns: the angles are uncertain by it, and the calibration says so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl

import tumble
from second_simulator import GRADES, PROCEDURES


def test_angles_from_stamps_that_jitter_are_stated_as_uncertain(tmp_path: Path) -> None:
    """Quiet gyros, five turns: too few to show by themselves what 4 ms of jitter do to them (7 sigmas before)."""
    z = list[float]()
    for seed in range(5):
        rng = np.random.default_rng(400 + seed)
        made = PROCEDURES["six-faces"](GRADES["tactical"], rng, None, rate=50.0)
        late = np.abs(rng.normal(0.0, 0.004, made.time.size))
        made = replace(made, time=np.maximum.accumulate(made.time + late) + 1e-7 * np.arange(made.time.size))
        file = tmp_path / "protocol.yaml"
        file.write_text(made.protocol, encoding="utf-8")
        found = tumble.calibrate(pl.DataFrame(made.columns()), protocol=file).calibration
        assert found.gyroscope is not None
        true = made.truth.terms(found.frame.name)["gyroscope.matrix"]
        names = found.covariance_parameters
        for i in range(3):
            for j in range(3):
                at = names.index(f"gyroscope.matrix[{i},{j}]")
                sigma = np.sqrt(found.covariance[at][at])
                z.append((found.gyroscope.matrix[i][j] - true[i, j]) / sigma)
    assert np.max(np.abs(z)) < 4.0
    assert np.sqrt(np.mean(np.square(z))) < 1.3
